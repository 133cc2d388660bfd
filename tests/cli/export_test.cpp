#include <Eigen/Geometry>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "core/utf8.h"
#include "io/map_file/map_file.h"
#include "io/meshes/mesh_io.h"
#include "mapping/touch/touch_update.h"
#include "tests/cli/command.h"
#include "tests/cli/sequences.h"
#include "tests/support/data.h"
#include "tests/support/labelled_map.h"

namespace felt::test {
namespace {
namespace fs = std::filesystem;
using Catch::Matchers::Contains;
using nlohmann::json;

/// Lines of a program that is not ours, by their first word.
std::map<std::string, std::vector<std::string>> lines_of(const std::string& program, const fs::path& file) {
  const TemporaryDirectory directory;
  const fs::path reader = command().parent_path().parent_path() / "tests" / program, out = directory.path() / "out";
  REQUIRE(std::system((quoted(reader) + " " + quoted(file) + " > " + quoted(out)).c_str()) == 0);
  std::map<std::string, std::vector<std::string>> lines;
  std::ifstream in(out);
  for (std::string line; std::getline(in, line);) {
    std::istringstream words(line);
    std::string name;
    words >> name;
    for (std::string word; words >> word;) lines[name].push_back(word);
  }
  return lines;
}

/// A floor, wood on the left of x = 0 and ice on its right, touched on the right.
struct TouchedFloor {
  TemporaryDirectory directory;
  fs::path map = directory.path() / "map.vdb";
  TouchedFloor() {
    Map floor = labelled_map(
        0.02, {-0.4, -0.4, -0.1}, {0.4, 0.4, 0.1}, [](const Eigen::Vector3d& p) { return p.z(); },
        class_table({"wood", "ice"}), [](const Eigen::Vector3d& p) { return p.x() < 0 ? 0 : 1; });
    Property friction;
    friction.name = "friction";
    friction.priors = {{"wood", {0.4, 0.05, 50}}, {"ice", {0.1, 0.03, 50}}};
    floor.properties = PropertyTable({friction});
    TouchRequest request;
    request.point_m = {0.2, 0, 0};
    request.property = "friction";
    request.value = 0.12;
    add_touch(floor, resolve_touch(floor, request));
    save_map(floor, map);
  }
  json exported(const std::string& options) const {
    const CommandResult result = run_feltmap("export --json --force " + quoted(map) + " " + options);
    INFO(options << "\n" << result.err);
    REQUIRE(result.exit_code == 0);
    return json::parse(result.out);
  }
};

std::set<std::tuple<int, int, int>> colors_of(const TriangleMesh& mesh) {
  std::set<std::tuple<int, int, int>> colors;
  for (const Rgba8& c : mesh.colors) colors.insert({c.r, c.g, c.b});
  return colors;
}

}  // namespace

TEST_CASE("an HTML page holds the map's mesh and asks for nothing else") {
  const TouchedFloor floor;
  const fs::path page = floor.directory.path() / "floor.html";
  const json written = floor.exported("--html " + quoted(page) + " --color-by friction.mean --up -y");
  CHECK(written["html"]["path"] == page.string());
  CHECK(written["html"]["bytes"] == fs::file_size(page));
  std::ifstream in(page);
  const std::string text((std::istreambuf_iterator<char>(in)), {});
  CHECK(text.starts_with("<!DOCTYPE html>"));
  for (const char* outside : {"http:", "https:", "src=", "import ", "fetch("}) {
    INFO(outside);
    CHECK(text.find(outside) == std::string::npos);
  }
  const std::string opening = "<script id=\"scene\" type=\"application/json\">";
  const size_t begin = text.find(opening) + opening.size();
  const json scene = json::parse(text.substr(begin, text.find("</script>", begin) - begin));
  CHECK(scene["vertices"] > 1000);
  CHECK(scene["up"] == "-y");
  CHECK(scene["low"][0].get<double>() == Approx(-0.4).margin(0.03));
  CHECK(run_feltmap("export --force " + quoted(floor.map) + " --html " + quoted(page) + " --up sideways").exit_code ==
        2);
}

TEST_CASE("a GLB file is what a reader that is not ours expects, for every kind of colour") {
  const TouchedFloor floor;
  for (const char* color : {"rgb", "class", "entropy", "friction.mean", "friction.sd"}) {
    INFO(color);
    const fs::path file = floor.directory.path() / "floor.glb";
    const json written = floor.exported("--mesh " + quoted(file) + " --color-by " + color);
    auto found = lines_of("stock_glb_reader", file);
    const std::string vertices = written["mesh"]["vertices"].dump();
    REQUIRE(found.at("POSITION").size() == 5);
    CHECK(found["mode"][0] == "4");
    CHECK(found["POSITION"][2] == vertices);
    CHECK(std::stod(found["POSITION"][3]) == Approx(-0.4).margin(0.03));
    CHECK(std::stod(found["POSITION"][4]) == Approx(0.4).margin(0.03));
    CHECK(found.at("NORMAL")[2] == vertices);
    CHECK(std::stoul(found.at("indices")[2]) == 3 * written["mesh"]["triangles"].get<size_t>());
    CHECK(std::stoul(found["indices"][4]) + 1 == written["mesh"]["vertices"].get<size_t>());
    // What is believed comes along whatever the colours show.
    for (const char* attribute : {"_LABEL", "_LABEL_PROB", "_ENTROPY", "_FRICTION_MEAN", "_FRICTION_SD", "_TOUCHED"}) {
      INFO(attribute);
      REQUIRE(found.count(attribute) == 1);
      CHECK(found[attribute][0] == "1");
      CHECK(found[attribute][1] == "5126");
      CHECK(found[attribute][2] == vertices);
    }
    CHECK(found["_TOUCHED"][3] == "0");
    CHECK(found["_TOUCHED"][4] == "1");
    CHECK(std::stod(found["_FRICTION_MEAN"][3]) < 0.2);
    CHECK(std::stod(found["_FRICTION_MEAN"][4]) > 0.28);
    if (std::string(color) == "rgb") continue;  // the floor was never photographed
    CHECK(found.at("COLOR_0")[0] == "4");
    CHECK(found["COLOR_0"][2] == vertices);
  }
  const fs::path cloud = floor.directory.path() / "cloud.glb";
  floor.exported("--points " + quoted(cloud) + " --color-by class");
  CHECK(lines_of("stock_glb_reader", cloud).at("mode")[0] == "0");
}

TEST_CASE("colours of a surface say what is believed, and the scale is stated") {
  const TouchedFloor floor;
  const fs::path file = floor.directory.path() / "floor.ply";
  const json by_mean = floor.exported("--mesh " + quoted(file) + " --color-by friction.mean");
  const TriangleMesh mesh = read_mesh(file);
  const std::vector<float>* mean = TriangleMesh::find(mesh.scalars, "friction_mean");
  REQUIRE(mean != nullptr);
  for (size_t i = 0; i < mesh.positions.size(); ++i) {
    const float x = mesh.positions[i].x();
    // Vision is not sure of its classes: the mean is between the two, nearer to that of the class which it saw.
    if (x < -0.05f) CHECK((*mean)[i] > 0.28f);
    if (x > 0.05f) CHECK((*mean)[i] < 0.2f);
  }
  CHECK(by_mean["colors"]["black"].get<float>() == *std::min_element(mean->begin(), mean->end()));
  CHECK(by_mean["colors"]["yellow"].get<float>() == *std::max_element(mean->begin(), mean->end()));

  floor.exported("--mesh " + quoted(file) + " --color-by class");
  CHECK(colors_of(read_mesh(file)).size() == 2);
  const CommandResult unknown =
      run_feltmap("export --force " + quoted(floor.map) + " --mesh " + quoted(file) + " --color-by stiffness.mean");
  CHECK(unknown.exit_code == 3);
  CHECK_THAT(unknown.err, Contains("friction.mean") && Contains("stiffness.mean"));
}

TEST_CASE("vertices carry the probability of their class and its entropy, whatever the colour shows") {
  const TouchedFloor floor;
  const fs::path file = floor.directory.path() / "floor.ply", points = floor.directory.path() / "points.csv";
  for (const char* color : {"rgb", "class", "entropy", "friction.mean"}) {
    INFO(color);
    floor.exported("--mesh " + quoted(file) + " --color-by " + color);
    const TriangleMesh mesh = read_mesh(file);
    const std::vector<float>*probability = TriangleMesh::find(mesh.scalars, "label_prob"),
          *entropy = TriangleMesh::find(mesh.scalars, "entropy");
    REQUIRE(probability != nullptr);
    REQUIRE(entropy != nullptr);
    CHECK(std::ranges::count(mesh.scalars, "entropy", &MeshScalars::name) == 1);
    std::ofstream asked(points);
    std::vector<size_t> vertices;
    for (size_t i = 0; i < mesh.positions.size(); i += mesh.positions.size() / 20) {
      asked << mesh.positions[i].x() << "," << mesh.positions[i].y() << "," << mesh.positions[i].z() << "\n";
      vertices.push_back(i);
    }
    asked.close();
    const CommandResult answers = run_feltmap("query --json " + quoted(floor.map) + " --file " + quoted(points));
    REQUIRE(answers.exit_code == 0);
    const json believed = json::parse(answers.out).at("points");
    for (size_t n = 0; n < vertices.size(); ++n) {
      const json& b = believed.at(n);
      const size_t i = vertices[n];
      CHECK(mesh.labels[i] == (b.at("class") == "wood" ? 1 : 2));
      CHECK((*probability)[i] == Approx(b.at("class_probability").at(b.at("class").get<std::string>()).get<double>()));
      CHECK((*entropy)[i] == Approx(b.at("class_entropy").get<double>()).margin(1e-6));
    }
  }
}

TEST_CASE("every exported mesh says what is believed of each property and where it was touched") {
  const TouchedFloor floor;
  const auto examine = [](const fs::path& file) {
    INFO(file);
    const TriangleMesh mesh = read_mesh(file);
    REQUIRE_FALSE(mesh.positions.empty());
    const auto *mean = TriangleMesh::find(mesh.scalars, "friction_mean"),
               *sd = TriangleMesh::find(mesh.scalars, "friction_sd"),
               *touched = TriangleMesh::find(mesh.scalars, "touched");
    REQUIRE((mean != nullptr && sd != nullptr && touched != nullptr));
    CHECK(mesh.scalars.size() == 5);
    REQUIRE(mesh.labels.size() == mesh.positions.size());
    for (size_t i = 0; i < mesh.positions.size(); ++i) {
      const float x = mesh.positions[i].x();
      if (std::abs(x) < 0.05f) continue;
      CHECK(mesh.labels[i] == (x < 0 ? 1 : 2));
      CHECK((*touched)[i] == (x < 0 ? 0.0f : 1.0f));
      CHECK(((*mean)[i] > 0.28f) == (x < 0));
      CHECK((*sd)[i] > 0);
    }
  };
  const fs::path whole = floor.directory.path() / "whole.ply", points = floor.directory.path() / "points.ply",
                 region = floor.directory.path() / "region.ply";
  floor.exported("--mesh " + quoted(whole) + " --points " + quoted(points));
  examine(whole);
  examine(points);
  REQUIRE(run_feltmap("region " + quoted(floor.map) + " --at 0.2,0,0 --mesh " + quoted(region)).exit_code == 0);
  examine(region);
}

TEST_CASE("a GLB file holds 0 where nothing is known of a property, and says so") {
  const TemporaryDirectory folder;
  Map floor = labelled_map(
      0.02, {-0.4, -0.4, -0.1}, {0.4, 0.4, 0.1}, [](const Eigen::Vector3d& p) { return p.z(); }, class_table({"wood"}),
      [](const Eigen::Vector3d& p) { return p.x() < 0 ? 0 : -1; });
  Property warmth;
  warmth.name = "surface-warmth";
  warmth.priors = {{"wood", {-3, 0.5, 50}}};
  floor.properties = PropertyTable({warmth});
  const fs::path map = folder.path() / "map.vdb", file = folder.path() / "floor.glb";
  save_map(floor, map);
  REQUIRE(run_feltmap("export " + quoted(map) + " --mesh " + quoted(file)).exit_code == 0);
  auto found = lines_of("stock_glb_reader", file);
  REQUIRE(found.at("_SURFACE_WARMTH_MEAN").size() == 5);
  CHECK(std::stod(found["_SURFACE_WARMTH_MEAN"][3]) == Approx(-3));
  CHECK(found["_SURFACE_WARMTH_MEAN"][4] == "0");
  CHECK(found.at("_SURFACE_WARMTH_MEAN_KNOWN")[3] == "0");
  CHECK(found.at("_SURFACE_WARMTH_MEAN_KNOWN")[4] == "1");
  CHECK(found.count("_TOUCHED_KNOWN") == 0);
}

TEST_CASE("a class, a box and a segment cut the surface and the grids where they end") {
  const TouchedFloor floor;
  const fs::path ply = floor.directory.path() / "part.ply", vdb = floor.directory.path() / "part.vdb";
  const auto extent = [&](const std::string& options) {
    floor.exported(options + " --mesh " + quoted(ply) + " --vdb " + quoted(vdb));
    const TriangleMesh mesh = read_mesh(ply);
    REQUIRE_FALSE(mesh.triangles.empty());
    float least = 1, greatest = -1;
    for (const Eigen::Vector3f& p : mesh.positions)
      least = std::min(least, p.x()), greatest = std::max(greatest, p.x());
    const Map part = load_map(vdb);
    REQUIRE(active_voxel_count(part) > 0);
    CHECK(part.properties.size() == 1);
    return std::pair(least, greatest);
  };
  const auto [wood_least, wood_greatest] = extent("--class wood");
  CHECK(wood_least == Approx(-0.4).margin(0.03));
  CHECK(wood_greatest < 0.02f);
  const auto [box_least, box_greatest] = extent("--box -0.2,-0.2,-0.05,0.1,0.2,0.05");
  CHECK(box_least == Approx(-0.2).margin(0.03));
  CHECK(box_greatest == Approx(0.1).margin(0.03));
  const auto [ice_least, ice_greatest] = extent("--segment-at 0.2,0,0");
  CHECK(ice_least > -0.02f);
  CHECK(ice_greatest == Approx(0.4).margin(0.03));
  const auto [both_least, both_greatest] = extent("--segment-at 0.2,0,0 --box 0.1,-0.2,-0.05,0.2,0.2,0.05");
  CHECK(both_least == Approx(0.1).margin(0.03));
  CHECK(both_greatest == Approx(0.2).margin(0.03));
  fs::remove(ply);
  const CommandResult nothing =
      run_feltmap("export " + quoted(floor.map) + " --mesh " + quoted(ply) + " --box 9,9,9,10,10,10");
  CHECK(nothing.exit_code == 3);
  CHECK_THAT(nothing.err, Contains("at least one voxel"));
  CHECK_FALSE(fs::exists(ply));
  const CommandResult missed =
      run_feltmap("export --force " + quoted(floor.map) + " --mesh " + quoted(ply) + " --segment-at 5,5,5");
  CHECK(missed.exit_code != 0);
  CHECK_THAT(missed.err, Contains("feltmap: error"));
}

TEST_CASE("points of a part are all vertices that belong to it, and a box holds what lies in it") {
  const TouchedFloor floor;
  const fs::path ply = floor.directory.path() / "part.ply", mesh_file = floor.directory.path() / "mesh.ply";
  const auto points_of = [&](const std::string& options) {
    const json written = floor.exported(options + " --points " + quoted(ply));
    const TriangleMesh points = read_mesh(ply);
    CHECK(points.triangles.empty());
    CHECK(points.labels.size() == points.positions.size());
    CHECK(written["points"]["points"] == points.positions.size());
    return points;
  };
  const TriangleMesh whole = points_of("");
  // Across the surface, between centres of voxels.
  const Eigen::AlignedBox3f box(Eigen::Vector3f(-0.133f, -0.117f, -0.011f), Eigen::Vector3f(0.0837f, 0.2093f, 0.013f));
  const std::string in_box = "--box -0.133,-0.117,-0.011,0.0837,0.2093,0.013";
  const TriangleMesh boxed = points_of(in_box);
  CHECK(boxed.positions.size() > 50);
  CHECK(std::ranges::count_if(whole.positions, [&](const Eigen::Vector3f& p) { return box.contains(p); }) ==
        int64_t(boxed.positions.size()));
  for (const Eigen::Vector3f& p : boxed.positions) CHECK(box.contains(p));
  // No vertex belongs to no class here; triangles across the border belong to neither.
  const size_t wood = points_of("--class wood").positions.size(), ice = points_of("--class ice").positions.size();
  CHECK(wood + ice == whole.positions.size());
  CHECK(points_of(in_box + " --class wood").positions.size() + points_of(in_box + " --class ice").positions.size() ==
        boxed.positions.size());
  // Beside a mesh, points stay what they are.
  CHECK(points_of("--class wood --mesh " + quoted(mesh_file)).positions.size() == wood);
  CHECK(read_mesh(mesh_file).positions.size() <= wood);
}

TEST_CASE("a part with voxels and without a surface is written empty, and a warning says so") {
  const TouchedFloor floor;
  const fs::path ply = floor.directory.path() / "part.ply";
  for (const std::string what : {"--mesh ", "--points "}) {
    const CommandResult result = run_feltmap("export --force " + quoted(floor.map) + " " + what + quoted(ply) +
                                             " --box -0.1,-0.1,0.03,0.1,0.1,0.07");
    CHECK(result.exit_code == 0);
    CHECK_THAT(result.err, Contains("part.ply: empty"));
    CHECK(read_mesh(ply).positions.empty());
  }
  CHECK_THAT(run_feltmap("export --force " + quoted(floor.map) + " --mesh " + quoted(ply)).err, !Contains("empty"));
}

TEST_CASE("an option of several numbers ends where they end, and a list of nothing is none") {
  const TouchedFloor floor;
  const fs::path ply = floor.directory.path() / "part.ply", vdb = floor.directory.path() / "part.vdb";
  const auto code = [](const std::string& arguments) { return run_feltmap(arguments).exit_code; };
  CHECK(code("export --mesh " + quoted(ply) + " --box -0.1,-0.1,-0.1,0.1,0.1,0.1 " + quoted(floor.map) + " --quiet") ==
        0);
  CHECK(code("export --vdb " + quoted(vdb) + " --grids tsdf,weight " + quoted(floor.map) + " --quiet") == 0);
  CHECK(code("export --force --mesh " + quoted(ply) + " --box 1,2,3 " + quoted(floor.map)) == 2);
  CHECK(code("export " + quoted(floor.map) + " --vdb " + quoted(vdb) + " --grids , --force") == 2);
}

TEST_CASE("a page of a map whose name is no UTF-8 is UTF-8") {
  const TouchedFloor floor;
  const fs::path map = floor.directory.path() / "\xff.vdb", page = floor.directory.path() / "page.html";
  fs::copy_file(floor.map, map);
  REQUIRE(run_feltmap("export " + quoted(map) + " --html " + quoted(page)).exit_code == 0);
  CHECK(is_utf8(file_text(page)));
}

TEST_CASE("a box that is thinner than a voxel holds the vertices within it") {
  const TouchedFloor floor;
  const fs::path all = floor.directory.path() / "all.ply", thin = floor.directory.path() / "thin.ply";
  floor.exported("--points " + quoted(all));
  // Beside the surface's own height no voxel has its centre.
  const float z = read_mesh(all).positions.front().z();
  const std::string low = std::to_string(z - 1e-4f), high = std::to_string(z + 1e-4f);
  const std::string box = " --box=-0.0099,-0.0099," + low + ",0.0099,0.2099," + high;
  const size_t points = floor.exported("--points " + quoted(thin) + box)["points"]["points"];
  CHECK(points > 0);
  CHECK(read_mesh(thin).positions.size() == points);
}

TEST_CASE("an export that cannot be finished is refused before it writes anything") {
  const TouchedFloor floor;
  const fs::path folder = floor.directory.path(), vdb = folder / "out.vdb", ply = folder / "out.ply";
  const auto refused = [&](const std::string& options, int code) {
    const CommandResult result = run_feltmap("export " + quoted(floor.map) + options);
    INFO(options << "\n" << result.err);
    CHECK(result.exit_code == code);
    CHECK_FALSE(fs::exists(vdb));
    CHECK_FALSE(fs::exists(ply));
  };
  refused(" --vdb " + quoted(vdb) + " --mesh " + quoted(ply) + " --color-by nonsense", 3);
  refused(" --vdb " + quoted(vdb) + " --mesh " + quoted(folder / "out.stl"), 3);
  refused(" --mesh " + quoted(ply) + " --points " + quoted(folder / "out.xyz"), 3);
  refused(" --mesh " + quoted(ply) + " --html " + quoted(folder / "nowhere" / "out.html"), 4);
  refused(" --mesh not_written.ply --points ./not_written.ply", 3);
  CHECK_FALSE(fs::exists("not_written.ply"));
  // Nor does it replace what it reads.
  const fs::path table = folder / "table.yaml";
  std::ofstream(table) << "friction: {priors: {wood: {mean: 0.4, sd: 0.05}}}\n";
  const std::string before = file_text(table);
  refused(" --force --html " + quoted(table) + " --properties " + quoted(table), 3);
  CHECK(file_text(table) == before);
  // Nor does it pass over what would do nothing.
  refused(" --vdb " + quoted(vdb) + " --color-by class", 2);
  refused(" --mesh " + quoted(ply) + " --up -y", 2);
  refused(" --mesh " + quoted(ply) + " --half", 2);
}

TEST_CASE("an export removes what one that was killed had written of the same file") {
  const TouchedFloor floor;
  const fs::path folder = floor.directory.path(), killed = folder / "out.part-7-0.ply",
                 mine = folder / "out.part-7.ply";
  for (const fs::path& file : {killed, mine}) std::ofstream(file) << "half";
  REQUIRE(run_feltmap("export " + quoted(floor.map) + " --mesh " + quoted(folder / "out.ply")).exit_code == 0);
  CHECK_FALSE(fs::exists(killed));
  CHECK(fs::exists(mine));
}

TEST_CASE("values that 16 bits cannot hold keep 32, and a warning says of which grids") {
  TouchedFloor floor;
  Map map = load_map(floor.map);
  Property stiffness, thickness;
  stiffness.name = "stiffness", thickness.name = "thickness";
  stiffness.unit = "N/m", thickness.unit = "m";
  stiffness.priors = {{"wood", {200000, 20000, 50}}, {"ice", {90000, 9000, 50}}};
  thickness.priors = {{"wood", {2e-6, 1e-7, 50}}, {"ice", {1e-6, 1e-7, 50}}};
  std::vector<Property> properties = map.properties.properties();
  properties.push_back(stiffness), properties.push_back(thickness);
  map.properties = PropertyTable(properties);
  save_map(map, floor.map);
  const fs::path whole = floor.directory.path() / "whole.vdb", half = floor.directory.path() / "half.vdb";
  const std::string grids = " --grids stiffness_mean,thickness_mean,friction_mean";
  floor.exported("--vdb " + quoted(whole) + grids);
  const json written = floor.exported("--half --vdb " + quoted(half) + grids);
  CHECK(written["vdb"]["in_32_bits"] == json({"stiffness_mean", "thickness_mean"}));
  auto exact = lines_of("stock_vdb_reader", whole), found = lines_of("stock_vdb_reader", half);
  for (const char* grid : {"stiffness_mean", "thickness_mean"}) CHECK(found.at(grid) == exact.at(grid));
  for (const int limit : {4, 5})
    CHECK(std::stod(found["friction_mean"][limit]) == Approx(std::stod(exact["friction_mean"][limit])).epsilon(1e-3));
  const CommandResult warned =
      run_feltmap("export --force --half " + quoted(floor.map) + " --vdb " + quoted(half) + grids);
  CHECK_THAT(warned.err, Contains("'stiffness_mean'") && Contains("32 bits") && !Contains("friction_mean"));
}

TEST_CASE("a compact VDB holds the chosen grids in 16 bits, for a reader that is not ours") {
  const TouchedFloor floor;
  const fs::path whole = floor.directory.path() / "whole.vdb", compact = floor.directory.path() / "compact.vdb";
  floor.exported("--vdb " + quoted(whole) + " --grids tsdf,evidence/");
  const json written = floor.exported("--vdb " + quoted(compact) + " --grids tsdf,evidence/ --half");
  CHECK(written["vdb"]["grids"] == json({"tsdf", "evidence/wood", "evidence/ice"}));
  CHECK(written["vdb"]["bytes"].get<size_t>() < fs::file_size(whole));
  auto exact = lines_of("stock_vdb_reader", whole), half = lines_of("stock_vdb_reader", compact);
  REQUIRE(half.size() == 3);
  CHECK(half["tsdf"][0] == "float");
  CHECK(half["tsdf"][2] == exact["tsdf"][2]);
  // 11 bits of mantissa: within 2^-11 of 0.08.
  for (const int limit : {4, 5})
    CHECK(std::abs(std::stod(half["tsdf"][limit]) - std::stod(exact["tsdf"][limit])) < 4e-5);

  const json part = floor.exported("--vdb " + quoted(compact) + " --grids tsdf,touched --half --class ice");
  auto ice = lines_of("stock_vdb_reader", compact);
  CHECK(std::stoul(ice["tsdf"][2]) < std::stoul(exact["tsdf"][2]) / 2);
  CHECK(std::stoul(ice["touched"][2]) > 0);
  const CommandResult unknown =
      run_feltmap("export --force " + quoted(floor.map) + " --vdb " + quoted(compact) + " --grids colour");
  CHECK(unknown.exit_code == 3);
  CHECK_THAT(unknown.err, Contains("'colour'") && Contains("evidence/ice"));
}

}  // namespace felt::test
