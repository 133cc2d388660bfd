#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "io/map_file/map_file.h"
#include "io/sequence/open_sequence.h"
#include "mapping/fusion/tsdf_integrator.h"
#include "tests/cli/command.h"
#include "tests/cli/sequences.h"
#include "tests/support/data.h"
#include "tests/support/recorded_sequence.h"

namespace felt::test {
namespace {
namespace fs = std::filesystem;
using nlohmann::json;

CommandResult reconstruct(const fs::path& sequence, const fs::path& out, const std::string& options = "") {
  return run_feltmap("reconstruct " + quoted(sequence) + " --out " + quoted(out) + " --quiet " + options);
}

/// Built beside the command's own folder: build/<preset>/tests.
fs::path stock_vdb_reader() { return command().parent_path().parent_path() / "tests" / "stock_vdb_reader"; }

size_t line_count(const std::string& text) { return size_t(std::count(text.begin(), text.end(), '\n')); }

}  // namespace

TEST_CASE("reconstruct writes a map, a mesh and a report that holds every promised key") {
  const TemporaryDirectory out;
  const CommandResult result = reconstruct(boxes(), out.path() / "result", "--json --threads 2 --frames 0:12:2");
  INFO(result.err);
  REQUIRE(result.exit_code == 0);
  CHECK(result.err.empty());
  const json report = json::parse(result.out);
  CHECK(report == json::parse(file_text(out.path() / "result/report.json")));

  CHECK(report.at("frames").at("read") == 6);
  CHECK(report.at("frames").at("fused") == 6);
  CHECK(report.at("frames").at("skipped").empty());
  CHECK(report.at("voxel_size_m") == 0.02);
  CHECK(report.at("truncation_m") == 0.08);
  CHECK(report.at("blocks") > 100);
  CHECK(report.at("blocks") == load_map(out.path() / "result/map.vdb").store.size());
  CHECK(report.at("active_voxels") > 512 * 10);
  const json& bytes = report.at("bytes");
  const size_t tsdf_bytes = bytes.at("tsdf"), voxels = 512 * report.at("blocks").get<size_t>();
  CHECK(tsdf_bytes >= 8 * voxels);
  CHECK(tsdf_bytes <= 9 * voxels);  // blocks that were made for a frame and then not observed are in it
  CHECK(bytes.at("total").get<size_t>() == bytes.at("tsdf").get<size_t>() + bytes.at("color").get<size_t>() +
                                               bytes.at("classes").get<size_t>() +
                                               bytes.at("properties").get<size_t>());
  CHECK(report.at("peak_rss_bytes") > bytes.at("total"));
  const json& time = report.at("time_s");
  for (const char* key : {"decode", "allocate", "fuse", "mesh", "save"}) {
    INFO(key);
    CHECK(time.at(key) > 0);
    CHECK(time.at(key).get<double>() < 2 * time.at("total").get<double>());
  }
  const json& fuse_ms = report.at("fuse_ms");
  CHECK(fuse_ms.at("mean") > 0);
  CHECK(fuse_ms.at("p50") <= fuse_ms.at("p95"));
  CHECK(report.at("threads") == 2);
  CHECK(report.at("simd").is_string());
  CHECK(report.at("map_hash").get<std::string>().size() == 32);
  CHECK(report.at("mesh").at("vertices") > 1000);
  CHECK(report.at("mesh").at("triangles") > 1000);
  CHECK(report.at("config").at("frames") == "0:12:2");

  const std::string mesh = file_text(out.path() / "result/mesh.ply");
  CHECK_THAT(mesh, Catch::Matchers::StartsWith("ply\n"));
  CHECK_THAT(mesh, Catch::Matchers::Contains("element vertex " + report["mesh"]["vertices"].dump() + "\n"));
}

TEST_CASE("the weight, the distance and dropoff_start decide how a frame is fused, as they do in the library") {
  const TemporaryDirectory folder;
  const fs::path sequence = folder.path() / "recording", settings = folder.path() / "settings.yaml";
  write_icl(sequence, 1);
  write_text(settings, "dropoff_start: 2\n");
  struct Case {
    std::string options;
    IntegrationConfig config;
  };
  std::vector<Case> cases = {{"--weight inverse-square --distance optical-axis", {}},
                             {"--weight sensor-noise --distance tangent-plane", {}},
                             {"--config " + quoted(settings), {}}};
  cases[0].config.weight = WeightModel::inverse_square, cases[0].config.distance = DistanceModel::optical_axis;
  cases[1].config.weight = WeightModel::sensor_noise, cases[1].config.distance = DistanceModel::tangent_plane;
  cases[2].config.dropoff_start_vox = 2;
  const auto reader = open_sequence(sequence);
  std::set<std::string> hashes;
  for (const Case& c : cases) {
    INFO(c.options);
    const CommandResult result = reconstruct(sequence, folder.path() / "out", "--force --json " + c.options);
    INFO(result.err);
    REQUIRE(result.exit_code == 0);
    Map expected(0.02, 0.08);
    IntegrationScratch scratch;
    integrate(expected, frame_of(*reader, 0), c.config, scratch);
    CHECK(json::parse(result.out).at("map_hash") == map_hash(expected));
    CHECK(hashes.insert(map_hash(expected)).second);
  }
}

TEST_CASE("a program that knows only OpenVDB reads the grids of a map") {
  const TemporaryDirectory out;
  const CommandResult made = reconstruct(boxes(), out.path(), "--json");
  REQUIRE(made.exit_code == 0);
  const json report = json::parse(made.out);
  const fs::path listing = out.path() / "grids.txt";
  REQUIRE(std::system(
              (quoted(stock_vdb_reader()) + " " + quoted(out.path() / "map.vdb") + " > " + quoted(listing)).c_str()) ==
          0);
  std::ifstream lines(listing);
  std::map<std::string, std::string> grids;
  for (std::string name, rest; lines >> name && std::getline(lines, rest);) grids[name] = rest;

  std::istringstream tsdf(grids.at("tsdf"));
  std::string type, grid_class;
  size_t active = 0;
  double voxel_m = 0, least = 0, greatest = 0;
  tsdf >> type >> grid_class >> active >> voxel_m >> least >> greatest;
  CHECK(type == "float");
  CHECK(grid_class == "level_set");
  CHECK(active == report.at("active_voxels").get<size_t>());
  CHECK(voxel_m == Approx(0.02));
  CHECK(least >= -0.0801);
  CHECK(least < -0.02);
  CHECK(greatest <= 0.0801);
  CHECK_THAT(grids.at("weight"), Catch::Matchers::StartsWith(" float unknown " + std::to_string(active)));
  CHECK_THAT(grids.at("color"), Catch::Matchers::StartsWith(" vec3s "));
}

TEST_CASE("the map has the same hash on 1, 2, 3 and 8 threads") {
  std::set<std::string> hashes;
  for (const char* threads : {"1", "2", "3", "8"}) {
    const TemporaryDirectory out;
    const CommandResult result = reconstruct(boxes(), out.path(), std::string("--json --threads ") + threads);
    REQUIRE(result.exit_code == 0);
    hashes.insert(json::parse(result.out).at("map_hash").get<std::string>());
  }
  CHECK(hashes.size() == 1);
}

TEST_CASE("results that exist are refused before any work, and replaced with --force") {
  const TemporaryDirectory out;
  std::ofstream(out.path() / "map.vdb") << "precious";
  const CommandResult refused = reconstruct(boxes(), out.path());
  CHECK(refused.exit_code == 4);
  CHECK(line_count(refused.err) == 1);
  CHECK_THAT(refused.err, Catch::Matchers::Contains("map.vdb") && Catch::Matchers::Contains("--force"));
  CHECK(file_text(out.path() / "map.vdb") == "precious");
  CHECK_FALSE(fs::exists(out.path() / "mesh.ply"));

  CHECK(reconstruct(boxes(), out.path(), "--force").exit_code == 0);
  CHECK(file_text(out.path() / "map.vdb") != "precious");
}

TEST_CASE("all that cannot be read or used is named at once, with exit code 2 where it cannot be read, else 3") {
  const TemporaryDirectory out;
  const CommandResult result =
      reconstruct(boxes(), out.path() / "result",
                  "--voxel-size 0 --max-depth -1 --frames 5:2 --truncation wide --intrinsics 1,2,3 --depth-scale nan");
  CHECK(result.exit_code == 2);
  for (const char* option :
       {"--voxel-size", "--max-depth", "--frames", "--truncation", "--intrinsics", "--depth-scale"}) {
    INFO(option << " in\n" << result.err);
    CHECK(result.err.find(option) != std::string::npos);
  }
  CHECK(line_count(result.err) == 6);
  const CommandResult readable = reconstruct(boxes(), out.path() / "result", "--voxel-size 0 --max-depth -1");
  CHECK(readable.exit_code == 3);
  CHECK(line_count(readable.err) == 2);
  CHECK_FALSE(fs::exists(out.path() / "result"));
  for (const char* size : {"-0.02", "nan", "inf"}) {
    INFO(size);
    CHECK(reconstruct(boxes(), out.path() / "result", std::string("--voxel-size ") + size).exit_code == 3);
  }
}

TEST_CASE("a truncation must hold at least one voxel, also of the size that a layout brings") {
  const TemporaryDirectory folder;
  // One scan of a range sensor, 16 bytes a point: these have voxels of 20 cm unless told otherwise.
  fs::create_directory(folder.path() / "scan");
  std::ofstream(folder.path() / "scan/000000.bin") << std::string(160, 'A');
  const CommandResult own = reconstruct(folder.path() / "scan", folder.path() / "out", "--truncation 0.1");
  CHECK(own.exit_code == 3);
  CHECK_THAT(own.err, Catch::Matchers::Contains("--truncation") &&
                          Catch::Matchers::Contains("at least one voxel, 0.2 m, found 0.1 m"));
  const CommandResult given =
      reconstruct(folder.path() / "scan", folder.path() / "out", "--truncation 0.1 --voxel-size 0.05");
  CHECK(given.exit_code != 3);
}

TEST_CASE("a map that would not fit into memory is refused with the estimate") {
  const TemporaryDirectory out;
  const CommandResult result = reconstruct(boxes(), out.path(), "--voxel-size 0.00002");
  CHECK(result.exit_code == 3);
  CHECK(line_count(result.err) == 1);
  CHECK_THAT(result.err, Catch::Matchers::Contains("memory") && Catch::Matchers::Contains("GB available"));
  CHECK(fs::is_empty(out.path()));
}

TEST_CASE("an input that is not there or no sequence exits with 4 and one line") {
  const TemporaryDirectory folder;
  fs::create_directory(folder.path() / "empty");
  for (const char* name : {"absent", "empty"}) {
    INFO(name);
    const CommandResult result = reconstruct(folder.path() / name, folder.path() / "out");
    CHECK(result.exit_code == 4);
    CHECK(line_count(result.err) == 1);
    CHECK_THAT(result.err, Catch::Matchers::Contains(name));
  }
}

TEST_CASE("a full disk exits with 4 and leaves the earlier result as it was") {
  const TemporaryDirectory out;
  REQUIRE(reconstruct(boxes(), out.path()).exit_code == 0);
  const std::string map = file_text(out.path() / "map.vdb"), mesh = file_text(out.path() / "mesh.ply");
  // A limit on the size of files stands for the full disk: writing fails in the same way, at the same places.
  const CommandResult result =
      run_feltmap_within("trap '' XFSZ; ulimit -f 64; ", "reconstruct " + quoted(boxes()) + " --out " +
                                                             quoted(out.path()) + " --force --voxel-size 0.01 --quiet");
  CHECK(result.exit_code == 4);
  CHECK(line_count(result.err) == 1);
  CHECK(file_text(out.path() / "map.vdb") == map);
  CHECK(file_text(out.path() / "mesh.ply") == mesh);
  size_t files = 0;
  for ([[maybe_unused]] const auto& entry : fs::directory_iterator(out.path())) ++files;
  CHECK(files == 3);
}

TEST_CASE("a signal saves what is fused, says so and exits with 5") {
  const TemporaryDirectory folder;
  const fs::path sequence = boxes_repeated(folder.path() / "long", 600), out = folder.path() / "out";
  for (const char* signal : {"INT", "TERM", "HUP"}) {
    INFO(signal);
    fs::remove_all(out);
    const CommandResult result = run_feltmap_within(
        "", "reconstruct " + quoted(sequence) + " --out " + quoted(out) + " --quiet --checkpoint 10",
        " & until [ -e " + quoted(out / "map.vdb") + " ]; do sleep 0.02; done; kill -" + signal + " $!; wait $!");
    CHECK(result.exit_code == 5);
    CHECK_THAT(result.err, Catch::Matchers::Contains("interrupted") && Catch::Matchers::Contains("saved"));
    const json report = json::parse(file_text(out / "report.json"));
    CHECK(report.at("frames").at("fused") > 0);
    CHECK(report.at("frames").at("fused") < 7200);
    CHECK(report.at("stopped") == "interrupted");
    const CommandResult info = run_feltmap("info --json " + quoted(out / "map.vdb"));
    REQUIRE(info.exit_code == 0);
    CHECK(json::parse(info.out).at("map_hash") == report.at("map_hash"));
  }
}

TEST_CASE("frames that cannot be used are skipped and counted by reason") {
  const TemporaryDirectory folder;
  const fs::path sequence = folder.path() / "broken";
  fs::copy(boxes(), sequence, fs::copy_options::recursive);
  std::vector<fs::path> depth;
  for (const auto& entry : fs::directory_iterator(sequence / "depth")) depth.push_back(entry.path());
  std::sort(depth.begin(), depth.end());
  fs::resize_file(depth[3], fs::file_size(depth[3]) / 2);
  fs::remove(depth[5]);
  const CommandResult result = reconstruct(sequence, folder.path() / "out", "--json");
  INFO(result.err);
  REQUIRE(result.exit_code == 0);
  const json frames = json::parse(result.out).at("frames");
  int64_t skipped = 0;
  for (const auto& [reason, count] : frames.at("skipped").items()) skipped += count.get<int64_t>();
  CHECK(frames.at("fused").get<int64_t>() + skipped == frames.at("read").get<int64_t>());
  CHECK(frames.at("fused") == 10);
  CHECK(skipped >= 1);
}

TEST_CASE("a sequence without one usable frame writes nothing and says why") {
  const TemporaryDirectory folder;
  const fs::path sequence = folder.path() / "broken";
  fs::copy(boxes(), sequence, fs::copy_options::recursive);
  for (const auto& entry : fs::directory_iterator(sequence / "depth")) {
    if (entry.path().stem() != "000000") fs::resize_file(entry.path(), 40);
  }
  const CommandResult result = reconstruct(sequence, folder.path() / "out", "--frames 1:");
  CHECK(result.exit_code == 4);
  CHECK(line_count(result.err) == 1);
  CHECK_THAT(result.err, Catch::Matchers::Contains("11 frames"));
  CHECK_FALSE(fs::exists(folder.path() / "out/map.vdb"));
}

TEST_CASE("a path that is no UTF-8 is as good as any other") {
  const TemporaryDirectory folder;
  const fs::path sequence = folder.path() / "b\xe4nke", out = folder.path() / "out";
  fs::copy(boxes(), sequence, fs::copy_options::recursive);
  const CommandResult result = reconstruct(sequence, out, "--checkpoint 4 --json");
  CHECK(result.exit_code == 0);
  CHECK(nlohmann::json::parse(result.out).at("frames").at("fused") == 12);
  CHECK(reconstruct(sequence, out, "--resume").exit_code == 0);
  CHECK(run_feltmap("info " + quoted(sequence) + " --json").exit_code == 0);
}

TEST_CASE("a file in the place of a folder is a fault of the output") {
  const TemporaryDirectory folder;
  std::ofstream(folder.path() / "taken") << "text";
  REQUIRE(reconstruct(boxes(), folder.path() / "out", "").exit_code == 0);
  const CommandResult result = run_feltmap("render " + quoted(folder.path() / "out/map.vdb") +
                                           " --pose 0,0,1,0,0,0,1 --out " + quoted(folder.path() / "taken/views"));
  CHECK(result.exit_code == 4);
  CHECK_THAT(result.err, Catch::Matchers::Contains("taken/views"));
}

TEST_CASE("a map without a surface is said to be one") {
  const TemporaryDirectory folder;
  const CommandResult coarse = reconstruct(boxes(), folder.path() / "coarse", "--voxel-size 50");
  CHECK(coarse.exit_code == 0);
  CHECK_THAT(coarse.err, Catch::Matchers::Contains("no surface") && Catch::Matchers::Contains("voxels of 50 m"));
  const CommandResult fine = reconstruct(boxes(), folder.path() / "fine", "");
  CHECK_THAT(fine.err, !Catch::Matchers::Contains("no surface"));
}

TEST_CASE("info describes a map and a sequence") {
  const TemporaryDirectory out;
  const CommandResult made = reconstruct(boxes(), out.path(), "--json");
  REQUIRE(made.exit_code == 0);
  const json report = json::parse(made.out);
  const json map = json::parse(run_feltmap("info --json " + quoted(out.path() / "map.vdb")).out);
  CHECK(map.at("kind") == "map");
  for (const char* key : {"map_hash", "voxel_size_m", "active_voxels"}) CHECK(map.at(key) == report.at(key));
  const json sequence = json::parse(run_feltmap("info --json " + quoted(boxes())).out);
  CHECK(sequence.at("kind") == "sequence");
  CHECK(sequence.at("frames") == 12);
  CHECK(sequence.at("camera").at("width") == 160);
  const std::string lines = run_feltmap("info " + quoted(boxes())).out;
  for (const char* line :
       {"\nframes: 12\n", "\ncamera:\n  width: 160\n", "\nclasses:\n  id 0, name ", "\nnotes: none\n"})
    CHECK_THAT(lines, Catch::Matchers::Contains(line));
  CHECK(run_feltmap("info " + quoted(out.path() / "absent.vdb")).exit_code == 4);
}

TEST_CASE("a sequence that says its depth is the length of rays is believed, unless an option says otherwise") {
  const TemporaryDirectory folder;
  const fs::path rays = folder.path() / "rays";
  fs::copy(boxes(), rays, fs::copy_options::recursive);
  std::ofstream(rays / "sequence.yaml", std::ios::app) << "depth_is_ray_length: true\n";
  const auto hash = [&](const fs::path& sequence, const std::string& name, const std::string& options) {
    const CommandResult result = reconstruct(sequence, folder.path() / name, "--json --frames 0:4 " + options);
    INFO(result.err);
    REQUIRE(result.exit_code == 0);
    return json::parse(result.out).at("map_hash").get<std::string>();
  };
  const std::string plain = hash(boxes(), "a", ""), by_option = hash(boxes(), "b", "--ray-length");
  CHECK(plain != by_option);
  CHECK(hash(rays, "c", "") == by_option);
  CHECK(hash(rays, "d", "--no-ray-length") == plain);
}

TEST_CASE("a frame whose pose lies outside the map is a counted skip") {
  const TemporaryDirectory folder;
  const fs::path far = folder.path() / "far";
  fs::copy(boxes(), far, fs::copy_options::recursive);
  std::string poses = file_text(far / "poses.txt");
  std::vector<std::string> lines;
  std::istringstream stream(poses);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  std::ofstream out(far / "poses.txt");
  for (size_t n = 0; n < lines.size(); ++n) {
    std::istringstream cells(lines[n]);
    std::vector<std::string> words;
    for (std::string word; cells >> word;) words.push_back(word);
    // The second frame stands a thousand million metres along x: of 16 numbers the fourth, of seven the first.
    if (n == 1) words[words.size() == 17 ? 4 : 1] = "1e9";
    for (const std::string& word : words) out << word << ' ';
    out << '\n';
  }
  out.close();
  const CommandResult result = reconstruct(far, folder.path() / "result", "--json");
  INFO(result.err);
  REQUIRE(result.exit_code == 0);
  const json frames = json::parse(result.out).at("frames");
  CHECK(frames.at("read") == 12);
  CHECK(frames.at("fused") == 11);
  CHECK(frames.at("skipped") == json{{"pose outside the map", 1}});
}

TEST_CASE("settings of labels that floats or the cap cannot hold are refused") {
  const TemporaryDirectory folder;
  for (const char* options :
       {"--label-evidence 1e39", "--class-prior 1e308", "--label-evidence 100", "--label-cap 0.5"}) {
    INFO(options);
    const CommandResult result = reconstruct(boxes(), folder.path() / "result", options);
    CHECK(result.exit_code == 3);
    CHECK_THAT(result.err, Catch::Contains("expected") && Catch::Contains("found"));
  }
}

TEST_CASE("the farthest depth is what the user says, else what the recording says") {
  const TemporaryDirectory folder;
  const fs::path sequence = folder.path() / "recording";
  write_generic(sequence, 1);
  std::ofstream(sequence / "sequence.yaml", std::ios::app) << "max_depth: 80\n";
  std::ofstream(folder.path() / "c.yaml") << "max_depth: 2\n";
  const auto max_depth_m = [&](const std::string& options) {
    const CommandResult result = reconstruct(sequence, folder.path() / "result", "--json --force " + options);
    INFO(result.err);
    REQUIRE(result.exit_code == 0);
    return json::parse(result.out).at("config").at("max_depth_m").get<double>();
  };
  CHECK(max_depth_m("") == 80);
  CHECK(max_depth_m("--max-depth 3") == 3);
  CHECK(max_depth_m("--config " + quoted(folder.path() / "c.yaml")) == 2);
}

TEST_CASE("flags of the command line overrule a configuration, also to say no") {
  const TemporaryDirectory folder;
  std::ofstream(folder.path() / "c.yaml") << "bgr: true\ncarve: true\ncolor: false\nthreads: 0\n";
  const std::string config = "--config " + quoted(folder.path() / "c.yaml");
  const auto settings = [&](const std::string& name, const std::string& options) {
    const CommandResult result = reconstruct(boxes(), folder.path() / name, "--json --frames 0:2 " + options);
    INFO(result.err);
    REQUIRE(result.exit_code == 0);
    return json::parse(result.out).at("config");
  };
  const json as_configured = settings("a", config);
  CHECK(as_configured.at("bgr") == true);
  CHECK(as_configured.at("carve") == true);
  CHECK(as_configured.at("color") == false);
  const json overruled = settings("b", config + " --bgr=false --carve=false --no-color=false");
  CHECK_FALSE(overruled.contains("bgr"));
  CHECK(overruled.at("carve") == false);
  CHECK(overruled.at("color") == true);
  std::ofstream(folder.path() / "c.yaml") << "colour_of_walls: 3\n";
  const CommandResult unknown = reconstruct(boxes(), folder.path() / "c", config);
  CHECK(unknown.exit_code == 3);
  CHECK_THAT(unknown.err, Catch::Contains("voxel_size"));
}

}  // namespace felt::test
