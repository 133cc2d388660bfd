// Labels, probabilities and class tables as users and networks leave them: read as meant, or refused and counted.
#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "core/error.h"
#include "io/images/image_encode.h"
#include "io/sequence/open_sequence.h"
#include "io/sequence/probability_images.h"
#include "io/tables/class_table_file.h"
#include "io/tables/confusion_file.h"
#include "mapping/fusion/tsdf_integrator.h"
#include "mapping/maps/map_verify.h"
#include "tests/support/data.h"
#include "tests/support/recorded_sequence.h"

using namespace felt;
using namespace felt::test;
using Catch::Matchers::Contains;
namespace fs = std::filesystem;

namespace {

constexpr const char* kTable =
    "classes: [{id: 0, name: none, ignore: true}, {id: 1, name: wall}, {id: 2, name: floor}, {id: 3, name: sofa}]\n";

struct Recording {
  TemporaryDirectory folder;
  fs::path path = folder.path() / "recording", side = folder.path() / "side";
  SequenceOptions options;
  Recording() {
    write_seven_scenes(path, 3);
    fs::create_directories(side);
    write_text(folder.path() / "classes.yaml", kTable);
    options.classes_file = folder.path() / "classes.yaml";
    options.frames = {0, 1, 1};
  }
  ReadResult read() const { return open_sequence(path, options)->read(0); }
  ProbabilityImage probabilities() const {
    ReadResult result = read();
    if (const auto* skipped = std::get_if<SkippedFrame>(&result)) FAIL(skipped->detail);
    return std::get<Frame>(result).probabilities;
  }
};

float of_class(const ProbabilityImage& image, int pixel, uint16_t id) {
  float p = 0;
  for (int m = 0; m < image.top; ++m)
    if (image.class_id[size_t(pixel * image.top + m)] == id) p += image.probability[size_t(pixel * image.top + m)];
  return p;
}

Image<uint8_t> gray(uint8_t value) { return {kWidth, kHeight, value}; }

}  // namespace

TEST_CASE("confidences beside label images become the probability of the label") {
  Recording recording;
  recording.options.labels_dir = recording.folder.path() / "labels";
  recording.options.probs_dir = recording.side;
  fs::create_directories(recording.options.labels_dir);
  write_bytes(recording.options.labels_dir / "0.png", encode_png(label_image()));
  write_bytes(recording.side / "0.png", encode_png(gray(51)));
  const ProbabilityImage image = recording.probabilities();
  CHECK(image.top == 1);
  CHECK(image.class_id[1] == label_image().data()[1]);
  CHECK(image.probability[1] == Approx(0.2));
  write_bytes(recording.side / "0.png", encode_png(Image<uint16_t>(kWidth, kHeight, 13107)));
  CHECK(recording.probabilities().probability[1] == Approx(0.2));
}

TEST_CASE("probabilities of a stack are out of what its bits can hold") {
  Recording recording;
  recording.options.probs_dir = recording.side;
  const auto written = [&](auto stack, int full) {  // class 2 with one fifth
    for (int v = 0; v < 2 * kHeight; ++v)
      for (int u = 0; u < kWidth; ++u)
        stack(u, v) = static_cast<std::decay_t<decltype(stack(0, 0))>>(v < kHeight ? 2 : full / 5);
    write_bytes(recording.side / "0.png", encode_png(stack));
    const ProbabilityImage image = recording.probabilities();
    REQUIRE(image.top == 1);
    return of_class(image, 5, 2);
  };
  CHECK(written(Image<uint16_t>(kWidth, 2 * kHeight), 65535) == Approx(0.2));
  CHECK(written(Image<uint8_t>(kWidth, 2 * kHeight), 255) == Approx(0.2));
}

TEST_CASE("images of single classes are found by the names of the table, whatever their numbers") {
  Recording recording;
  recording.options.probs_dir = recording.side;
  write_bytes(recording.side / "frame-000000.sofa.mask.png", encode_png(gray(128)));
  write_bytes(recording.side / "frame-000000.floor.png", encode_png(gray(64)));
  const ProbabilityImage image = recording.probabilities();
  CHECK(of_class(image, 5, 3) == Approx(128 / 255.0));
  CHECK(of_class(image, 5, 2) == Approx(64 / 255.0));
  CHECK(of_class(image, 5, 0) == Approx(63 / 255.0));
}

