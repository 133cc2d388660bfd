#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "io/map_file/map_file.h"
#include "io/meshes/mesh_io.h"
#include "mapping/surface/marching_cubes.h"
#include "tests/cli/command.h"
#include "tests/support/analytic_map.h"
#include "tests/support/data.h"
#include "tests/support/labelled_map.h"
#include "tests/support/squares.h"

namespace felt::test {
namespace {
using Catch::Matchers::Contains;
using Catch::Matchers::Matches;

/// A wall a metre in front of the camera, saved as map.vdb.
std::filesystem::path wall_map(const TemporaryDirectory& folder) {
  Map map(0.02, 0.08);
  fill_map(map, {-20, -20, 44}, {20, 20, 56}, [](const Eigen::Vector3d& p) { return 1.0 - p.z(); });
  save_map(map, folder.path() / "map.vdb");
  return folder.path() / "map.vdb";
}

}  // namespace

TEST_CASE("render writes depth in millimetres and an overview that stock readers open") {
  const TemporaryDirectory folder;
  const std::string map = wall_map(folder).string(), out = (folder.path() / "views").string();
  const CommandResult result = run_feltmap("render " + map + " --pose 0,0,0,0,0,0,1 --pose 0,0,0.25,0,0,0,1 --out " +
                                           out + " --intrinsics 60,60,15.5,11.5 --size 32x24 --overview " +
                                           (folder.path() / "o.png").string() + " --json");
  INFO(result.err);
  REQUIRE(result.exit_code == 0);
  CHECK(nlohmann::json::parse(result.out)["views"].size() == 2);
  const cv::Mat depth = cv::imread(out + "/000000.depth.png", cv::IMREAD_UNCHANGED);
  REQUIRE((depth.type() == CV_16UC1 && depth.cols == 32 && depth.rows == 24));
  CHECK(depth.at<uint16_t>(12, 16) == 1000);
  CHECK(cv::imread(out + "/000001.depth.png", cv::IMREAD_UNCHANGED).at<uint16_t>(12, 16) == 750);
  CHECK(cv::imread(out + "/000000.normal.png").at<cv::Vec3b>(12, 16) == cv::Vec3b(0, 128, 128));
  CHECK_FALSE(cv::imread((folder.path() / "o.png").string()).empty());
}

TEST_CASE("render names what it cannot use") {
  const TemporaryDirectory folder;
  const std::string map = wall_map(folder).string();
  CHECK(run_feltmap("render " + map).exit_code == 2);
  CHECK(run_feltmap("render " + map + " --pose 0,0,0,0,0,0,1").exit_code == 2);
  CHECK(run_feltmap("render " + map + " --pose 1,2,3 --out x").exit_code == 2);
  const CommandResult classes = run_feltmap("render " + map + " --pose 0,0,0,0,0,0,1 --images class --out x");
  CHECK(classes.exit_code == 3);
  CHECK_THAT(classes.err, Contains("a map with classes"));
  const CommandResult both = run_feltmap("render " + map + " --pose 0,0,0,0,0,0,1 --out x --intrinsics 1,2 --size 0x5");
  CHECK(both.exit_code == 2);
  CHECK_THAT(both.err, Contains("--intrinsics") && Contains("--size"));
  CHECK(run_feltmap("render " + (folder.path() / "absent.vdb").string() + " --pose 0,0,0,0,0,0,1 --out x").exit_code ==
        4);
}

TEST_CASE("render sees what a recorded sequence saw: its camera, the poses of the frames that were asked for") {
  const TemporaryDirectory folder;
  const std::string scene = (source_dir() / "data" / "scenes" / "table_wall").string(), map = wall_map(folder).string(),
                    out = (folder.path() / "views").string();
  const auto render = [&](const std::string& options) {
    return run_feltmap("render " + map + " --images depth --json --out " + out + " --trajectory " + scene + " " +
                       options);
  };
  const CommandResult result = render("--frames 1:6:2 --pose 0,0,0,0,0,0,1");
  INFO(result.err);
  REQUIRE(result.exit_code == 0);
  CHECK(nlohmann::json::parse(result.out)["views"].size() == 4);
  const cv::Mat recorded = cv::imread(scene + "/depth/000001.png", cv::IMREAD_UNCHANGED),
                depth = cv::imread(out + "/000000.depth.png", cv::IMREAD_UNCHANGED);
  REQUIRE_FALSE(recorded.empty());
  CHECK(depth.size() == recorded.size());
  CHECK(depth.at<uint16_t>(depth.rows / 2, depth.cols / 2) == 1000);
  const CommandResult sized = render("--size 32x24");
  CHECK(sized.exit_code == 2);
  CHECK_THAT(sized.err, Contains("--size"));
  const CommandResult idle = run_feltmap("render " + map + " --pose 0,0,0,0,0,0,1 --frames 0:1 --out " + out);
  CHECK(idle.exit_code == 2);
  CHECK_THAT(idle.err, Contains("--frames: expected --trajectory SEQUENCE"));
}

TEST_CASE("images are listed with commas or blanks, before or after the map") {
  const TemporaryDirectory folder;
  const std::string map = wall_map(folder).string(), out = (folder.path() / "views").string();
  const std::string view = " --pose 0,0,0,0,0,0,1 --intrinsics 60,60,15.5,11.5 --size 32x24 --json --out " + out;
  const nlohmann::json names = {"000000.depth.png", "000000.normal.png"};
  for (const std::string& words : {map + " --images depth,normal", map + " --images depth normal",
                                   "--images depth normal " + map, "--images depth,normal " + map}) {
    const CommandResult result = run_feltmap("render " + words + view);
    INFO(words << ": " << result.err);
    REQUIRE(result.exit_code == 0);
    CHECK(nlohmann::json::parse(result.out)["views"][0] == names);
  }
  const CommandResult unknown = run_feltmap("render " + map + " --images depth heat" + view);
  CHECK(unknown.exit_code == 3);
  CHECK_THAT(unknown.err, Contains("found 'heat'"));
  CHECK(run_feltmap("render " + map + " depth" + view).exit_code == 2);
}

TEST_CASE("a file that is not there, or is a folder, ends with exit code 4 and one line that names it") {
  const TemporaryDirectory folder;
  const std::string map = wall_map(folder).string(), absent = (folder.path() / "absent").string();
  const std::string scene = (source_dir() / "data" / "scenes" / "table_wall").string(), dir = folder.path().string();
  for (const auto& [arguments, named] : std::vector<std::pair<std::string, std::string>>{
           {"evaluate " + absent + ".vdb --reference-mesh x.ply", absent},
           {"evaluate " + map + " --reference-mesh " + absent + ".ply", absent},
           {"evaluate " + map + " --reference-labels " + absent, absent},
           {"evaluate " + map + " --reference-readings " + absent, absent},
           {"evaluate " + map + " --reference-mesh x.ply --trajectory " + absent, absent},
           {"render " + map + " --out x --trajectory " + absent, absent},
           {"reconstruct " + scene + " --out " + absent + ".out --confusion " + absent, absent},
           {"touch " + map + " --sequence " + scene + " --frame 0 --pixel 9,9 --property friction --value 1 --masks " +
                absent,
            absent},
           {"friction " + dir, dir},
           {"query " + map + " --file " + dir, dir},
           {"infer --fit-priors " + dir, dir},
           {"evaluate " + map + " --reference-readings " + dir, dir}}) {
    const CommandResult result = run_feltmap(arguments);
    INFO(arguments << ": " << result.err);
    CHECK(result.exit_code == 4);
    CHECK_THAT(result.err, Contains(named));
    CHECK(std::count(result.err.begin(), result.err.end(), '\n') == 1);
  }
}

TEST_CASE("numbers that cannot be meant are refused without a number of 300 digits") {
  const TemporaryDirectory folder;
  const std::string map = wall_map(folder).string();
  const auto refused = [&](const std::string& arguments, const std::string& reason) {
    const CommandResult result = run_feltmap(arguments);
    CHECK(result.exit_code == 2);
    CHECK_THAT(result.err, Contains(reason));
  };
  refused("evaluate " + map + " --reference-mesh x.ply --threshold 0",
          "--threshold: expected a finite number above 0, found '0'");
  refused("diff " + map + " " + map + " --tol=-1", "--tol: expected a finite number from 0, found '-1'");
  refused("query " + map + " --at 0,0,1 --below nan", "--below: expected a finite number, found 'nan'");
}

TEST_CASE("evaluate measures a known distance and defines every figure") {
  const TemporaryDirectory folder;
  const std::string map = wall_map(folder).string(), reference = (folder.path() / "reference.ply").string();
  TriangleMesh mesh = extract_mesh(load_map(map));
  for (auto& p : mesh.positions) p.z() += 0.01f;
  write_mesh(reference, mesh);
  const CommandResult result =
      run_feltmap("evaluate " + map + " --reference-mesh " + reference + " --samples 5000 --json");
  INFO(result.err);
  REQUIRE(result.exit_code == 0);
  const auto json = nlohmann::json::parse(result.out);
  CHECK(json["accuracy_m"]["mean"].get<double>() == Approx(0.01).epsilon(1e-3));
  CHECK(json["completion_m"]["median"].get<double>() == Approx(0.01).epsilon(1e-3));
  CHECK(json["f_score"] == 1.0);
  for (const char* figure : {"accuracy", "completion", "precision", "recall", "f_score", "normal_consistency"})
    CHECK(json["definitions"]["geometry"].contains(figure));
  std::ofstream(folder.path() / "t.txt") << "0 0 0 0 0 0 1\n";
  const CommandResult culled =
      run_feltmap("evaluate " + map + " --reference-mesh " + reference + " --samples 5000 --json --trajectory " +
                  (folder.path() / "t.txt").string() + " --intrinsics 320,320,159.5,119.5 --size 320x240");
  REQUIRE(culled.exit_code == 0);
  // Of a wall of 0.8 x 0.8 m at 1.01 m the image covers 1.01 x 0.7575 m.
  CHECK(nlohmann::json::parse(culled.out)["reference_seen"].get<double>() == Approx(0.7575 / 0.8).epsilon(0.01));
}

TEST_CASE("evaluate counts what was seen within the depth that the map was fused with, unless told otherwise") {
  const TemporaryDirectory folder;
  Map map(0.02, 0.08);
  fill_map(map, {-20, -20, 44}, {20, 20, 56}, [](const Eigen::Vector3d& p) { return 1.0 - p.z(); });
  const std::string any_depth = wall_map(folder).string(), near = (folder.path() / "near.vdb").string();
  record_frame(map.frames, "recording", R"({"min_depth_m": 0.1, "max_depth_m": 1.5})", 0);
  save_map(map, near);
  const std::string reference = (folder.path() / "reference.ply").string(),
                    poses = (folder.path() / "poses.txt").string();
  write_mesh(reference, both(square(0, 1, 1), square(1, 1, 2)));
  std::ofstream(poses) << "1 0.5 0 0 0 0 1\n";
  const auto evaluate = [&](const std::string& input, const std::string& options) {
    const CommandResult result =
        run_feltmap("evaluate " + input + " --reference-mesh " + reference + " --trajectory " + poses +
                    " --intrinsics 100,100,159.5,119.5 --size 320x240 --samples 3000 --json " + options);
    INFO(result.err);
    REQUIRE(result.exit_code == 0);
    return nlohmann::json::parse(result.out);
  };
  CHECK(evaluate(any_depth, "")["reference_seen"] == 1);
  CHECK(evaluate(near, "")["reference_seen"].get<double>() == Approx(0.5).epsilon(0.01));
  CHECK(evaluate(near, "--max-depth 3")["reference_seen"] == 1);
  CHECK(evaluate(near, "--min-depth 1.2 --max-depth 3")["reference_seen"].get<double>() == Approx(0.5).epsilon(0.01));

  const std::string more = (folder.path() / "more.ply").string();
  write_mesh(more, both(square(0, 1, 1), square(20, 1, 1)));
  CHECK(evaluate(more, "")["reconstruction_seen"] == 1);
  CHECK(evaluate(more, "--cull-reconstruction")["reconstruction_seen"].get<double>() == Approx(0.5).epsilon(0.01));
}

TEST_CASE(
    "evaluate measures the labels of a stored scene, its calibration and its forecasts, and defines every figure") {
  const TemporaryDirectory folder;
  const std::string scene = (source_dir() / "data" / "scenes" / "ice_crossing").string();
  const std::string out = (folder.path() / "out").string(), plot = (folder.path() / "r.svg").string();
  // Vision alone: a touch of ice that is taken for snow reaches the snow that it borders on.
  const std::string untouched = (folder.path() / "touches.csv").string();
  std::ofstream(untouched) << "frame,x,y,z,property,value,sigma\n";
  REQUIRE(run_feltmap("reconstruct " + scene + " --out " + out + " --voxel-size 0.04 --quiet --touches " + untouched)
              .exit_code == 0);
  const CommandResult result = run_feltmap("evaluate " + out + "/map.vdb --reference-labels " + scene +
                                           "/truth --class-images --reliability " + plot + " --reference-readings " +
                                           scene + "/touches.csv --properties " + scene + "/properties.yaml --json");
  INFO(result.err);
  REQUIRE(result.exit_code == 0);
  const auto json = nlohmann::json::parse(result.out);
  // The network takes ice for snow, and nearly nothing else is wrong.
  double ice = 1, snow = 0;
  for (const auto& c : json["labels"]["classes"]) {
    if (c["name"] == "ice") ice = c["accuracy"];
    if (c["name"] == "snow") snow = c["accuracy"];
  }
  CHECK(ice < 0.2);
  CHECK(snow > 0.7);
  CHECK(json["labels"]["accuracy"].get<double>() > 0.5);
  CHECK(json["calibration"]["bins"].size() == 15);
  CHECK(json["properties"]["friction"]["readings"] == 3);
  for (const auto& [where, figures] :
       std::map<std::string, std::vector<std::string>>{{"labels", {"accuracy", "mean_iou", "confusion", "ece", "nll"}},
                                                       {"properties", {"mae", "crps", "coverage_90"}}})
    for (const std::string& figure : figures) CHECK(json["definitions"][where].contains(figure));
  std::ifstream svg(plot);
  CHECK_THAT(std::string(std::istreambuf_iterator<char>(svg), {}), Contains("<svg") && Contains("Reliability"));

  const CommandResult images = run_feltmap("render " + out + "/map.vdb --properties " + scene +
                                           "/properties.yaml --pose 0,0,1,-0.5,0.5,-0.5,0.5 --images "
                                           "class,entropy,friction.mean,friction.sd --colored --json --out " +
                                           (folder.path() / "views").string());
  INFO(images.err);
  REQUIRE(images.exit_code == 0);
  const auto views = nlohmann::json::parse(images.out);
  CHECK(views["levels"]["friction.mean"].contains("65535"));
  for (const auto& name : views["views"][0])
    CHECK_FALSE(cv::imread((folder.path() / "views" / name.get<std::string>()).string()).empty());
  CHECK(views["views"][0].size() == 8);
}

TEST_CASE(
    "evaluate reads forecasts where a touch finds its contact, also where the weight of frames depends on depth") {
  const TemporaryDirectory folder;
  const std::string room = (source_dir() / "data" / "scenes" / "room").string();
  const std::string out = (folder.path() / "out").string(), untouched = (folder.path() / "touches.csv").string();
  std::ofstream(untouched) << "frame,x,y,z,property,value,sigma\n";
  // A frame so far away weighs less than the 1 that is asked of a voxel elsewhere.
  REQUIRE(run_feltmap("reconstruct " + room + " --out " + out + " --weight inverse-square --frames 14:15 --quiet" +
                      " --touches " + untouched)
              .exit_code == 0);
  const CommandResult result = run_feltmap("evaluate " + out + "/map.vdb --reference-readings " + room +
                                           "/touches.csv --properties " + room + "/properties.yaml --json");
  INFO(result.err);
  REQUIRE(result.exit_code == 0);
  const auto properties = nlohmann::json::parse(result.out)["properties"];
  CHECK(properties["friction"]["readings"] == 3);
  CHECK(properties["refused"]["not on a labelled surface"] == 1);  // the one that this frame does not see
  const std::string said = run_feltmap("evaluate " + out + "/map.vdb --reference-readings " + room +
                                       "/touches.csv --properties " + room + "/properties.yaml")
                               .out;
  CHECK_THAT(said, Matches("friction +mean error [0-9.]+ +NLL [-0-9.]+ +CRPS [0-9.]+ +of 3 readings\n"
                           "coverage +of 50 % intervals [0-9.]+ % +of 90 % intervals [0-9.]+ %\n"
                           "not counted +1: not on a labelled surface\n"));
}

TEST_CASE("render says where nothing of what it was asked for is coloured") {
  const TemporaryDirectory folder;
  const CommandResult result = run_feltmap("render " + wall_map(folder).string() +
                                           " --pose 0,0,0,0,0,0,1 --intrinsics 60,60,15.5,11.5 --size 32x24 " +
                                           "--colored --out " + (folder.path() / "views").string());
  CHECK(result.exit_code == 0);
  CHECK_THAT(result.err, Contains("--colored: nothing to colour"));
}

TEST_CASE("evaluate without a reference, and with one that is no mesh, says so") {
  const TemporaryDirectory folder;
  const std::string map = wall_map(folder).string();
  CHECK(run_feltmap("evaluate " + map).exit_code == 2);
  CHECK(run_feltmap("export " + map).exit_code == 2);
  const CommandResult unlabelled = run_feltmap("evaluate " + map + " --reference-labels " +
                                               (source_dir() / "data" / "scenes" / "table_wall" / "truth").string());
  CHECK(unlabelled.exit_code == 3);
  CHECK_THAT(unlabelled.err, Contains("a map with classes"));
  std::ofstream(folder.path() / "bad.ply") << "solid\n";
  const CommandResult bad =
      run_feltmap("evaluate " + map + " --reference-mesh " + (folder.path() / "bad.ply").string());
  CHECK(bad.exit_code == 4);
  CHECK_THAT(bad.err, Contains("bad.ply") && Contains("expected ply"));
  const std::string poses = (folder.path() / "poses.txt").string();
  std::ofstream(poses) << "0 0 0 0 0 0 1\n";
  for (const char* half : {"--intrinsics 60,60,15.5,11.5", "--size 32x24"}) {
    INFO(half);
    const CommandResult unsized =
        run_feltmap("evaluate " + map + " --reference-mesh x.ply --trajectory " + poses + " " + half);
    CHECK(unsized.exit_code == 2);
    CHECK_THAT(unsized.err, Contains("expected --intrinsics and --size"));
  }
}

TEST_CASE("pictures of a map with one class are of one colour, and pixels without surface are white") {
  const TemporaryDirectory folder;
  Map map = labelled_map(
      0.02, {-0.4, -0.4, 0.9}, {0.4, 0.4, 1.1}, [](const Eigen::Vector3d& p) { return 1.0 - p.z(); },
      class_table({"wall"}), [](const Eigen::Vector3d&) { return 0; });
  const std::string path = (folder.path() / "map.vdb").string(), out = (folder.path() / "views").string();
  save_map(map, path);
  const CommandResult result = run_feltmap("render " + path + " --pose 0,0,0,0,0,0,1 --intrinsics 20,20,15.5,11.5 " +
                                           "--size 32x24 --images entropy,class --colored --out " + out);
  INFO(result.err);
  REQUIRE(result.exit_code == 0);
  const cv::Mat picture = cv::imread(out + "/000000.entropy.color.png");
  CHECK(picture.at<cv::Vec3b>(12, 16) == cv::Vec3b(84, 1, 68));
  CHECK(picture.at<cv::Vec3b>(0, 0) == cv::Vec3b(255, 255, 255));
}

TEST_CASE("depth beyond what 16 bits of millimetres hold is counted") {
  const TemporaryDirectory folder;
  const std::string map = wall_map(folder).string(), out = (folder.path() / "views").string();
  const CommandResult result =
      run_feltmap("render " + map + " --pose 0,0,-70,0,0,0,1 --intrinsics 2000,2000,15.5,11.5 " +
                  "--size 32x24 --images depth --max-depth 100 --json --out " + out);
  INFO(result.err);
  REQUIRE(result.exit_code == 0);
  CHECK(nlohmann::json::parse(result.out)["depth_pixels_too_far"] > 100);
  CHECK(nlohmann::json::parse(result.out)["out"] == out);
  CHECK_THAT(result.err, !Contains("--colored"));
  CHECK_THAT(result.err, Contains("beyond 65.535 m"));
}

TEST_CASE("what a picture would replace must be a picture, and exports keep apart") {
  const TemporaryDirectory folder;
  const std::string map = wall_map(folder).string(), before = file_text(map);
  CHECK(run_feltmap("render " + map + " --overview " + map).exit_code == 3);
  CHECK(run_feltmap("export " + map + " --vdb " + map + " --half --force").exit_code == 3);
  const std::string mesh = (folder.path() / "a.ply").string(), same = (folder.path() / "." / "a.ply").string();
  const CommandResult result = run_feltmap("export " + map + " --mesh " + mesh + " --points " + same);
  CHECK(result.exit_code == 3);
  CHECK_THAT(result.err, Contains("another one than --mesh"));
  const std::string other = (folder.path() / "other.vdb").string(),
                    log = (source_dir() / "data" / "friction_log.csv").string();
  CHECK(run_feltmap("export " + map + " --vdb " + other + " --html " + map + " --force").exit_code == 3);
  CHECK(run_feltmap("friction " + log + " --plot " + map).exit_code == 3);
  CHECK(run_feltmap("friction " + log + " --at 0,0,0 --touch " + map).exit_code == 3);
  CHECK(run_feltmap("infer --plot " + map).exit_code == 3);
  CHECK(file_text(map) == before);
  CHECK_FALSE(std::filesystem::exists(mesh));
}

TEST_CASE("evaluate looks at the frames that were asked for and says which options have nothing to do") {
  const TemporaryDirectory folder;
  const std::string scene = (source_dir() / "data" / "scenes" / "table_wall").string(), map = wall_map(folder).string(),
                    mesh = (folder.path() / "m.ply").string();
  REQUIRE(run_feltmap("reconstruct " + scene + " --out " + (folder.path() / "r").string() + " --quiet").exit_code == 0);
  const std::string result = (folder.path() / "r" / "map.vdb").string(),
                    reference = (folder.path() / "r" / "mesh.ply").string();
  const auto seen = [&](const std::string& frames) {
    const CommandResult answer = run_feltmap("evaluate " + result + " --reference-mesh " + reference +
                                             " --trajectory " + scene + " --samples 5000 --json " + frames);
    INFO(answer.err);
    REQUIRE(answer.exit_code == 0);
    return nlohmann::json::parse(answer.out)["reference_seen"].get<double>();
  };
  const double all = seen("");
  CHECK(all > 0.5);
  CHECK(seen("--frames 0:1") < all);
  const std::string poses = (folder.path() / "poses.txt").string();
  std::ofstream(poses) << "0 0 0 0 0 0 1\n";
  for (const std::string& idle :
       {std::string("--frames 0:1"), std::string("--format tum"), std::string("--properties x.yaml"),
        "--trajectory " + poses, std::string("--labels x"), std::string("--classes x"), std::string("--size 10x10")}) {
    INFO(idle);
    const CommandResult refused = run_feltmap("evaluate " + map + " --reference-mesh " + reference + " " + idle);
    CHECK(refused.exit_code == 2);
    CHECK_THAT(refused.err, Contains(idle.substr(0, 6)));
  }
  const std::string picture = (folder.path() / "o.png").string();
  for (const char* idle : {"--images class", "--max-depth 3", "--size 10x10", "--colored"}) {
    INFO(idle);
    const CommandResult refused = run_feltmap("render " + map + " --overview " + picture + " " + idle);
    CHECK(refused.exit_code == 2);
    CHECK_THAT(refused.err, Contains(std::string(idle).substr(0, 6)));
  }
  CHECK_FALSE(std::filesystem::exists(picture));
}

}  // namespace felt::test
