#include "io/segmentation/segmenter.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <opencv2/dnn.hpp>
#include <opencv2/imgproc.hpp>
#include <thread>

#include "core/error.h"
#include "io/files/text_input.h"
#include "io/images/image_decode.h"
#include "tests/support/data.h"
#include "tests/support/onnx_model.h"
#include "tests/support/views.h"

namespace felt::test {
namespace {
namespace fs = std::filesystem;

const std::vector<std::array<float, 3>> kPrototypes = {{0.9f, 0.1f, 0.1f}, {0.1f, 0.8f, 0.2f}, {0.2f, 0.2f, 0.9f}};
const std::vector<std::string> kNames = {"brick", "grass", "water"};

ColorImage noise_image(int width, int height, uint64_t seed) {
  Random random(seed);
  ColorImage image(width, height);
  for (Rgba8& c : image) c = {uint8_t(256 * random()), uint8_t(256 * random()), uint8_t(256 * random()), 255};
  return image;
}

int nearest_prototype(const Rgba8& c) {
  int best = 0;
  double least = 1e9;
  for (int i = 0; i < int(kPrototypes.size()); ++i) {
    const auto& p = kPrototypes[size_t(i)];
    const double d =
        std::pow(c.r / 255.0 - p[0], 2) + std::pow(c.g / 255.0 - p[1], 2) + std::pow(c.b / 255.0 - p[2], 2);
    if (d < least) least = d, best = i;
  }
  return best;
}

ClassTable table(std::vector<ClassInfo> classes) { return ClassTable(std::move(classes)); }

/// The message of the error that opening the network gives.
template <typename Fault>
std::string fault_of(const fs::path& description, const ClassTable& classes = {}) {
  try {
    Segmenter(read_net_description(description), classes).segment(ColorImage(8, 6), 1, 42);
  } catch (const Fault& fault) {
    return fault.what();
  }
  return "no error";
}

void replace_file(const fs::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary | std::ios::trunc) << bytes;
}

using Catch::Matchers::Contains;

}  // namespace

TEST_CASE("a network from a file labels each pixel by its colour", "[segmentation]") {
  const TemporaryDirectory folder;
  const Segmenter segmenter(read_net_description(write_net(folder.path(), nearest_color_net(kPrototypes), kNames)), {});
  REQUIRE(segmenter.classes().size() == 3);
  const ColorImage image = noise_image(40, 30, 1);
  const LabelImage labels = most_probable_labels(segmenter.segment(image, 1));
  int seen[3] = {0, 0, 0};
  for (size_t p = 0; p < image.size(); ++p) {
    const int expected = nearest_prototype(image.data()[p]);
    REQUIRE(labels.data()[p] == segmenter.classes().at_slot(expected).id);
    REQUIRE(segmenter.classes().at_slot(expected).name == kNames[size_t(expected)]);
    ++seen[expected];
  }
  for (const int count : seen) CHECK(count > 100);
}

TEST_CASE("probabilities and logits give the same classes", "[segmentation]") {
  const TemporaryDirectory a, b;
  TestNet net = nearest_color_net(kPrototypes);
  const Segmenter with_softmax(read_net_description(write_net(a.path(), net, kNames)), {});
  net.softmax = false;
  const Segmenter without(read_net_description(write_net(b.path(), net, kNames)), {});
  const ColorImage image = noise_image(24, 18, 2);
  const ProbabilityImage p = with_softmax.segment(image, 3), q = without.segment(image, 3);
  CHECK(p.class_id == q.class_id);
  for (size_t i = 0; i < p.probability.size(); ++i) REQUIRE(p.probability[i] == Approx(q.probability[i]).margin(1e-5));
}

TEST_CASE("classes of the network merge, move and vanish as the description maps them", "[segmentation]") {
  const TemporaryDirectory folder;
  const fs::path description = write_net(folder.path(), nearest_color_net(kPrototypes), kNames,
                                         "map: {brick: ground, grass: ground, water: none}\n");
  const ClassTable mine = table({{7, "unlabelled", {}, true}, {3, "sky", {}, false}, {5, "ground", {}, false}});
  const Segmenter segmenter(read_net_description(description), mine);
  const Segmenter own(read_net_description(write_net(folder.path(), nearest_color_net(kPrototypes), kNames)), {});
  const ColorImage image = noise_image(24, 18, 3);
  const ProbabilityImage p = segmenter.segment(image, 2), all = own.segment(image, 3);
  for (size_t i = 0; i < image.size(); ++i) {
    float ground = 0, none = 0;
    for (size_t j = 3 * i; j < 3 * i + 3; ++j) (all.class_id[j] == 3 ? none : ground) += all.probability[j];
    REQUIRE(p.class_id[2 * i] == (ground >= none ? 5 : 7));
    REQUIRE(p.class_id[2 * i + 1] == (ground >= none ? 7 : 5));
    REQUIRE(p.probability[2 * i] == Approx(std::max(ground, none)).margin(1e-5));
  }
}