TEST_CASE("detections are masks times scores, and of one class the greatest counts") {
  Recording recording;
  recording.options.probs_dir = recording.side;
  fs::create_directories(recording.side / "00000");
  write_bytes(recording.side / "00000" / "0_3_0.5.png", encode_png(gray(255)));
  write_bytes(recording.side / "00000" / "1_3_0.9.png", encode_png(gray(51)));
  write_bytes(recording.side / "00000" / "2_1_1.png", encode_png(gray(255)));
  const ProbabilityImage image = recording.probabilities();
  CHECK(of_class(image, 5, 3) == Approx(0.5 / 1.5));  // the excess is scaled away
  CHECK(of_class(image, 5, 1) == Approx(1 / 1.5));
  CHECK(of_class(image, 5, 0) == 0);
}

TEST_CASE("of many classes the greatest are kept") {
  std::vector<DecodedClassMap> maps;
  for (uint16_t id = 1; id <= 20; ++id) maps.push_back({id, Image<uint16_t>(1, 1, id), 1 / 1000.0f});
  const ProbabilityImage image = joined_class_maps(maps, true, 3);
  REQUIRE(image.top == 4);
  CHECK(of_class(image, 0, 20) == Approx(0.02));
  CHECK(of_class(image, 0, 18) == Approx(0.018));
  CHECK(of_class(image, 0, 17) == 0);
  CHECK(of_class(image, 0, 0) == Approx(1 - 0.21));
  CHECK(of_class(joined_class_maps(maps, false, 3), 0, 0) == 0);
}

TEST_CASE("names of a CSV table may hold separators and quotes, between quotes") {
  const TemporaryDirectory folder;
  const fs::path file = folder.path() / "classes.csv";
  const auto names = [&](const std::string& text) {
    write_text(file, text);
    const ClassTable table = read_class_table(file);
    std::vector<std::string> all;
    for (const ClassInfo& c : table.classes()) all.push_back(c.name);
    return all;
  };
  CHECK(names("id,name\n1,\"door;double door\"\n2, \"chair, office\" \n3,\"12\"\" pipe\"\n") ==
        std::vector<std::string>{"door;double door", "chair, office", "12\" pipe"});
  CHECK(names("0;\"a;b\";1;2;3\n1; c ;4;5;6\r\n") == std::vector<std::string>{"a;b", "c"});
  CHECK(names("\"id\",\"name; long\"\n4,d\n5,\"left open\n") == std::vector<std::string>{"d", "left open"});
}

TEST_CASE("tables that are written read back the same, whatever their names hold") {
  const TemporaryDirectory folder;
  const ClassTable table({{0, "none", {}, true},
                          {1, "door;double door", {}, false, 1.0 / 3},
                          {2, "a \"b\", c", {}, false},
                          {3, "it's: #1", {}, false},
                          {4, "two\nlines", {}, false}});
  write_text(folder.path() / "classes.yaml", class_table_yaml(table));
  CHECK(read_class_table(folder.path() / "classes.yaml") == table);
  const std::vector<double> counts = {1, 2, 3, 4};
  const ClassTable two({{1, "door;double door", {}, false}, {2, "a \"b\", c", {}, false}});
  CHECK(parse_confusion_counts(confusion_counts_csv(counts, two), two, "counts.csv") == counts);
}

TEST_CASE("the table that lies with the labels is theirs") {
  Recording recording;
  recording.options.classes_file.clear();
  recording.options.labels_dir = recording.folder.path() / "material/";
  fs::create_directories(recording.options.labels_dir);
  write_bytes(recording.options.labels_dir / "material0.png", encode_png(label_image()));
  CHECK_THROWS_WITH(open_sequence(recording.path, recording.options), Contains("class table"));
  write_text(recording.folder.path() / "classes_material.csv", "id,name\n0,unknown\n1,wood\n2,wool\n3,steel\n");
  CHECK(open_sequence(recording.path, recording.options)->info().classes.slot_of_name("wool") == 1);
  write_text(recording.folder.path() / "material" / "classes.yaml", kTable);
  CHECK(open_sequence(recording.path, recording.options)->info().classes.slot_of_name("sofa") == 2);
}

