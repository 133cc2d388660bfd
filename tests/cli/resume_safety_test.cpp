// A run goes on only where it would have gone on had it never stopped.
#include <catch2/catch.hpp>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "io/images/image_encode.h"
#include "io/map_file/map_file.h"
#include "tests/cli/command.h"
#include "tests/cli/recording.h"
#include "tests/cli/sequences.h"
#include "tests/support/recorded_sequence.h"

namespace felt::test {
namespace fs = std::filesystem;
using Catch::Matchers::Contains;
using nlohmann::json;

TEST_CASE("a run goes on only with the tables and contents that it began with") {
  const Recording recording;
  const fs::path confusion = recording.folder.path() / "confusion.csv";
  write_text(confusion, "x,wall,floor,sofa\nwall,0.8,0.1,0.1\nfloor,0.1,0.8,0.1\nsofa,0.1,0.1,0.8\n");
  const std::string options = "--confusion " + quoted(confusion);
  REQUIRE(recording.reconstruct(options).exit_code == 0);
  const std::string hash = map_hash(load_map(recording.map));
  REQUIRE(recording.reconstruct(options + " --resume").exit_code == 0);
  CHECK(map_hash(load_map(recording.map)) == hash);
  const auto changed = [&](const fs::path& file, const std::string& from, const std::string& to) {
    const std::string before = file_text(file);
    std::string text = before;
    text.replace(text.find(from), from.size(), to);
    write_text(file, text);
    const CommandResult result = recording.reconstruct(options + " --resume");
    write_text(file, before);
    CHECK(result.exit_code == 3);
    return result.err;
  };
  CHECK_THAT(changed(recording.sequence / "classes.yaml", "sofa", "chair"), Contains("sofa"));  // the confusion's
  CHECK_THAT(changed(recording.sequence / "classes.yaml", "name: floor", "name: floor, ignore: true"),
             Contains("class table"));
  CHECK_THAT(changed(recording.sequence / "properties.yaml", "0.3", "0.35"), Contains("property table"));
  CHECK_THAT(changed(confusion, "wall,0.8,0.1", "wall,0.7,0.2"), Contains("confusion_content"));
  CHECK(map_hash(load_map(recording.map)) == hash);
}

TEST_CASE("a run goes on although its files are named in another way") {
  const Recording recording;
  const fs::path folder = recording.folder.path(), labels = folder / "labels";
  fs::rename(recording.sequence / "labels", labels);
  fs::rename(recording.sequence / "classes.yaml", folder / "classes.yaml");
  write_text(folder / "confusion.csv", "x,wall,floor,sofa\nwall,0.8,0.1,0.1\nfloor,0.1,0.8,0.1\nsofa,0.1,0.1,0.8\n");
  const auto options = [](const std::string& root) {
    return "--labels " + root + "labels --classes " + root + "classes.yaml --confusion " + root + "confusion.csv";
  };
  REQUIRE(recording.reconstruct(options(folder.string() + "/")).exit_code == 0);
  const CommandResult resumed = recording.reconstruct(options(folder.string() + "/result/../") + " --resume");
  INFO(resumed.err);
  CHECK(resumed.exit_code == 0);
  fs::rename(labels, folder / "others");
  std::string elsewhere = options(folder.string() + "/");
  elsewhere.replace(elsewhere.find("labels --classes"), 6, "others/");
  CHECK(recording.reconstruct(elsewhere + " --resume").exit_code == 0);
  write_bytes(folder / "others" / "2.png", encode_png(Image<uint16_t>(24, 16, 1)));
  const CommandResult others = recording.reconstruct(elsewhere + " --resume");
  CHECK(others.exit_code == 3);
  CHECK_THAT(others.err, Contains("label images: expected those that") && Contains("found others"));
}

TEST_CASE("a run does not go on when its recording is understood in another way, or has other labels") {
  const Recording recording;
  REQUIRE(recording.reconstruct().exit_code == 0);
  const std::string before = file_text(recording.map);
  const fs::path yaml = recording.sequence / "sequence.yaml";
  const std::string as_recorded = file_text(yaml);
  const auto refused_with = [&](const std::string& text, const std::string& reason) {
    write_text(yaml, text);
    const CommandResult result = recording.reconstruct("--resume");
    INFO(result.err);
    CHECK(result.exit_code == 3);
    CHECK_THAT(result.err, Contains("--resume: the recording's " + reason));
  };
  const std::string scaled = "camera: {fx: 20, fy: 20, cx: 11.5, cy: 7.5, width: 24, height: 16}\ndepth_scale: 2500\n";
  refused_with(scaled, "depth scale: expected \"2000.0\" as in");
  refused_with("camera: {fx: 21, fy: 20, cx: 11.5, cy: 7.5, width: 24, height: 16}\ndepth_scale: 2000\n", "camera");
  refused_with(as_recorded + "depth_is_ray_length: true\n", "depth along rays");
  refused_with(as_recorded + "pose_convention: opengl\n", "pose convention");
  write_text(yaml, as_recorded);
  CHECK(recording.reconstruct("--resume").exit_code == 0);
  fs::remove_all(recording.sequence / "labels");
  const CommandResult unlabelled = recording.reconstruct("--resume");
  CHECK(unlabelled.exit_code == 3);
  CHECK_THAT(unlabelled.err, Contains("label images"));
  CHECK(file_text(recording.map) == before);
}

TEST_CASE("a run does not go on with other stamps, and says that it is they and no other recording") {
  const Recording recording;
  REQUIRE(recording.reconstruct().exit_code == 0);
  const CommandResult result = recording.reconstruct("--resume --stamp-offset 1");
  CHECK(result.exit_code == 3);
  CHECK_THAT(result.err, Contains("--resume: stamp_offset: expected null as in") && Contains("found 1.0"));
}

TEST_CASE("touches that come after a complete run are said not to be applied") {
  const Recording recording;
  REQUIRE(recording.reconstruct().exit_code == 0);
  write_text(recording.sequence / "touches.csv", "frame,u,v,property,value\n0,12,8,friction,0.4\n");
  const CommandResult result = recording.reconstruct("--resume");
  CHECK(result.exit_code == 0);
  CHECK_THAT(result.err, Contains("touches.csv") && Contains("not applied"));
  // And where the run had a file of touches, those that were added.
  REQUIRE(recording.reconstruct("--force").exit_code == 0);
  CHECK_THAT(recording.reconstruct("--resume").err, !Contains("not applied"));
  write_text(recording.sequence / "touches.csv",
             "frame,u,v,property,value\n0,12,8,friction,0.4\n1,12,8,friction,0.41\n");
  const CommandResult grown = recording.reconstruct("--resume");
  CHECK(grown.exit_code == 0);
  CHECK_THAT(grown.err, Contains("touches.csv: has changed") && Contains("not applied"));
  CHECK(load_map(recording.map).touches.touches.size() == 1);
}

TEST_CASE("no run goes on with a merged map, of one map or of equal ones") {
  const Recording recording;
  REQUIRE(recording.reconstruct().exit_code == 0);
  const fs::path copy = recording.folder.path() / "copy.vdb", merged = recording.folder.path() / "merged" / "map.vdb";
  fs::copy_file(recording.map, copy);
  fs::create_directory(merged.parent_path());
  for (const std::string& maps :
       {quoted(copy), quoted(copy) + " " + quoted(recording.map) + " --allow-shared-frames"}) {
    REQUIRE(run_feltmap("merge --force " + maps + " --out " + quoted(merged)).exit_code == 0);
    refused("reconstruct " + quoted(recording.sequence) + " --voxel-size 0.05 --resume --out " +
                quoted(merged.parent_path()),
            4, "none: a merged map");
  }
}

TEST_CASE("a run that can fuse nothing leaves the map that lies there, checkpoints or not") {
  const Recording recording;
  REQUIRE(recording.reconstruct().exit_code == 0);
  const std::string before = file_text(recording.map);
  std::string poses;
  for (int i = 0; i < 4; ++i) poses += std::to_string(i) + " nan 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n";
  write_text(recording.sequence / "poses.txt", poses);
  CHECK(recording.reconstruct("--force --checkpoint 1").exit_code == 4);
  CHECK(file_text(recording.map) == before);
}

TEST_CASE("settings are stored with every digit, and a run does not go on with almost the same ones") {
  const Recording recording;
  REQUIRE(recording.reconstruct("--label-evidence 0.3333333").exit_code == 0);
  CHECK(json::parse(load_map(recording.map).metadata.at("config")).at("label_evidence") == 0.3333333);
  CHECK(recording.reconstruct("--label-evidence 0.333333 --resume").exit_code == 3);
  CHECK(recording.reconstruct("--label-evidence 0.3333333 --resume").exit_code == 0);
}

}  // namespace felt::test