TEST_CASE("without a table the mapped names become one, and none is ignored", "[segmentation]") {
  const TemporaryDirectory folder;
  const NetDescription net = read_net_description(write_net(folder.path(), nearest_color_net(kPrototypes), kNames,
                                                            "map: {brick: ground, grass: ground, water: none}\n"));
  const ClassTable own = own_class_table(net);
  REQUIRE(own.size() == 1);
  CHECK(own.at_slot(0).name == "ground");
  CHECK(map_classes(net, own) == std::vector<uint16_t>{0, 0, ClassTable::kNoSlot});
}

TEST_CASE("a class of the network without a place in the table is an error that names it", "[segmentation]") {
  const TemporaryDirectory folder;
  const ClassTable mine = table({{1, "grass", {}, false}});
  const fs::path strict = write_net(folder.path(), nearest_color_net(kPrototypes), kNames);
  CHECK_THAT(fault_of<ConfigError>(strict, mine), Contains("brick, water") && Contains("otherwise"));
  const fs::path lenient = write_net(folder.path(), nearest_color_net(kPrototypes), kNames, "otherwise: none\n");
  CHECK(map_classes(read_net_description(lenient), mine) ==
        std::vector<uint16_t>{ClassTable::kNoSlot, 0, ClassTable::kNoSlot});
  const fs::path unknown =
      write_net(folder.path(), nearest_color_net(kPrototypes), kNames, "map: {brick: mud}\notherwise: none\n");
  CHECK_THAT(fault_of<ConfigError>(unknown, mine), Contains("map: brick") && Contains("'mud'"));
}

TEST_CASE("interpolated classes equal interpolation of every class, then sorting", "[segmentation]") {
  Random random(4);
  for (const auto& [classes, width, height, top] : {std::array{9, 37, 29, 3}, {4, 64, 5, 4}, {2, 3, 50, 3}}) {
    ClassGrid grid{classes, 11, 7, std::vector<float>(size_t(classes) * 77)};
    for (float& p : grid.probability) p = float(random());
    const ProbabilityImage image = top_classes(grid, width, height, top);
    for (int v = 0; v < height; ++v)
      for (int u = 0; u < width; ++u) {
        const double x = std::clamp((u + 0.5) * 11 / width - 0.5, 0.0, 10.0),
                     y = std::clamp((v + 0.5) * 7 / height - 0.5, 0.0, 6.0);
        const int x0 = int(x), y0 = int(y), x1 = std::min(x0 + 1, 10), y1 = std::min(y0 + 1, 6);
        std::vector<std::pair<double, int>> all;
        for (int c = 0; c < classes; ++c) {
          const auto at = [&](int i, int j) { return double(grid.probability[size_t((j * 11 + i) * classes + c)]); };
          all.emplace_back(-((1 - (y - y0)) * ((1 - (x - x0)) * at(x0, y0) + (x - x0) * at(x1, y0)) +
                             (y - y0) * ((1 - (x - x0)) * at(x0, y1) + (x - x0) * at(x1, y1))),
                           c);
        }
        std::sort(all.begin(), all.end());
        const size_t first = (size_t(v) * width + u) * top;
        for (int r = 0; r < top; ++r) {
          const float p = image.probability[first + r];
          if (r >= classes) {
            REQUIRE(p == 0);
            continue;
          }
          REQUIRE(p == Approx(-all[size_t(r)].first).margin(1e-6));
          const bool tie = (r > 0 && std::abs(all[size_t(r)].first - all[size_t(r - 1)].first) < 1e-6) ||
                           (r + 1 < classes && std::abs(all[size_t(r)].first - all[size_t(r + 1)].first) < 1e-6);
          if (!tie) REQUIRE(image.class_id[first + r] == all[size_t(r)].second);
        }
      }
  }
}

