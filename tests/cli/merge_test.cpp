// What merging keeps, and what it says of maps that do not add up.
#include <catch2/catch.hpp>
#include <filesystem>
#include <set>

#include "io/images/image_encode.h"
#include "io/map_file/map_file.h"
#include "tests/cli/command.h"
#include "tests/cli/recording.h"
#include "tests/cli/sequences.h"
#include "tests/support/data.h"
#include "tests/support/random_map.h"
#include "tests/support/recorded_sequence.h"

namespace felt::test {
namespace fs = std::filesystem;
using Catch::Matchers::Contains;
namespace {

/// Makes a map of some of the frames and returns its quoted path and a space.
std::string part(const Recording& recording, const std::string& frames, const char* name,
                 const std::string& options = "") {
  REQUIRE(recording.reconstruct(options + " --force --frames " + frames).exit_code == 0);
  const fs::path map = recording.folder.path() / name;
  fs::copy_file(recording.map, map, fs::copy_options::overwrite_existing);
  return quoted(map) + " ";
}

std::string warnings_of_merge(const Recording& recording, const std::string& maps) {
  const CommandResult result =
      run_feltmap("merge " + maps + "--force --out " + quoted(recording.folder.path() / "merged.vdb"));
  INFO(result.err);
  CHECK(result.exit_code == 0);
  return result.err;
}

}  // namespace

TEST_CASE("merging says which touches count again that one of the maps took back") {
  const Recording recording;
  REQUIRE(recording.reconstruct().exit_code == 0);
  REQUIRE(run_feltmap(recording.touch()).exit_code == 0);
  const fs::path undone = recording.out / "undone.vdb", both = recording.out / "both.vdb";
  const std::string id = id_text(load_map(recording.map).touches.touches.front().id);
  REQUIRE(run_feltmap("touch " + quoted(recording.map) + " --undo " + id + " --out " + quoted(undone)).exit_code == 0);
  const CommandResult merged = run_feltmap("merge " + quoted(recording.map) + " " + quoted(undone) + " --out " +
                                           quoted(both) + " --allow-shared-frames");
  INFO(merged.err);
  REQUIRE(merged.exit_code == 0);
  CHECK_THAT(merged.err, Contains("undone in one of the maps") && Contains(id));
  CHECK_FALSE(load_map(both).touches.touches.front().undone);
  refused("merge " + quoted(recording.map) + " --max-weight 0.5 --out " + quoted(both) + " --force", 2, "--max-weight");
}

TEST_CASE("a part of a map is not merged with the whole, and no run goes on with it") {
  const Recording recording;
  REQUIRE(recording.reconstruct().exit_code == 0);
  const fs::path part = recording.folder.path() / "part" / "map.vdb";
  fs::create_directories(part.parent_path());
  REQUIRE(
      run_feltmap("export " + quoted(recording.map) + " --vdb " + quoted(part) + " --box -1,-1,0,0.2,1,3").exit_code ==
      0);
  refused("merge " + quoted(recording.map) + " " + quoted(part) + " --out " + quoted(recording.folder.path() / "m.vdb"),
          3, "shared");
  refused(
      "reconstruct " + quoted(recording.sequence) + " --voxel-size 0.05 --resume --out " + quoted(part.parent_path()),
      4, "continued");
}

TEST_CASE("merging keeps the cap of weights that the maps were made with") {
  const Recording recording(8);
  REQUIRE(recording.reconstruct("--max-weight 3").exit_code == 0);
  const fs::path copy = recording.folder.path() / "copy.vdb";
  REQUIRE(run_feltmap("merge " + quoted(recording.map) + " --out " + quoted(copy)).exit_code == 0);
  CHECK(map_hash(load_map(copy)) == map_hash(load_map(recording.map)));
  const std::string twice = "merge " + quoted(recording.map) + " " + quoted(copy) + " --allow-shared-frames --out " +
                            quoted(recording.folder.path() / "twice.vdb");
  REQUIRE(run_feltmap(twice).exit_code == 0);
  float most = 0;
  const Map merged = load_map(recording.folder.path() / "twice.vdb");
  for (const Block& block : merged.store.blocks())
    most = std::max(most, *std::max_element(block.geometry->weight, block.geometry->weight + kBlockVoxels));
  CHECK(most == 3);
  const Recording other(2);
  REQUIRE(other.reconstruct("--max-weight 200").exit_code == 0);
  const std::string both = "merge " + quoted(recording.map) + " " + quoted(other.map) +
                           " --allow-shared-frames --out " + quoted(recording.folder.path() / "both.vdb");
  refused(both, 3, "--max-weight");
  CHECK(run_feltmap(both + " --max-weight 200").exit_code == 0);
}

TEST_CASE("merging says that a recording was understood in two ways") {
  const Recording recording;
  const std::string first = part(recording, "0:2", "first.vdb");
  CHECK_THAT(warnings_of_merge(recording, first + part(recording, "2:4", "second.vdb")), !Contains("understood"));
  write_text(recording.sequence / "sequence.yaml",
             "camera: {fx: 20, fy: 20, cx: 11.5, cy: 7.5, width: 24, height: 16}\ndepth_scale: 2500\n");
  CHECK_THAT(warnings_of_merge(recording, first + part(recording, "2:4", "scaled.vdb")),
             Contains("maps 1 and 2 are of one recording that was understood in two ways (depth scale)"));
  // Maps that were merged, and parts, have not forgotten it.
  const fs::path folder = recording.folder.path(), merged = folder / "once.vdb", cut = folder / "cut.vdb";
  REQUIRE(run_feltmap("merge " + first + quoted(folder / "second.vdb") + " --out " + quoted(merged)).exit_code == 0);
  REQUIRE(run_feltmap("export " + first + " --vdb " + quoted(cut) + " --box -9,-9,-9,9,9,9").exit_code == 0);
  for (const fs::path& map : {merged, cut})
    CHECK_THAT(
        warnings_of_merge(recording, quoted(map) + " --allow-shared-frames " + quoted(folder / "scaled.vdb") + " "),
        Contains("understood in two ways (depth scale)"));
}

TEST_CASE("merging says which settings of one recording's parts make their evidence unlike") {
  const Recording recording;
  write_text(recording.sequence / "confusion.csv", "x,wall,floor,sofa\nwall,8,1,1\nfloor,1,8,1\nsofa,1,1,8\n");
  const std::string first = part(recording, "0:2", "first.vdb");
  const auto warnings = [&](const std::string& options) {
    return warnings_of_merge(recording, first + part(recording, "2:4", "second.vdb", options));
  };
  CHECK_THAT(warnings(""), !Contains("warning"));
  // Nothing is measured otherwise.
  for (const char* same : {"--max-weight 255 --no-color", "--no-color --bgr", "--depth-scale 2000", "--max-dt 0.5",
                           "--pose-convention c2w,opencv", "--intrinsics 20,20,11.5,7.5", "--no-ray-length"})
    CHECK_THAT(warnings(same), !Contains("warning"));
  CHECK_THAT(warnings("--label-offset -1"), Contains("different settings (label_offset: -1 and none)"));
  CHECK_THAT(warnings("--bgr"), Contains("different settings (bgr: none and true)"));
  CHECK_THAT(warnings("--vote geometric"), Contains("vote: \"geometric\" and \"none\""));
  write_text(recording.folder.path() / "settings.yaml", "spread_rest: false\n");
  CHECK_THAT(warnings("--config " + quoted(recording.folder.path() / "settings.yaml")),
             Contains("different settings (spread_rest: false and true)"));
  CHECK_THAT(warnings("--confusion " + quoted(recording.sequence / "confusion.csv")),
             Contains("different settings (confusion_content: "));
}

TEST_CASE("merging does not mind that two recordings number their labels in two ways") {
  const Recording recording, other(2);
  write_bytes(other.sequence / "depth" / "0.png", encode_png(Image<uint16_t>(kWidth, kHeight, 3000)));
  const std::string maps = part(recording, ":", "first.vdb") +
                           part(other, ":", "second.vdb", "--label-offset -1 --bgr --intrinsics 21,20,11.5,7.5");
  CHECK_THAT(warnings_of_merge(recording, maps), !Contains("settings"));
  CHECK_THAT(warnings_of_merge(recording, part(recording, ":", "first.vdb") +
                                              part(other, ":", "second.vdb", "--weight inverse-square")),
             Contains("weight: "));
}

TEST_CASE("merging warns where class evidence depends on the viewpoints of one run") {
  const Recording recording(6);
  const auto warnings = [&](const std::string& options) {
    return warnings_of_merge(recording,
                             part(recording, "0:3", "a.vdb", options) + part(recording, "3:6", "b.vdb", options));
  };
  CHECK_THAT(warnings(""), !Contains("--label-novelty"));
  CHECK_THAT(warnings("--label-novelty 1"), Contains("--label-novelty"));
}

TEST_CASE("merging merged maps keeps every configuration") {
  const TemporaryDirectory folder;
  std::vector<std::string> maps;
  for (int i = 0; i < 4; ++i) {
    Map map = random_map({.seed = 1, .blocks = 2});
    map.frames = {};
    record_frame(map.frames, "recording " + std::to_string(i), "", 0);
    map.metadata = {{"config", "{\"day\": " + std::to_string(i) + "}"}};
    maps.push_back((folder.path() / (std::to_string(i) + ".vdb")).string());
    save_map(map, maps.back());
  }
  const std::string two = (folder.path() / "two.vdb").string(), all = (folder.path() / "all.vdb").string();
  REQUIRE(run_feltmap("merge " + maps[0] + " " + maps[1] + " --out " + two).exit_code == 0);
  REQUIRE(run_feltmap("merge " + two + " " + maps[2] + " " + maps[3] + " --out " + all).exit_code == 0);
  std::set<std::string> texts;
  for (const auto& [key, text] : load_map(all).metadata) texts.insert(text);
  CHECK(texts.size() == 4);
}

}  // namespace felt::test