TEST_CASE("label images that cannot be used skip their frame with the reason") {
  Recording recording;
  recording.options.labels_dir = recording.side;
  const auto reason = [&] {
    const ReadResult result = recording.read();
    const auto* skipped = std::get_if<SkippedFrame>(&result);
    return skipped == nullptr ? std::string("read") : skipped->reason;
  };
  write_bytes(recording.side / "0.png", encode_png(label_image()));
  CHECK(reason() == "read");
  write_bytes(recording.side / "0.png", encode_png(Image<uint16_t>(kWidth, kHeight / 2)));
  CHECK(reason() == "wrong-size label image");
  write_bytes(recording.side / "0.png", encode_png(color_image(0)));
  CHECK(reason() == "wrong type label image");
  write_text(recording.side / "0.png", "not a picture");
  CHECK_THAT(reason(), Contains("label image"));
  recording.options.labels_dir.clear();
  recording.options.probs_dir = recording.side;
  write_bytes(recording.side / "0.png", encode_png(Image<uint16_t>(kWidth, kHeight * 3)));
  CHECK(reason() == "wrong-size probability image");
  write_bytes(recording.side / "0.png", encode_png(Image<uint16_t>(kWidth, kHeight)));
  CHECK(reason() == "wrong-size probability image");
}

TEST_CASE("whatever label and probability images hold, only evidence of the table's classes is stored") {
  std::mt19937 random(7);
  const auto below = [&](unsigned n) { return int(random() % n); };
  Recording recording;
  size_t fused = 0, skipped = 0;
  for (int round = 0; round < 150; ++round) {
    fs::remove_all(recording.side);
    fs::create_directories(recording.side);
    const bool soft = below(2) == 0;
    const int height = below(4) == 0 ? below(3 * kHeight) + 1 : soft ? 2 * kHeight * (1 + below(4)) : kHeight;
    const int width = below(8) == 0 ? below(2 * kWidth) + 1 : kWidth;
    std::vector<uint8_t> bytes;
    if (below(5) == 0) {
      Image<uint8_t> image(width, height);
      for (uint8_t& v : image) v = uint8_t(random());
      bytes = encode_png(image);
    } else {
      Image<uint16_t> image(width, height);
      const unsigned most = below(2) == 0 ? 6 : 0x10000;
      for (uint16_t& v : image) v = uint16_t(random() % most);
      // Half of the stacks hold something like probabilities in their lower half.
      for (int v = height / 2; soft && below(2) == 0 && v < height; ++v)
        for (int u = 0; u < width; ++u) image(u, v) = uint16_t(random() % 20000);
      bytes = encode_png(image);
    }
    if (below(4) == 0) bytes[size_t(below(unsigned(bytes.size())))] ^= uint8_t(1 << below(8));
    if (below(10) == 0) bytes.resize(size_t(below(unsigned(bytes.size()))));
    write_bytes(recording.side / "0.png", bytes);
    recording.options.labels_dir = soft ? fs::path() : recording.side;
    recording.options.probs_dir = soft ? recording.side : fs::path();
    const ReadResult result = recording.read();
    const auto* frame = std::get_if<Frame>(&result);
    ++(frame == nullptr ? skipped : fused);
    if (frame == nullptr) continue;
    Map map(0.05, 0.2);
    map.classes = read_class_table(recording.options.classes_file);
    IntegrationScratch scratch;
    IntegrationConfig config;
    config.labels.max_evidence = 0.5f;
    integrate(map, *frame, config, scratch);
    REQUIRE(verify(map).empty());
  }
  CHECK(fused > 30);
  CHECK(skipped > 10);
}

