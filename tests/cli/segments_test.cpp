#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <set>
#include <sstream>

#include "tests/cli/command.h"
#include "tests/cli/sequences.h"
#include "tests/support/data.h"
#include "tests/support/views.h"

namespace felt::test {
namespace {
namespace fs = std::filesystem;
using nlohmann::json;

json ask(const std::string& arguments) {
  const CommandResult result = run_feltmap(arguments + " --json");
  INFO(arguments << "\n" << result.err);
  REQUIRE(result.exit_code == 0);
  return json::parse(result.out);
}

cv::Mat image(const fs::path& path) {
  cv::Mat read = cv::imread(path.string(), cv::IMREAD_UNCHANGED);
  REQUIRE_FALSE(read.empty());
  return read;
}

int value_at(const cv::Mat& m, int u, int v) {
  return m.depth() == CV_16U ? m.at<uint16_t>(v, u) : m.at<uint8_t>(v, u);
}

const fs::path kScene = source_dir() / "data" / "scenes" / "table_wall";
constexpr int kFrames = 3;

std::string frame_name(int i) { return "00000" + std::to_string(i); }

/// The scene's true labels with a third of the pixels replaced by other classes.
fs::path noisy_labels(const fs::path& folder) {
  Random random(5);
  fs::create_directory(folder);
  for (int i = 0; i < kFrames; ++i) {
    cv::Mat labels = image(kScene / "labels" / (frame_name(i) + ".png"));
    std::set<int> ids;
    for (int v = 0; v < labels.rows; ++v)
      for (int u = 0; u < labels.cols; ++u) ids.insert(value_at(labels, u, v));
    const std::vector<int> classes(ids.begin(), ids.end());
    REQUIRE(labels.type() == CV_8U);
    for (int v = 0; v < labels.rows; ++v)
      for (int u = 0; u < labels.cols; ++u)
        if (random() < 0.33) labels.at<uint8_t>(v, u) = uint8_t(classes[size_t(random() * double(classes.size()))]);
    cv::imwrite((folder / (frame_name(i) + ".png")).string(), labels);
  }
  return folder;
}

/// Share of the frames' pixels where label images in a folder are right.
double accuracy(const fs::path& folder) {
  int right = 0, all = 0;
  for (int i = 0; i < kFrames; ++i) {
    const cv::Mat truth = image(kScene / "labels" / (frame_name(i) + ".png")),
                  given = image(folder / (frame_name(i) + ".png"));
    REQUIRE(given.size() == truth.size());
    for (int v = 0; v < truth.rows; ++v)
      for (int u = 0; u < truth.cols; ++u) ++all, right += value_at(truth, u, v) == value_at(given, u, v);
  }
  return double(right) / all;
}

fs::path voted(const fs::path& labels, const fs::path& out, const std::string& how) {
  ask("segment " + quoted(kScene) + " --labels " + quoted(labels) + " --classes " + quoted(kScene / "classes.yaml") +
      " --frames 0:" + std::to_string(kFrames) + " --out " + quoted(out) + " " + how);
  return out / "labels";
}

}  // namespace

TEST_CASE("voting within segments mends noisy labels") {
  const TemporaryDirectory folder;
  const fs::path noisy = noisy_labels(folder.path() / "noisy");
  const double raw = accuracy(noisy);
  CHECK(raw < 0.85);
  CHECK(accuracy(voted(noisy, folder.path() / "by_instances", "--vote instances")) > 0.98);
  CHECK(accuracy(voted(noisy, folder.path() / "by_depth", "--vote geometric")) > raw + 0.08);
}

TEST_CASE("a folder of masks for each frame gives the segments that an instance image gives") {
  const TemporaryDirectory folder;
  const fs::path noisy = noisy_labels(folder.path() / "noisy"), masks = folder.path() / "masks";
  for (int i = 0; i < kFrames; ++i) {
    const cv::Mat instances = image(kScene / "instances" / (frame_name(i) + ".png"));
    std::set<int> ids;
    for (int v = 0; v < instances.rows; ++v)
      for (int u = 0; u < instances.cols; ++u) ids.insert(value_at(instances, u, v));
    ids.erase(0);
    fs::create_directories(masks / frame_name(i));
    for (const int id : ids)
      cv::imwrite((masks / frame_name(i) / (std::to_string(id) + ".png")).string(), instances == id);
  }
  const fs::path a = voted(noisy, folder.path() / "a", "--vote instances"),
                 b = voted(noisy, folder.path() / "b", "--vote instances --masks " + quoted(masks)),
                 c = voted(noisy, folder.path() / "c", "--vote instances --masks " + quoted(kScene / "instances"));
  for (int i = 0; i < kFrames; ++i)
    for (const fs::path& other : {b, c})
      CHECK(cv::countNonZero(image(a / (frame_name(i) + ".png")) != image(other / (frame_name(i) + ".png"))) == 0);
}

TEST_CASE("a vote without labels or without instances is an error that says so") {
  const TemporaryDirectory folder;
  const fs::path bare = folder.path() / "bare";
  fs::create_directories(bare);
  for (const char* name : {"sequence.yaml", "poses.txt"}) fs::copy(kScene / name, bare / name);
  for (const char* name : {"depth", "color"}) fs::copy(kScene / name, bare / name);
  const std::string out = " --out " + quoted(folder.path() / "out");
  const CommandResult neither = run_feltmap("segment " + quoted(bare) + out);
  CHECK(neither.exit_code == 2);
  CHECK(neither.err.find("--net or --vote") != std::string::npos);
  const CommandResult unlabelled = run_feltmap("segment " + quoted(bare) + " --vote geometric" + out);
  CHECK(unlabelled.exit_code == 4);
  CHECK(unlabelled.err.find("labels") != std::string::npos);
  const CommandResult without =
      run_feltmap("segment " + quoted(bare) + " --labels " + quoted(kScene / "labels") + " --classes " +
                  quoted(kScene / "classes.yaml") + " --vote instances" + out);
  CHECK(without.exit_code == 4);
  CHECK(without.err.find("instance") != std::string::npos);
}

TEST_CASE("a touch by frame and pixel reaches the segment under the pixel") {
  const TemporaryDirectory folder;
  const fs::path scene = source_dir() / "data" / "scenes" / "ice_crossing", map = folder.path() / "out" / "map.vdb";
  ask("reconstruct " + quoted(scene) + " --voxel-size 0.05 --out " + quoted(folder.path() / "out") + " --properties " +
      quoted(scene / "properties.yaml"));
  const std::string touch = "touch " + quoted(map) + " --sequence " + quoted(scene) +
                            " --frame 4 --pixel 80,90 --property friction --value 0.17 --dry-run --region ";
  const json by_instance = ask(touch + "mask --masks " + quoted(scene / "instances"))["touches"][0];
  CHECK(by_instance["region"]["voxels"] > 50);

  // The instance under the pixel as a mask image with its camera gives the same region.
  const cv::Mat instances = image(scene / "instances" / "000004.png");
  cv::imwrite((folder.path() / "mask.png").string(), instances == value_at(instances, 80, 90));
  std::ifstream poses(scene / "poses.txt");
  std::string pose;
  for (std::string line; std::getline(poses, line);)
    if (line.starts_with("4 ")) pose = line.substr(2);
  std::replace(pose.begin(), pose.end(), ' ', ',');
  std::ostringstream at;
  for (const json& x : by_instance["contact"]["point_m"]) at << (at.str().empty() ? "" : ",") << x.get<double>();
  const json by_mask = ask("touch " + quoted(map) + " --at=" + at.str() +
                           " --property friction --value 0.17 --dry-run --region mask --mask " +
                           quoted(folder.path() / "mask.png") + " --intrinsics 131.25,131.25,79.5,59.5 --pose=" + pose);
  CHECK(by_mask["region"]["voxels"] == by_instance["region"]["voxels"]);
  CHECK(by_mask["region"]["extent_m"] == by_instance["region"]["extent_m"]);

  // Outside the image, or a frame that the sequence lacks.
  const CommandResult outside = run_feltmap("touch " + quoted(map) + " --sequence " + quoted(scene) +
                                            " --frame 4 --pixel 900,90 --property friction --value 0.17");
  CHECK(outside.exit_code == 4);
  CHECK(outside.err.find("pixel") != std::string::npos);
  const CommandResult absent = run_feltmap("touch " + quoted(map) + " --sequence " + quoted(scene) +
                                           " --frame 99 --pixel 80,90 --property friction --value 0.17");
  CHECK(absent.exit_code == 4);
  CHECK(absent.err.find("99") != std::string::npos);
}

TEST_CASE("segments of the whole map are a region rule and a unit of suggestions") {
  const TemporaryDirectory folder;
  const fs::path scene = source_dir() / "data" / "scenes" / "ice_crossing", map = folder.path() / "out" / "map.vdb";
  ask("reconstruct " + quoted(scene) + " --voxel-size 0.05 --out " + quoted(folder.path() / "out") + " --properties " +
      quoted(scene / "properties.yaml"));
  const json suggestions =
      ask("suggest " + quoted(map) + " --property friction --region segment --min-voxels 100")["suggestions"];
  REQUIRE(suggestions.size() >= 2);
  for (const json& s : suggestions) {
    std::ostringstream at;
    at << s["point_m"][0].get<double>() << ',' << s["point_m"][1].get<double>() << ',' << s["point_m"][2].get<double>();
    const json region = ask("region " + quoted(map) + " --at=" + at.str() + " --region segment --snap 6");
    CHECK(region["voxels"] == s["voxels"]);
    CHECK(region["rule"] == "segment");
  }
  // A limit of the radius cuts the segment.
  const json first = suggestions[0];
  std::ostringstream at;
  at << first["point_m"][0].get<double>() << ',' << first["point_m"][1].get<double>() << ','
     << first["point_m"][2].get<double>();
  const json near = ask("region " + quoted(map) + " --at=" + at.str() + " --region segment --snap 6 --radius 0.2");
  CHECK(near["voxels"] > 5);
  CHECK(near["voxels"] < first["voxels"]);
}

}  // namespace felt::test