TEST_CASE("the output equals that of calling OpenCV's dnn directly", "[segmentation]") {
  FELTMAP_REQUIRE_DATA(models, "../models");
  FELTMAP_REQUIRE_DATA(kitchen, "7scenes_redkitchen");
  const TemporaryDirectory folder;
  std::string names;
  for (int i = 0; i < 32; ++i) names += (i > 0 ? ", c" : "c") + std::to_string(i);
  replace_file(folder.path() / "net.yaml",
               "file: " + (models / "mosaic_r4_ade20k31.onnx").string() +
                   "\nbackend: opencv\ninput: {scale: 1, mean: 128, std: 127.5}\nclasses: [" + names + "]\n");
  const Segmenter segmenter(read_net_description(folder.path() / "net.yaml"), {});
  const fs::path file = kitchen / "seq-01" / "frame-000300.color.jpg";
  const std::string bytes = read_whole_file(file);
  const ColorImage color = decode_color({reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()}, "frame");
  const Planes ours = segmenter.run(color);

  cv::Mat rgb;
  cv::cvtColor(cv::Mat(color.height(), color.width(), CV_8UC4, const_cast<Rgba8*>(color.data())), rgb,
               cv::COLOR_RGBA2RGB);
  cv::dnn::Net net = cv::dnn::readNetFromONNX((models / "mosaic_r4_ade20k31.onnx").string());
  net.enableFusion(false);
  net.setInput(cv::dnn::blobFromImage(rgb, 1 / 127.5, cv::Size(512, 512), cv::Scalar(128, 128, 128)));
  const cv::Mat theirs = net.forward();
  REQUIRE(theirs.total() == ours.value.size());
  CHECK(std::memcmp(theirs.ptr<float>(), ours.value.data(), theirs.total() * sizeof(float)) == 0);

  // Labels: OpenCV's own interpolation of each plane, then the greatest.
  std::vector<cv::Mat> planes(32);
  for (int i = 0; i < 32; ++i)
    cv::resize(cv::Mat(128, 128, CV_32F, const_cast<float*>(theirs.ptr<float>(0, i))), planes[size_t(i)],
               cv::Size(color.width(), color.height()), 0, 0, cv::INTER_LINEAR);
  const LabelImage labels = most_probable_labels(segmenter.segment(color, 1));
  int differ = 0;
  for (int v = 0; v < color.height(); ++v)
    for (int u = 0; u < color.width(); ++u) {
      float greatest = -1, chosen = -1;
      for (int i = 0; i < 32; ++i) {
        greatest = std::max(greatest, planes[size_t(i)].at<float>(v, u));
        if (segmenter.classes().at_slot(i).id == labels(u, v)) chosen = planes[size_t(i)].at<float>(v, u);
      }
      differ += chosen < greatest - 1e-5f;
    }
  CHECK(differ == 0);
}

TEST_CASE("a network that gives labels instead of probabilities is read as sure of them", "[segmentation]") {
  const std::vector<uint16_t> target = {1, 0, 1};
  ClassGrid grid;
  REQUIRE(class_grid({1, 3, 1, {0, 1, 2}}, target, 2, NetOutput::labels, grid) == -1);
  CHECK(grid.probability == std::vector<float>{0, 1, 1, 0, 0, 1});
  CHECK(class_grid({1, 3, 1, {0, 1, 3}}, target, 2, NetOutput::labels, grid) == 2);
  CHECK(class_grid({1, 3, 1, {0, 0.5f, 2}}, target, 2, NetOutput::labels, grid) == 1);
}

TEST_CASE("threads that segment at once give what one gives", "[segmentation]") {
  const TemporaryDirectory folder;
  const Segmenter segmenter(read_net_description(write_net(folder.path(), nearest_color_net(kPrototypes), kNames)), {});
  const ColorImage image = noise_image(64, 48, 5);
  const ProbabilityImage expected = segmenter.segment(image, 2);
  std::vector<ProbabilityImage> results(8);
  std::vector<std::thread> threads;
  for (ProbabilityImage& result : results) threads.emplace_back([&] { result = segmenter.segment(image, 2); });
  for (std::thread& thread : threads) thread.join();
  for (const ProbabilityImage& result : results) {
    CHECK(result.class_id == expected.class_id);
    CHECK(result.probability == expected.probability);
  }
}

TEST_CASE("a model that is missing, cut short or something else is an error that names it", "[segmentation]") {
  const TemporaryDirectory folder;
  const fs::path description = write_net(folder.path(), nearest_color_net(kPrototypes), kNames);
  const fs::path model = folder.path() / "net.onnx";
  const std::string whole = onnx_model(nearest_color_net(kPrototypes));
  fs::remove(model);
  CHECK_THAT(fault_of<ConfigError>(description), Contains("net.yaml:1: file") && Contains(model.string()));
  for (const size_t size : {size_t(0), size_t(5), whole.size() / 3, whole.size() / 2, whole.size() - 20}) {
    replace_file(model, whole.substr(0, size));
    INFO(size);
    CHECK_THAT(fault_of<FormatError>(description), Contains(model.string()) && Contains("expected"));
  }
  replace_file(model, "this is a text about networks");
  CHECK_THAT(fault_of<FormatError>(description), Contains(model.string()));
}

