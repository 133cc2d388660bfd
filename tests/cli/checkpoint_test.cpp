#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>

#include "io/map_file/map_file.h"
#include "tests/cli/command.h"
#include "tests/cli/sequences.h"
#include "tests/support/data.h"

namespace felt::test {
namespace {
namespace fs = std::filesystem;
using nlohmann::json;

std::string reconstruct(const fs::path& sequence, const fs::path& out, const std::string& options = "") {
  return "reconstruct " + quoted(sequence) + " --out " + quoted(out) + " --quiet --voxel-size 0.04 " + options;
}

/// Frames that the checkpoint's run had read; 0 where there is none.
int64_t frames_in(const fs::path& map) {
  if (!fs::exists(map)) return 0;
  return json::parse(load_map(map).metadata.at("progress")).at("read").get<int64_t>();
}

/// The number in the last "checkpoint after N frames" of a log; 0 without.
int64_t last_logged(const std::string& log) {
  const std::string words = "checkpoint after ";
  const size_t at = log.rfind(words);
  return at == std::string::npos ? 0 : std::stoll(log.substr(at + words.size()));
}

/// Runs the command and kills it as soon as `map` is there, or is another file than before. The exit code is 0 where
/// the run was sooner.
CommandResult killed_at_the_next_checkpoint(const std::string& arguments, const fs::path& map,
                                            const std::string& after_s = "0") {
  const TemporaryDirectory folder;
  const fs::path before = folder.path() / "before";
  if (fs::exists(map)) fs::copy_file(map, before);
  return run_feltmap_within("", arguments,
                            " & pid=$!; until [ -e " + quoted(map) + " ] && ! cmp -s " + quoted(map) + " " +
                                quoted(before) + "; do kill -0 $pid 2>/dev/null || break; sleep 0.01; done; sleep " +
                                after_s + "; kill -9 $pid 2>/dev/null; wait $pid");
}

size_t parts_in(const fs::path& folder) {
  size_t parts = 0;
  for (const auto& entry : fs::directory_iterator(folder))
    parts += entry.path().filename().string().find(".part-") != std::string::npos;
  return parts;
}

}  // namespace

TEST_CASE(
    "a run killed at any moment loses at most what came after the last checkpoint, and resuming gives the same "
    "map") {
  // FELTMAP_KILLS=50 for the long run.
  const char* asked = std::getenv("FELTMAP_KILLS");
  const int kills = asked != nullptr ? std::atoi(asked) : 6;
  constexpr int kEvery = 10;
  const TemporaryDirectory folder;
  const fs::path sequence = boxes_repeated(folder.path() / "sequence", 15), whole = folder.path() / "whole",
                 out = folder.path() / "out";
  const auto start = std::chrono::steady_clock::now();
  REQUIRE(run_feltmap(reconstruct(sequence, whole, "--checkpoint 10")).exit_code == 0);
  const double whole_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  const std::string hash = json::parse(file_text(whole / "report.json")).at("map_hash");

  // The first kills come at the next checkpoint, until one was before the end; the others at random moments.
  std::mt19937 engine(1);
  int killed = 0, between = 0, rounds = 0;
  while (killed < kills) {
    REQUIRE(++rounds <= 10 * kills);
    fs::remove_all(out);
    int64_t saved = 0;
    for (bool done = false; !done;) {
      const double pause_s = killed < kills ? whole_s * double(engine() % 1000) / 1000 : 60;
      const std::string arguments = reconstruct(sequence, out, "--checkpoint 10 --resume --log-level info");
      const CommandResult run =
          between == 0 ? killed_at_the_next_checkpoint(arguments, out / "map.vdb")
                       : run_feltmap_within(
                             "", arguments,
                             " & pid=$!; (sleep " + std::to_string(pause_s) +
                                 "; kill -9 $pid) 2>/dev/null & wait $pid; code=$?; kill $! 2>/dev/null; exit $code");
      INFO(run.err);
      done = run.exit_code == 0;
      if (done) break;
      REQUIRE(run.exit_code == 128 + 9);
      ++killed;
      const int64_t now = frames_in(out / "map.vdb");
      CHECK(now >= saved);
      CHECK((now % kEvery == 0 || now == 180));
      CHECK(now >= last_logged(run.err));
      between += now > 0 && now < 180;
      saved = now;
    }
    const json report = json::parse(file_text(out / "report.json"));
    CHECK(report.at("map_hash") == hash);
    CHECK(report.at("frames").at("read") == 180);
    CHECK(report.at("frames").at("fused") == 180);
    CHECK(file_text(out / "map.vdb") == file_text(whole / "map.vdb"));
    CHECK(file_text(out / "mesh.ply") == file_text(whole / "mesh.ply"));
    CHECK(parts_in(out) == 0);
  }
  CHECK(between > 0);
  WARN(killed << " kills, " << between << " of them between the first checkpoint and the end");
}

TEST_CASE("a checkpoint that replaces a map leaves no mesh and no report of another one beside it") {
  const TemporaryDirectory folder;
  const fs::path sequence = boxes_repeated(folder.path() / "sequence", 40), out = folder.path() / "out";
  REQUIRE(run_feltmap(reconstruct(sequence, out)).exit_code == 0);
  REQUIRE(fs::exists(out / "mesh.ply"));
  const CommandResult killed = killed_at_the_next_checkpoint(
      reconstruct(sequence, out, "--force --checkpoint 10 --threads 1"), out / "map.vdb", "0.1");
  REQUIRE(killed.exit_code == 128 + 9);
  CHECK(frames_in(out / "map.vdb") < 480);
  CHECK_FALSE(fs::exists(out / "mesh.ply"));
  CHECK_FALSE(fs::exists(out / "report.json"));
}

TEST_CASE("a run that was interrupted goes on with --resume to the same map") {
  const TemporaryDirectory folder;
  const fs::path sequence = boxes_repeated(folder.path() / "sequence", 100), out = folder.path() / "out",
                 whole = folder.path() / "whole";
  const CommandResult stopped =
      run_feltmap_within("", reconstruct(sequence, out, "--checkpoint 10"),
                         " & until [ -e " + quoted(out / "map.vdb") + " ]; do sleep 0.02; done; kill -INT $!; wait $!");
  INFO(stopped.err);
  REQUIRE(stopped.exit_code == 5);
  CHECK_THAT(stopped.err, Catch::Matchers::Contains("--resume"));
  const int64_t read = frames_in(out / "map.vdb");
  CHECK(read > 0);
  CHECK(read < 1200);
  REQUIRE(run_feltmap(reconstruct(sequence, out, "--checkpoint 10 --resume")).exit_code == 0);
  REQUIRE(run_feltmap(reconstruct(sequence, whole)).exit_code == 0);
  const json report = json::parse(file_text(out / "report.json"));
  CHECK(report.at("frames").at("resumed_after") == read);
  CHECK(report.at("frames").at("fused") == 1200);
  CHECK(report.at("map_hash") == json::parse(file_text(whole / "report.json")).at("map_hash"));
}

TEST_CASE("touches of a run that is stopped before, between and after them make the map of an uninterrupted run") {
  // The room's touches belong to frames 4, 9, 14 and 19 of 24.
  const TemporaryDirectory folder;
  const fs::path room = source_dir() / "data/scenes/room", whole = folder.path() / "whole", out = folder.path() / "out";
  const std::string options = "--no-color --checkpoint 4";
  REQUIRE(run_feltmap(reconstruct(room, whole, options)).exit_code == 0);
  const json expected = json::parse(file_text(whole / "report.json"));
  REQUIRE(expected.at("touches").at("applied") == 4);
  const auto same_as_whole = [&] {
    const json report = json::parse(file_text(out / "report.json"));
    CHECK(report.at("map_hash") == expected.at("map_hash"));
    CHECK(report.at("touches") == expected.at("touches"));
    CHECK(file_text(out / "map.vdb") == file_text(whole / "map.vdb"));
    CHECK(file_text(out / "mesh.ply") == file_text(whole / "mesh.ply"));
  };
  // Killed again and again, each time as soon as there is another checkpoint.
  std::vector<int64_t> stops;
  for (int64_t read = 0; read < 24;) {
    const CommandResult run =
        killed_at_the_next_checkpoint(reconstruct(room, out, options + " --resume --threads 1"), out / "map.vdb");
    const int64_t now = frames_in(out / "map.vdb");
    INFO(run.err);
    REQUIRE(now > read);
    read = now;
    stops.push_back(now);
    if (run.exit_code == 0) break;
    REQUIRE(run.exit_code == 128 + 9);
  }
  const auto between = std::count_if(stops.begin(), stops.end(), [](int64_t n) { return n > 4 && n <= 19; });
  INFO(stops.size() << " stops");
  CHECK(between >= 1);
  REQUIRE(run_feltmap(reconstruct(room, out, options + " --resume")).exit_code == 0);
  same_as_whole();
  // Once more after the end: nothing is applied twice, and the report still says what became of them.
  REQUIRE(run_feltmap(reconstruct(room, out, options + " --resume")).exit_code == 0);
  same_as_whole();
}

TEST_CASE("where views count by how new they are, a resumed run compares them with those of before the stop, too") {
  const TemporaryDirectory folder;
  const fs::path room = source_dir() / "data/scenes/room", whole = folder.path() / "whole", out = folder.path() / "out";
  const std::string options = "--no-color --checkpoint 4 --label-novelty 0.5 --label-turn 20";
  REQUIRE(run_feltmap(reconstruct(room, whole, options)).exit_code == 0);
  const CommandResult stopped =
      killed_at_the_next_checkpoint(reconstruct(room, out, options + " --threads 1"), out / "map.vdb");
  INFO(stopped.err);
  REQUIRE(stopped.exit_code == 128 + 9);
  const int64_t read = frames_in(out / "map.vdb");
  CHECK(read > 0);
  CHECK(read < 24);
  REQUIRE(run_feltmap(reconstruct(room, out, options + " --resume")).exit_code == 0);
  CHECK(json::parse(file_text(out / "report.json")).at("map_hash") ==
        json::parse(file_text(whole / "report.json")).at("map_hash"));
  CHECK(file_text(out / "map.vdb") == file_text(whole / "map.vdb"));
}

TEST_CASE("resuming with another recording or other settings is refused, each named, and the map stays") {
  const TemporaryDirectory folder;
  const fs::path out = folder.path() / "out", other = boxes_repeated(folder.path() / "other", 2);
  REQUIRE(run_feltmap(reconstruct(boxes(), out)).exit_code == 0);
  const std::string map = file_text(out / "map.vdb");
  const CommandResult settings = run_feltmap(reconstruct(boxes(), out, "--resume --max-depth 3 --weight sensor-noise"));
  CHECK(settings.exit_code == 3);
  CHECK_THAT(settings.err, Catch::Matchers::Contains("max_depth_m: expected 4.0") &&
                               Catch::Matchers::Contains("weight: expected \"constant\""));
  for (const std::string other_optics : {"distortion", "body-camera", "depth-encoding"}) {
    const std::string value = other_optics == "distortion"    ? "0.1,0,0,0"
                              : other_optics == "body-camera" ? "0,0,0.1,0,0,0,1"
                                                              : "plain";
    const CommandResult optics = run_feltmap(reconstruct(boxes(), out, "--resume --" + other_optics + " " + value));
    INFO(other_optics);
    CHECK(optics.exit_code == 3);
    CHECK_THAT(optics.err, Catch::Matchers::Contains("--resume"));
  }
  const CommandResult recording = run_feltmap(reconstruct(other, out, "--resume"));
  CHECK(recording.exit_code == 3);
  CHECK_THAT(recording.err, Catch::Matchers::Contains("recording"));
  CHECK(file_text(out / "map.vdb") == map);
  std::ofstream(out / "map.vdb", std::ios::app) << "x";
  CHECK(run_feltmap(reconstruct(boxes(), out, "--resume")).exit_code == 4);
}

TEST_CASE("parts of a recording merge, and parts that share frames are refused, wherever the recording lies") {
  const TemporaryDirectory folder;
  const fs::path copy = folder.path() / "copy";
  fs::copy(boxes(), copy, fs::copy_options::recursive);
  const auto part = [&](const fs::path& sequence, const char* name, const char* frames) {
    REQUIRE(run_feltmap(reconstruct(sequence, folder.path() / name, std::string("--frames ") + frames)).exit_code == 0);
    return quoted(folder.path() / name / "map.vdb");
  };
  const std::string even = part(boxes(), "even", "0::2"), odd = part(boxes(), "odd", "1::2"),
                    third = part(copy, "third", "0::3"), all = part(boxes(), "all", ":");
  const std::string merged = quoted(folder.path() / "merged.vdb");
  const CommandResult good = run_feltmap("merge " + odd + " " + even + " --out " + merged + " --json");
  INFO(good.err);
  REQUIRE(good.exit_code == 0);
  CHECK(json::parse(good.out).at("frames") == 12);
  CHECK(run_feltmap("diff " + merged + " " + all + " --tol 0.05").exit_code == 0);
  const CommandResult bad = run_feltmap("merge " + even + " " + third + " --out " + merged + "2");
  CHECK(bad.exit_code == 3);
  CHECK_THAT(bad.err, Catch::Matchers::Contains("2 shared"));
  CHECK(run_feltmap("merge " + even + " " + third + " --allow-shared-frames --out " + merged + "2").exit_code == 0);
  // As if all of it had been fused, but no run can go on behind two ends.
  fs::create_directory(folder.path() / "two");
  fs::copy_file(folder.path() / "merged.vdb", folder.path() / "two" / "map.vdb");
  const CommandResult two_ends = run_feltmap(reconstruct(boxes(), folder.path() / "two", "--resume"));
  CHECK(two_ends.exit_code == 4);
  CHECK_THAT(two_ends.err, Catch::Matchers::Contains("a merged map cannot be continued"));
}

TEST_CASE("a recording that grew keeps its name: no frame counts twice, and resuming says what happened") {
  const TemporaryDirectory folder;
  const fs::path before = boxes_repeated(folder.path() / "before", 1),
                 after = boxes_repeated(folder.path() / "after", 2), out = folder.path() / "out";
  REQUIRE(run_feltmap(reconstruct(before, out)).exit_code == 0);
  const CommandResult resumed = run_feltmap(reconstruct(after, out, "--resume"));
  CHECK(resumed.exit_code == 3);
  CHECK_THAT(resumed.err, Catch::Matchers::Contains("grown or changed") && Catch::Matchers::Contains("--frames"));
  const auto part = [&](const char* name, const char* frames) {
    REQUIRE(run_feltmap(reconstruct(after, folder.path() / name, std::string("--frames ") + frames)).exit_code == 0);
    return quoted(folder.path() / name / "map.vdb");
  };
  const std::string all = part("all", ":"), rest = part("rest", "12:"), first = quoted(out / "map.vdb"),
                    to = " --out " + quoted(folder.path() / "merged.vdb");
  const CommandResult twice = run_feltmap("merge " + first + " " + all + to);
  CHECK(twice.exit_code == 3);
  CHECK_THAT(twice.err, Catch::Matchers::Contains("12 shared"));
  const CommandResult joined = run_feltmap("merge " + first + " " + rest + to);
  CHECK(joined.exit_code == 0);
  CHECK_THAT(joined.err, !Catch::Matchers::Contains("warning"));
  CHECK(run_feltmap("diff " + quoted(folder.path() / "merged.vdb") + " " + all + " --tol 0.05").exit_code == 0);
}

TEST_CASE("merging warns of the same images with other poses, and of what does not add up to one run") {
  const TemporaryDirectory folder;
  const auto part = [&](const fs::path& sequence, const char* name, const char* options) {
    REQUIRE(run_feltmap(reconstruct(sequence, folder.path() / name, options)).exit_code == 0);
    return quoted(folder.path() / name / "map.vdb") + " ";
  };
  const auto merged = [&](const std::string& maps) {
    const CommandResult result = run_feltmap("merge --force " + maps + "--out " + quoted(folder.path() / "m.vdb"));
    CHECK(result.exit_code == 0);
    return result.err;
  };
  // Poses of the same images, a frame later each.
  const fs::path moved = folder.path() / "moved";
  fs::copy(boxes(), moved, fs::copy_options::recursive);
  std::istringstream poses(file_text(boxes() / "poses.txt"));
  std::ofstream later(moved / "poses.txt");
  for (std::string line, pose; std::getline(poses, line);) {
    if (line.empty() || line[0] == '#') continue;
    const std::string number = line.substr(0, line.find(' '));
    later << number << (pose.empty() ? line.substr(number.size()) : pose) << '\n';
    pose = line.substr(number.size());
  }
  later.close();
  const std::string even = part(boxes(), "even", "--frames 0::2"), odd = part(boxes(), "odd", "--frames 1::2");
  CHECK_THAT(merged(even + odd), !Catch::Matchers::Contains("warning"));
  CHECK_THAT(merged(even + part(moved, "moved_map", "--frames 0::3")),
             Catch::Matchers::Contains("same images") && Catch::Matchers::Contains("2 frames count twice"));
  CHECK_THAT(merged(even + part(moved, "moved_odd", "--frames 1::2")),
             Catch::Matchers::Contains("maps 1 and 2 hold the same images with other poses or stamps: what is added up "
                                       "was not measured in one world frame"));
  CHECK_THAT(merged(even + part(boxes(), "squares", "--frames 1::2 --weight inverse-square --max-depth 3")),
             Catch::Matchers::Contains("weight: \"constant\" and \"inverse-square\"") &&
                 Catch::Matchers::Contains("max_depth_m: 3.0 and 4.0"));
}

}  // namespace felt::test
