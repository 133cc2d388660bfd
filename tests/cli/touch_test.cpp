#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>

#include "io/files/atomic_file.h"
#include "io/map_file/map_file.h"
#include "io/tables/property_yaml.h"
#include "mapping/touch/touch_update.h"
#include "tests/cli/command.h"
#include "tests/support/data.h"
#include "tests/support/labelled_map.h"

namespace felt::test {
namespace {

using nlohmann::json;

/// A floor of what vision takes for snow, `counts` times, beside one of wood (x > 0), saved.
std::string save_floor(const TemporaryDirectory& folder, float counts = 20) {
  Map map = labelled_map(
      0.02, {-0.4, -0.4, -0.1}, {0.4, 0.4, 0.1}, [](const Eigen::Vector3d& p) { return p.z(); },
      class_table({"wood", "snow", "ice"}), [](const Eigen::Vector3d& p) { return p.x() < 0 ? 1 : 0; }, counts);
  map.properties = read_properties(felt::test::source_dir().string() + "/data/properties.yaml");
  const std::string path = (folder.path() / "map.vdb").string();
  save_map(map, path);
  return path;
}

json ask(const std::string& arguments) {
  const CommandResult result = run_feltmap(arguments + " --json");
  INFO(arguments << "\n" << result.err);
  REQUIRE(result.exit_code == 0);
  return json::parse(result.out);
}

}  // namespace

TEST_CASE("one touch makes a slippery floor known, and undoing it gives the file's content back") {
  const TemporaryDirectory folder;
  const std::string map = save_floor(folder);
  const std::string untouched = map_hash(load_map(map));
  const json dry = ask("touch " + map + " --at=-0.2,0,0.01 --property friction --value 0.139 --dry-run");
  CHECK(dry["after"]["class"] == "ice");
  CHECK(map_hash(load_map(map)) == untouched);

  const json touched = ask("touch " + map + " --at=-0.2,0,0.01 --property friction --value 0.139");
  CHECK(touched["before"]["class"] == "snow");
  CHECK(touched["after"]["properties"]["friction"]["gait"]["decision"] == "static");
  CHECK(touched["relabelled_voxels"] == touched["region"]["voxels"]);
  CHECK(touched["map_hash"] == map_hash(load_map(map)));

  const json points = ask("query " + map + " --at=-0.1,0.1,0 --at=0.1,0,0 --at=0,0,3 --below 0.25")["points"];
  CHECK(points[0]["class"] == "ice");
  CHECK(points[0]["properties"]["friction"]["below"]["probability"].get<double>() > 0.8);
  CHECK(points[1]["class"] == "wood");
  CHECK(points[1]["properties"]["friction"]["touches"] == 0);
  CHECK(points[2]["reason"] == "never observed");

  const std::string id = touched["id"];
  const json journal = ask("touch " + map + " --list")["touches"];
  REQUIRE(journal.size() == 1);
  CHECK(journal[0]["id"] == id);
  CHECK(journal[0]["voxels"] == touched["region"]["voxels"]);
  CHECK(journal[0]["before"]["mean"].get<double>() > 0.3);
  CHECK(journal[0]["after"]["mean"].get<double>() < 0.25);
  CHECK_THAT(run_feltmap("touch " + map + " --list").out, Catch::Contains(id) && Catch::Contains("snow"));
  ask("touch " + map + " --undo " + id);
  CHECK(map_hash(load_map(map)) == untouched);
  CHECK(ask("query " + map + " --at=-0.1,0.1,0")["points"][0]["class"] == "snow");
  ask("touch " + map + " --redo " + id);
  CHECK(touched["map_hash"] == map_hash(load_map(map)));
}

TEST_CASE("a surface whose observations weigh less than 1 can be touched where weights fall with depth") {
  const TemporaryDirectory folder;
  const std::string file = save_floor(folder);
  const std::string touch = "touch " + file + " --at=-0.2,0,0 --property friction --value 0.139 --dry-run";
  for (const char* weight : {"constant", "inverse-square", "sensor-noise"}) {
    Map map = load_map(file);
    for (Block& block : map.store.blocks())
      for (float& w : block.geometry->weight) w = std::min(w, 0.05f);
    map.frames = {};
    record_frame(map.frames, "recording", json{{"weight", weight}}.dump(), 0);
    save_map(map, file);
    INFO(weight);
    CHECK(run_feltmap(touch).exit_code == (std::string(weight) == "constant" ? 4 : 0));
  }
}

TEST_CASE("a query answers between voxel centres, and its figures of a forecast agree with each other") {
  const TemporaryDirectory folder;
  const std::string query = "query " + save_floor(folder) + " --at=0.013,0.007,0.031";
  const json point = ask(query)["points"][0];
  CHECK(point["signed_distance_m"].get<double>() == Approx(0.031).epsilon(1e-5));
  const json friction = point["properties"]["friction"];
  const auto quantile = [&](const char* level) { return friction["quantiles"][level].get<double>(); };
  CHECK(friction["cvar"]["lower_0.05"].get<double>() < quantile("0.05"));
  CHECK(quantile("0.05") < quantile("0.25"));
  CHECK(quantile("0.25") < quantile("0.5"));
  CHECK(quantile("0.05") < friction["mean"].get<double>());
  CHECK(friction["mean"].get<double>() < quantile("0.95"));
  CHECK(quantile("0.95") < friction["cvar"]["upper_0.95"].get<double>());
  for (const double level : {0.05, 0.95}) {
    const std::string value = friction["quantiles"][json(level).dump()].dump();
    const json below = ask(query + " --below=" + value)["points"][0]["properties"]["friction"]["below"];
    CHECK(below["probability"].get<double>() == Approx(level).epsilon(1e-6));
  }
}

TEST_CASE("beside what was not observed a query still interpolates along an edge, or says that it does not") {
  const TemporaryDirectory folder;
  const std::string file = (folder.path() / "edge.vdb").string();
  Map map(0.1, 0.4);
  Block& block = map.store[map.store.find_or_create({0, 0, 0})];
  for (const auto& [voxel, tsdf] : {std::pair(Index3{2, 2, 2}, 0.06f), {Index3{2, 3, 2}, -0.04f}}) {
    block.geometry->weight[offset_in_block(voxel)] = 1;
    block.geometry->tsdf[offset_in_block(voxel)] = tsdf;
  }
  save_map(map, file);
  const auto at = [&](const std::string& point) { return ask("query " + file + " --at " + point)["points"][0]; };
  CHECK(at("0.2,0.26,0.2")["signed_distance_m"].get<double>() == Approx(0).margin(1e-7));
  CHECK(at("0.200001,0.26,0.2")["signed_distance_m"].get<double>() == Approx(0).margin(1e-6));
  CHECK(at("0.2,0.26,0.2")["interpolated"] == true);
  CHECK(at("0.21,0.24,0.2")["interpolated"] == false);
  CHECK(at("0.21,0.24,0.2")["signed_distance_m"].get<double>() == Approx(0.06).epsilon(1e-6));
  CHECK_THAT(run_feltmap("query " + file + " --at 0.21,0.24,0.2").out, Catch::Contains("of the nearest voxel"));
}

TEST_CASE("the error of a forecast is that of the mean that a query gives there") {
  const TemporaryDirectory folder;
  const std::string map = save_floor(folder), csv = (folder.path() / "held_out.csv").string();
  write_file_atomically(csv, "stamp,x,y,z,property,value\n1,-0.2,0,0,friction,0.3\n");
  const json scores = ask("evaluate " + map + " --reference-readings " + csv)["properties"]["friction"];
  const json query = ask("query " + map + " --at=-0.2,0,0")["points"][0];
  CHECK(scores["readings"] == 1);
  CHECK(scores["mae"].get<double>() ==
        Approx(std::abs(query["properties"]["friction"]["mean"].get<double>() - 0.3)).epsilon(1e-9));
}

TEST_CASE("recorded touches are applied all or none, into another file if told so") {
  const TemporaryDirectory folder;
  const std::string map = save_floor(folder), before = file_text(map), out = (folder.path() / "out.vdb").string(),
                    csv = (folder.path() / "touches.csv").string();
  write_file_atomically(csv,
                        "stamp,x,y,z,property,value,sigma\n1,-0.2,0,0,friction,0.17,0.01\n2,0.2,0,0,friction,0.36,\n");
  CHECK_FALSE(ask("touch " + map + " --file " + csv + " --out " + out + " --dry-run").contains("out"));
  const json touched = ask("touch " + map + " --file " + csv + " --out " + out);
  CHECK(touched["map"] == map);
  CHECK(touched["out"] == out);
  CHECK(touched["map_hash"] == map_hash(load_map(out)));
  CHECK(touched["touches"].size() == 2);
  CHECK(load_map(out).touches.touches.size() == 2);
  CHECK(file_text(map) == before);
  write_file_atomically(csv, "stamp,x,y,z,property,value\n1,-0.2,0,0,friction,0.17\n2,9,0,0,friction,0.36\n");
  const CommandResult result = run_feltmap("touch " + map + " --file " + csv);
  CHECK(result.exit_code == 4);
  CHECK_THAT(result.err, Catch::Contains("touches.csv:3") && Catch::Contains("outside the map"));
  CHECK(file_text(map) == before);
}

TEST_CASE("a touch reports how surprising its reading is, as far as its noise leaves it so") {
  const TemporaryDirectory folder;
  const std::string file = save_floor(folder), at = "touch " + file + " --at=-0.2,0,0 --property friction --dry-run";
  Map map = load_map(file);
  TouchRequest request;
  request.point_m = {-0.2, 0, 0};
  request.property = "friction";
  request.value = 0.139;
  const TouchEffect effect = apply_touch(map, resolve_touch(map, request));
  // ln sum_c pi(c) p(reading | c): the density of the reading before it was known.
  CHECK(ask(at + " --value 0.139")["surprise"].get<double>() ==
        Approx(log_pdf(effect.before.next_reading[0], 0.139)).epsilon(1e-6));
  CHECK(ask(at + " --value 0.139 --model mixture")["surprise"].is_number());

  const json precise = ask(at + " --value 1.2"), vague = ask(at + " --value 1.2 --sigma 3");
  CHECK(precise["flags"]["surprising"] == true);
  CHECK(vague["flags"]["surprising"] == false);
  CHECK(vague["flags"]["not_one_material"] == false);
  CHECK(vague["tail_probability"].get<double>() > precise["tail_probability"].get<double>());
  CHECK_THAT(run_feltmap(at + " --value 1.2").out, Catch::Contains("no class explains this reading"));
  CHECK_THAT(run_feltmap(at + " --value 1.2 --sigma 3").out,
             !Catch::Contains("no class explains") && !Catch::Contains("more than one material"));
}

TEST_CASE("classes that a property says nothing of are named in one warning") {
  const TemporaryDirectory folder;
  const std::string map = save_floor(folder, 2), properties = (folder.path() / "ice.yaml").string();
  write_file_atomically(properties, "friction:\n  priors:\n    ice: {mean: 0.192, sd: 0.046, readings: 50}\n");
  const std::string said =
      run_feltmap("touch " + map + " --at=-0.2,0,0 --property friction --value 0.2 --dry-run --properties " +
                  properties)
          .out;
  CHECK_THAT(said, Catch::Contains("warning: no prior of friction for wood, snow: the other classes share"));
  CHECK(said.find("no prior") == said.rfind("no prior"));
}

TEST_CASE("what cannot be touched is refused with one line and leaves the file alone") {
  const TemporaryDirectory folder;
  const std::string map = save_floor(folder), before = file_text(map);
  const auto refused = [&](const std::string& arguments, int code, const std::string& reason) {
    const CommandResult result = run_feltmap("touch " + map + " " + arguments);
    INFO(arguments);
    CHECK(result.exit_code == code);
    CHECK_THAT(result.err, Catch::Contains(reason));
    CHECK(file_text(map) == before);
  };
  refused("--at 0,0,0.5 --property friction --value 0.3", 4, "outside the map");
  refused("--at 0.2,0,0.085 --property friction --value 0.3", 4, "free space");
  refused("--at 0.2,0,0 --property stiffness --value 0.3", 4, "stiffness");
  refused("--at 0.2,0,0 --property friction --value=-0.3", 4, "[0, inf]");
  refused("--at 0.2,0,0 --property friction --value nan", 2, "value");
  refused("--at 0.2,0 --property friction --value 0.3", 2, "x,y,z");
  refused("--at 0.2,0,0", 2, "property");
  refused("--undo 0123456789abcdef", 4, "no such id");
  refused("--undo nonsense", 2, "expected 16 hexadecimal digits, found 'nonsense'");
  refused("--redo 12", 2, "expected 16 hexadecimal digits, found '12'");
  refused("--at 0.2,0,0 --property friction --value 0.3 --region sphere", 2, "--radius");
  refused("--at 0.2,0,-0.085 --property friction --value 0.3", 4, "inside of something");
  refused("--at 0.2,0,-0.3 --property friction --value 0.3", 4, "outside the map");
  refused("--at nan,0,0 --property friction --value 0.3", 2, "x,y,z");
  refused("--at 0.2,0,0, --property friction --value 0.3", 2, "x,y,z");
  refused("--at 0.2,0,0 --property friction --value 1e16", 4, "1e15");
  refused("--at 0.2,0,0 --property friction --value 0.3 --sigma 1e160", 4, "sigma");
  refused("--at 0.2,0,0 --property friction --value 0.3 --pixel 1,2", 2, "--frame");
  refused("--at 0.2,0,0 --property friction --value 0.3 --mask m.png", 2, "--region mask");
  refused("--at 0.2,0,0 --property friction --value inf", 2, "value");
  refused("--at 0.2,0,0 --property friction --value 0.3 --sigma=-1", 2, "sigma");
  refused("--at 0.2,0,0 --property friction --value 0.3 --stamp nan", 2, "stamp");
  refused("--at 0.2,0,0 --property friction --value 0.3 --rho 1", 2, "rho");
  refused("--at 0.2,0,0 --property friction --value 0.3 --region instance", 4, "--instances");
  refused("--at 0.2,0,0 --property friction --value 0.3 --model magic", 2, "magic");
  refused("--at 0.2,0,0 --property friction --value 0.3 --region mask", 2, "--intrinsics");

  const std::string pose = " --pose 1,0,0,0,0,-1,0,0,0,0,-1,1,0,0,0,1", mask = (folder.path() / "mask.png").string();
  cv::imwrite(mask, cv::Mat(48, 64, CV_8U, cv::Scalar(255)));
  const std::string by_mask = "--at 0.2,0,0 --property friction --value 0.3 --region mask --mask " + mask + pose;
  refused(by_mask + " --intrinsics 60,60,32,24,640,480", 4, "size of the mask: expected 640 x 480 as its camera");
  refused(by_mask + " --intrinsics 60,60,320,240", 4, "a camera of 64 x 48 images");
  cv::imwrite(mask, cv::Mat(48, 64, CV_8U, cv::Scalar(0)));
  refused(by_mask + " --intrinsics 60,60,32,24,64,48", 4, "pixels that see the map");
}

TEST_CASE("a surface that only ignored classes cover cannot be touched") {
  const TemporaryDirectory folder;
  Map map = labelled_map(
      0.02, {-0.4, -0.4, -0.1}, {0.4, 0.4, 0.1}, [](const Eigen::Vector3d& p) { return p.z(); },
      class_table({"wood", "snow"}), [](const Eigen::Vector3d& p) { return p.x() < 0 ? -1 : 0; }, 5);
  map.properties = read_properties(felt::test::source_dir().string() + "/data/properties.yaml");
  const std::string path = (folder.path() / "map.vdb").string();
  save_map(map, path);
  const std::string before = file_text(path);
  const CommandResult result = run_feltmap("touch " + path + " --at=-0.2,0,0 --property friction --value 0.3");
  CHECK(result.exit_code == 4);
  CHECK_THAT(result.err, Catch::Contains("without labels (an ignored class, or never labelled)"));
  CHECK(file_text(path) == before);
}

TEST_CASE("a touch of a small part speaks for that part, not for the surface around it") {
  const TemporaryDirectory folder;
  const std::string map = save_floor(folder);
  ask("touch " + map + " --at=-0.2,0,0 --property friction --value 0.139 --region sphere --radius 0.05");
  // Whichever of its voxels is asked for, the floor as a whole is what it was.
  for (const char* at : {"-0.2,0,0", "-0.1,0.2,0"}) {
    INFO(at);
    const json region = ask("region " + map + " --at=" + at);
    CHECK(region["belief"]["class"] == "snow");
    CHECK(region["belief"]["properties"]["friction"]["touches"] == 0);
  }
  CHECK(ask("query " + map + " --at=-0.2,0,0")["points"][0]["class"] == "ice");
  // A touch of all of it is of the floor, also where the contact is in that part.
  const json touched = ask("touch " + map + " --at=-0.2,0,0 --property friction --value 0.4");
  CHECK(touched["before"]["class"] == "snow");
  CHECK(ask("region " + map + " --at=-0.1,0.2,0")["belief"]["properties"]["friction"]["touches"] == 1);
}

TEST_CASE("an exported part keeps what touches taught, and a class is what is believed with them") {
  const TemporaryDirectory folder;
  const std::string map = save_floor(folder), part = (folder.path() / "part.vdb").string(),
                    mesh = (folder.path() / "ice.ply").string();
  ask("touch " + map + " --at=-0.2,0,0 --property friction --value 0.139");
  REQUIRE(run_feltmap("export " + map + " --vdb " + part + " --box=-0.3,-0.3,-1,0.3,0.3,1").exit_code == 0);
  const json of_map = ask("query " + map + " --at=-0.1,0.1,0")["points"][0],
             of_part = ask("query " + part + " --at=-0.1,0.1,0")["points"][0];
  CHECK(of_map["class"] == "ice");
  CHECK(of_part["class"] == "ice");
  CHECK(of_part["properties"] == of_map["properties"]);
  CHECK(run_feltmap("verify " + part).exit_code == 0);
  // Undoing works there, too.
  const std::string id = ask("touch " + part + " --list")["touches"][0]["id"];
  ask("touch " + part + " --undo " + id);
  CHECK(ask("query " + part + " --at=-0.1,0.1,0")["points"][0]["class"] == "snow");
  CHECK(run_feltmap("export " + map + " --class ice --mesh " + mesh).exit_code == 0);
  CHECK(run_feltmap("export " + map + " --class snow --mesh " + mesh + " --force").exit_code == 3);
}

TEST_CASE("the region command shows what a touch would update and writes it as a mesh") {
  const TemporaryDirectory folder;
  const std::string map = save_floor(folder), mesh = (folder.path() / "floor.ply").string();
  const json region = ask("region " + map + " --at=-0.2,0,0 --mesh " + mesh);
  CHECK(region["area_m2"].get<double>() == Approx(0.4 * 0.8).epsilon(0.06));
  CHECK(region["class_voxels"].size() == 1);
  CHECK(region["class_voxels"]["snow"] == region["voxels"]);
  CHECK(file_text(mesh).rfind("ply", 0) == 0);
}

TEST_CASE("a touch is suggested where it teaches most") {
  const TemporaryDirectory folder;
  const std::string map = save_floor(folder);
  CHECK_THAT(run_feltmap("suggest " + map + " --property stickiness").err, Catch::Contains("expected one of friction"));
  const json before = ask("suggest " + map + " --property friction")["suggestions"];
  REQUIRE(before.size() == 2);
  CHECK(before[0]["score"].get<double>() >= before[1]["score"].get<double>());
  // A reading that fits what was seen settles it: a second touch there teaches less than the first.
  ask("touch " + map + " --at=-0.2,0,0 --property friction --value 0.39");
  const json after = ask("suggest " + map + " --property friction")["suggestions"];
  const auto score_at_snow = [](const json& suggestions) {
    for (const json& s : suggestions)
      if (s["point_m"][0].get<double>() < 0) return s["score"].get<double>();
    return 0.0;
  };
  CHECK(score_at_snow(after) < score_at_snow(before));
  CHECK(run_feltmap("suggest " + map + " --property stiffness").exit_code == 4);
}

TEST_CASE("the friction command prints a touch line") {
  const TemporaryDirectory folder;
  const std::string log = (folder.path() / "log.csv").string(), plot = (folder.path() / "log.svg").string();
  std::string csv = "t,fx,fy,fz\n";
  for (int i = 0; i < 400; ++i) {
    const double load = i < 50 || i >= 350 ? 0 : 10;
    csv +=
        std::to_string(i * 0.01) + "," + std::to_string(i < 100 ? 0 : 0.3 * load) + ",0," + std::to_string(load) + "\n";
  }
  write_file_atomically(log, csv);
  const json answer = ask("friction " + log + " --plot " + plot + " --at 1,2,3 --cutoff 5");
  CHECK(answer["kinetic"]["mean"].get<double>() == Approx(0.3).epsilon(0.01));
  CHECK_THAT(answer["touch"].get<std::string>(), Catch::Contains("1,2,3,friction,0.3"));
  CHECK_THAT(file_text(plot), Catch::Contains("<svg"));
  const std::string fill_in = "fill in x,y,z, the contact point in the map, or give --at";
  CHECK_THAT(run_feltmap("friction " + log + " --cutoff 5").out, Catch::Contains(fill_in));
  CHECK_THAT(run_feltmap("friction " + log + " --cutoff 5 --at 1,2,3").out, !Catch::Contains(fill_in));
  CHECK_THAT(answer["normal_from"].get<std::string>(), Catch::Contains("assumed"));
  const auto refused = [&](const std::string& text, const std::string& reason) {
    write_file_atomically(log, text);
    const CommandResult result = run_feltmap("friction " + log + " --cutoff 5");
    INFO(reason);
    CHECK(result.exit_code == 4);
    CHECK_THAT(result.err, Catch::Contains(reason));
  };
  std::string hovering = "t,fx,fy,fz\n", sideways = hovering;
  for (int i = 0; i < 100; ++i) {
    hovering += std::to_string(i * 0.01) + ",0.1,0,0.2\n";
    sideways += std::to_string(i * 0.01) + ",5,0,0\n";
  }
  refused("t,fx,fy\n1,2,3\n", "fz");
  refused(hovering, "contact: expected at least 16 samples with a normal force of 1 N");
  refused(sideways, "normal force: expected some");
}

TEST_CASE("a force log pressed on the map becomes a touch of it") {
  const TemporaryDirectory folder;
  const std::string map = save_floor(folder), touches = (folder.path() / "touches.csv").string();
  const json answer = ask("friction " + (source_dir() / "data/friction_log.csv").string() + " --map " + map +
                          " --at=-0.2,0,0 --touch " + touches);
  CHECK(answer["kinetic"]["mean"].get<double>() == Approx(0.139).epsilon(0.03));
  CHECK(answer["static"]["peak"].get<double>() > 0.16);
  CHECK(answer["normal"][2].get<double>() == Approx(1).epsilon(1e-6));
  // Recorded touches are not replaced by the way.
  const std::string again =
      "friction " + (source_dir() / "data/friction_log.csv").string() + " --at=-0.2,0,0 --touch " + touches;
  const CommandResult kept = run_feltmap(again);
  CHECK(kept.exit_code == 4);
  CHECK_THAT(kept.err, Catch::Contains("--force"));
  CHECK(run_feltmap(again + " --force --cutoff 0").exit_code == 2);
  const json touched = ask("touch " + map + " --file " + touches)["touches"][0];
  CHECK(touched["after"]["class"] == "ice");
  CHECK(touched["sigma"] == Approx(answer["kinetic"]["sd"].get<double>()).epsilon(0.01));
}

TEST_CASE("wrong values of a touch's options are faults of the command line") {
  const TemporaryDirectory folder;
  const std::string map = save_floor(folder), before = file_text(map);
  const std::string good = "touch " + map + " --at=-0.2,0,0 --property friction --value 0.139";
  for (const char* wrong :
       {"--sigma=-1", "--sigma nan", "--rho 1", "--snap 100", "--band 0", "--class-ratio 2", "--normal-change 181",
        "--color-change=-1", "--radius 0", "--min-weight 0", "--stamp inf", "--sequence x"}) {
    INFO(wrong);
    const CommandResult result = run_feltmap(good + " " + wrong);
    CHECK(result.exit_code == 2);
    CHECK_THAT(result.err, Catch::Contains(std::string(wrong).substr(0, 5)));
  }
  for (const char* of_a_reading : {"--sigma 1", "--model mixture", "--radius 1", "--properties x.yaml"}) {
    INFO(of_a_reading);
    CHECK(run_feltmap("touch " + map + " --undo 3f0c5d8a91e2b764 " + of_a_reading).exit_code == 2);
    CHECK(run_feltmap("touch " + map + " --list " + of_a_reading).exit_code == 2);
  }
  CHECK(run_feltmap("touch " + map + " --frame 1 --pixel 1,1 --property friction --value 1").exit_code == 2);
  CHECK(run_feltmap(good + " --region sphere").exit_code == 2);
  CHECK(run_feltmap(good + " --region mask").exit_code == 2);
  CHECK(file_text(map) == before);
}

TEST_CASE("touches that the map has already are applied, with a warning that they count twice") {
  const TemporaryDirectory folder;
  const std::string map = save_floor(folder), csv = (folder.path() / "touches.csv").string();
  write_file_atomically(csv, "stamp,x,y,z,property,value\n1,-0.2,0,0,friction,0.17\n2,0.2,0,0,friction,0.36\n");
  CHECK(run_feltmap("touch " + map + " --file " + csv).err.empty());
  const CommandResult again = run_feltmap("touch " + map + " --file " + csv);
  CHECK(again.exit_code == 0);
  CHECK_THAT(again.err, Catch::Contains("2 of 2 touches repeat"));
  CHECK(load_map(map).touches.touches.size() == 4);
  // Numbers of frames say nothing of when a touch was, if the map's touches have stamps.
  write_file_atomically(csv, "frame,x,y,z,property,value\n7,-0.2,0,0,friction,0.17\n");
  CHECK_THAT(run_feltmap("touch " + map + " --dry-run --file " + csv).err,
             Catch::Contains("1 of 1 touches say what one at another time says"));
  // Within a file the first of equal rows repeats nothing; a dry run counts nothing.
  write_file_atomically(csv, "stamp,x,y,z,property,value\n3,-0.2,0,0,friction,0.17\n3,-0.2,0,0,friction,0.17\n");
  CHECK_THAT(run_feltmap("touch " + map + " --dry-run --file " + csv).err,
             Catch::Contains("1 of 2 touches repeat") && Catch::Contains("would count twice"));
}

}  // namespace felt::test