TEST_CASE("whatever a class table's file holds, it is a sound table or refused") {
  std::mt19937 random(11);
  const auto below = [&](size_t n) { return size_t(random() % n); };
  const std::vector<std::string> seeds = {
      "classes: [{id: 0, name: none, ignore: true}, {id: 1, name: wall, color: [1, 2, 3], prior: 0.5}]\n",
      "classes:\n  - {id: 5, name: \"a b\"}\n  - id: 6\n    name: c\n    ignore: no\n",
      "id,name,share\n0,unknown,0.1\n1,wall,0.2\n2,floor,0.7\n", "0;unknown;0;0;0\n1;wall;21;118;128\n"};
  const std::vector<std::string> pieces = {"id", "name", ":",  "-",     "[",    "]",   "{",        "}",
                                           "\n", ",",    ";",  "65536", "-1",   "1e9", "nan",      "true",
                                           "\"", "&a",   "*a", "!!int", "\xff", "\0x", "prior: 0", "#"};
  TemporaryDirectory folder;
  size_t good = 0, refused = 0;
  for (int round = 0; round < 1500; ++round) {
    const size_t seed = below(seeds.size());
    std::string text = seeds[seed];
    for (size_t n = below(5); n > 0; --n) {
      const size_t at = below(text.size() + 1);
      if (below(3) == 0)
        text.insert(at, pieces[below(pieces.size())]);
      else if (at < text.size() && below(2) == 0)
        text.erase(at, 1 + below(4));
      else if (at < text.size())
        text[at] = char(random());
    }
    const fs::path file = folder.path() / (seed < 2 ? "t.yaml" : "t.csv");
    write_text(file, text);
    try {
      const ClassTable table = read_class_table(file);
      REQUIRE(table.size() > 0);
      double total = 0;
      for (int slot = 0; slot < table.size(); ++slot) {
        REQUIRE(table.slot_of_id(table.at_slot(slot).id) == slot);
        REQUIRE(!table.at_slot(slot).name.empty());
        total += table.prior(slot);
      }
      REQUIRE(total == Approx(table.prior_total()));
      ++good;
    } catch (const Error& fault) {
      REQUIRE_THAT(fault.what(), Contains(file.filename().string()));
      ++refused;
    }
  }
  CHECK(good > 100);
  CHECK(refused > 300);
}

TEST_CASE("recorded label folders work as they are named") {
  FELTMAP_REQUIRE_DATA(house, "house_living_rendered");
  FELTMAP_REQUIRE_DATA(icl, "icl_livingroom_maskrcnn");
  FELTMAP_REQUIRE_DATA(apc, "apc_shelf_probs");
  const auto first = [](const fs::path& path, SequenceOptions options) {
    options.frames = {0, 1, 1};
    options.read_color = false;
    const auto sequence = open_sequence(path, options);
    const ReadResult result = sequence->read(0);
    if (const auto* skipped = std::get_if<SkippedFrame>(&result)) FAIL(skipped->detail);
    Frame frame = std::get<Frame>(result);
    size_t unknown = 0;
    for (const uint16_t id : frame.labels) unknown += !sequence->info().classes.known(id);
    for (const uint16_t id : frame.probabilities.class_id) unknown += !sequence->info().classes.known(id);
    CHECK(unknown == 0);
    return std::pair(std::move(frame), sequence->info().classes);
  };
  CHECK(first(house, {}).second.slot_of_name("sofa"));
  CHECK(first(house, {.labels_dir = house / "material"}).second.slot_of_name("wood"));
  CHECK(first(house, {.labels_dir = house / "semantic"}).second.slot_of_name("sofa"));
  const auto scored = first(icl, {.labels_dir = icl / "pred_label", .probs_dir = icl / "pred_score"});
  CHECK(scored.first.probabilities.top == 1);
  CHECK(scored.second.size() == 40);
  const auto detected = first(icl, {.probs_dir = icl / "masks_raw"});
  CHECK(detected.first.probabilities.top == 9);
  for (const SequenceOptions& options : {SequenceOptions{}, SequenceOptions{.probs_dir = apc / "masks"}}) {
    const auto shelf = first(apc, options);
    CHECK(shelf.first.probabilities.top == 5);
    CHECK(shelf.second.size() == 5);
  }
  // A table of the user's own: classes are found by name.
  TemporaryDirectory folder;
  write_text(
      folder.path() / "classes.yaml",
      "classes: [{id: 0, name: background, ignore: true}, {id: 9, name: kleenex_tissue_box}, {id: 8, name: "
      "creativity_chenille_stems}, {id: 7, name: i_am_a_bunny_book}, {id: 6, name: laugh_out_loud_joke_book}]\n");
  const ProbabilityImage own = first(apc, {.classes_file = folder.path() / "classes.yaml"}).first.probabilities;
  const ProbabilityImage theirs = first(apc, {}).first.probabilities;
  for (const int pixel : {100000, 150000, 200000}) CHECK(of_class(own, pixel, 9) == of_class(theirs, pixel, 3));
}