TEST_CASE("wrong names of input and output are errors that list the right ones", "[segmentation]") {
  const TemporaryDirectory folder;
  TestNet net = nearest_color_net(kPrototypes);
  net.input = "pixels", net.output = "scores";
  const fs::path description = write_net(folder.path(), net, kNames);
  replace_file(description, "file: net.onnx\ninput: {name: image}\noutput: {name: prob}\nclasses: [a, b, c]\n");
  const std::string message = fault_of<ConfigError>(description);
  CHECK_THAT(message, Contains("net.onnx: input name: expected one of pixels [1, 3, ?, ?], found 'image'"));
  CHECK_THAT(message, Contains("net.onnx: output name: expected one of scores [1, 3, ?, ?], found 'prob'"));
  replace_file(description, "file: net.onnx\nclasses: [a, b, c]\n");
  CHECK(fault_of<Error>(description) == "no error");
}

TEST_CASE("an operator that the library does not know is an error that names it", "[segmentation]") {
  const TemporaryDirectory folder;
  TestNet net = nearest_color_net(kPrototypes);
  net.last_operator = "Frobnicate";
  const std::string message = fault_of<FormatError>(write_net(folder.path(), net, kNames));
  CHECK_THAT(message, Contains("net.onnx") && Contains("Frobnicate"));
  CHECK(message.find('\n') == std::string::npos);
}

TEST_CASE("a number of classes or a size that is not the model's is an error that says both", "[segmentation]") {
  const TemporaryDirectory folder;
  TestNet net = nearest_color_net(kPrototypes);
  net.width = 32, net.height = 16;
  const fs::path four = write_net(folder.path(), net, {"a", "b", "c", "d"});
  CHECK_THAT(fault_of<ConfigError>(four), Contains("expected 3 names") && Contains("found 4"));
  const fs::path description = write_net(folder.path(), net, kNames);
  CHECK(fault_of<Error>(description) == "no error");  // the model's own size
  replace_file(description, "file: net.onnx\ninput: {size: [64, 64]}\nclasses: [a, b, c]\n");
  CHECK_THAT(fault_of<ConfigError>(description), Contains("[1, 3, 64, 64]") && Contains("image [1, 3, 16, 32]"));
}

TEST_CASE("an input larger than any picture is refused before memory is taken for it", "[segmentation]") {
  const TemporaryDirectory folder;
  TestNet net = nearest_color_net(kPrototypes);
  net.width = 1 << 30, net.height = 8;
  CHECK_THROWS_WITH(Segmenter(read_net_description(write_net(folder.path(), net, kNames)), {}),
                    Contains("at most 8192 pixels") && Contains("1073741824"));
}

TEST_CASE("an output that is not finite, or no probability, is an error that names model and frame", "[segmentation]") {
  const TemporaryDirectory folder;
  TestNet net = nearest_color_net(kPrototypes);
  net.classes[1][3] = std::numeric_limits<float>::quiet_NaN();
  net.softmax = false;  // OpenCV's softmax turns a NaN into a number
  CHECK_THAT(fault_of<FormatError>(write_net(folder.path(), net, kNames)),
             Contains("net.onnx: output prob, frame 42: expected"));
  net = nearest_color_net(kPrototypes);
  net.softmax = false;
  const fs::path description = write_net(folder.path(), net, kNames);
  replace_file(description, "file: net.onnx\nclasses: [a, b, c]\n");
  CHECK_THAT(fault_of<FormatError>(description), Contains("kind: logits"));
}

TEST_CASE("every problem of a network description is reported with its line", "[segmentation]") {
  const TemporaryDirectory folder;
  write_net(folder.path(), nearest_color_net(kPrototypes), kNames);
  const fs::path description = folder.path() / "net.yaml";
  replace_file(description,
               "file: net.onnx\ninput: {size: [0, 4], order: gbr, std: 0}\noutput: {kind: votes}\nclasses: [a, a]\n"
               "map: {b: c}\nspeed: 3\n");
  const std::string message = fault_of<ConfigError>(description);
  for (const char* problem : {":2: size", ":2: order", ":2: std", ":3: kind", ":4: classes", ":5: map", ":6: key"})
    CHECK_THAT(message, Contains("net.yaml" + std::string(problem)));
}

TEST_CASE("onnxruntime is used only where it was built in", "[segmentation]") {
  const TemporaryDirectory folder;
  const fs::path description =
      write_net(folder.path(), nearest_color_net(kPrototypes), kNames, "backend: onnxruntime\n");
  if (available_net_backends().size() == 1) {
    CHECK_THAT(fault_of<ConfigError>(description), Contains("built without"));
    return;
  }
  // Both libraries agree.
  const ColorImage image = noise_image(32, 24, 6);
  const Planes theirs = Segmenter(read_net_description(description), {}).run(image);
  const fs::path other = write_net(folder.path(), nearest_color_net(kPrototypes), kNames, "backend: opencv\n");
  const Planes ours = Segmenter(read_net_description(other), {}).run(image);
  REQUIRE(theirs.value.size() == ours.value.size());
  for (size_t i = 0; i < ours.value.size(); ++i) REQUIRE(theirs.value[i] == Approx(ours.value[i]).margin(1e-5));
}

}  // namespace felt::test
