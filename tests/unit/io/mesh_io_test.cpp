#include "io/meshes/mesh_io.h"

#include <sys/stat.h>

#include <catch2/catch.hpp>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>

#include "core/error.h"
#include "io/files/text_input.h"
#include "tests/support/data.h"

using namespace felt;
using Catch::Matchers::Contains;

namespace {

TriangleMesh example() {
  TriangleMesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0.5f}, {0, -1.25f, 0}, {1, 1, 3e-7f}};
  mesh.normals = {{0, 0, 1}, {0, 1, 0}, {1, 0, 0}, {0.6f, 0.8f, 0}};
  mesh.colors = {{1, 2, 3, 255}, {4, 5, 6, 255}, {255, 0, 128, 255}, {9, 9, 9, 255}};
  mesh.labels = {0, 1, 65535, 300};
  mesh.scalars = {{"entropy", {0, 0.5f, 1, 2}}, {"friction_mean", {0.1f, 0.2f, 0.3f, 0.4f}}};
  mesh.triangles = {{0, 1, 2}, {2, 1, 3}};
  mesh.triangle_scalars = {{"segment", {7, 8}}};
  return mesh;
}

bool same_scalars(const std::vector<MeshScalars>& a, const std::vector<MeshScalars>& b) {
  if (a.size() != b.size()) return false;
  for (size_t i = 0; i < a.size(); ++i)
    if (a[i].name != b[i].name || a[i].values != b[i].values) return false;
  return true;
}

const char* kAsciiHead =
    "ply\nformat ascii 1.0\ncomment made by hand\nelement vertex 4\nproperty double x\nproperty float y\n"
    "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nelement face 1\n"
    "property list uchar int vertex_index\nproperty uchar semantic\nelement edge 1\nproperty int a\nend_header\n";

}  // namespace

TEST_CASE("a mesh written as PLY is read back with every array as it was") {
  const test::TemporaryDirectory folder;
  const TriangleMesh mesh = example();
  write_ply(folder.path() / "m.ply", mesh, {"voxel_size_m 0.02"});
  const TriangleMesh again = read_mesh(folder.path() / "m.ply");
  CHECK(again.positions == mesh.positions);
  CHECK(again.normals == mesh.normals);
  CHECK(again.colors == mesh.colors);
  CHECK(again.labels == mesh.labels);
  CHECK(again.triangles == mesh.triangles);
  CHECK(same_scalars(again.scalars, mesh.scalars));
  CHECK(same_scalars(again.triangle_scalars, mesh.triangle_scalars));
  CHECK_THAT(read_whole_file(folder.path() / "m.ply"), Contains("comment voxel_size_m 0.02\n"));
}

TEST_CASE("a point cloud is a PLY file without faces") {
  const test::TemporaryDirectory folder;
  TriangleMesh cloud;
  cloud.positions = {{1, 2, 3}, {4, 5, 6}};
  write_mesh(folder.path() / "c.PLY", cloud);
  CHECK_THAT(read_whole_file(folder.path() / "c.PLY"), !Contains("element face"));
  const TriangleMesh again = read_mesh(folder.path() / "c.PLY");
  CHECK(again.positions == cloud.positions);
  CHECK(again.normals.empty());
  CHECK(again.colors.empty());
}

TEST_CASE("ASCII PLY is read, with polygons as fans and their numbers repeated") {
  const std::string text = std::string(kAsciiHead) +
                           "0 0 0 10 20 30\r\n1 0 0 1 2 3\n1 1 0 255 255 255\n0 +1e0 -0.5 0 0 0\n4 0 1 2 3 17\n5\n";
  const TriangleMesh mesh = parse_ply(text, "hand.ply");
  REQUIRE(mesh.positions.size() == 4);
  CHECK(mesh.positions[3] == Eigen::Vector3f(0, 1, -0.5f));
  CHECK(mesh.colors[0] == Rgba8{10, 20, 30, 255});
  REQUIRE(mesh.triangles.size() == 2);
  CHECK(mesh.triangles[1] == Triangle(0, 2, 3));
  CHECK(mesh.triangle_scalars[0].values == std::vector<float>{17, 17});
}

TEST_CASE("big-endian PLY is read") {
  std::string bytes =
      "ply\nformat binary_big_endian 1.0\nelement vertex 1\nproperty float x\nproperty short y\nproperty double z\n"
      "end_header\n";
  bytes += std::string("\x3f\x80\x00\x00", 4) + std::string("\xff\xfe", 2) + std::string("\x40\x08\0\0\0\0\0\0", 8);
  CHECK(parse_ply(bytes, "big.ply").positions[0] == Eigen::Vector3f(1, -2, 3));
}

TEST_CASE("a PLY file cut anywhere is refused, and never crashes") {
  const test::TemporaryDirectory folder;
  write_ply(folder.path() / "m.ply", example());
  const std::string whole = read_whole_file(folder.path() / "m.ply");
  for (size_t size = 0; size < whole.size(); ++size)
    REQUIRE_THROWS_AS(parse_ply(std::string_view(whole).substr(0, size), "cut.ply"), FormatError);
  const std::string ascii = std::string(kAsciiHead) + "0 0 0 1 2 3 1 0 0 1 2 3 1 1 0 2 2 2 0 1 0 0 0 0 4 0 1 2 3 17 5";
  CHECK(parse_ply(ascii, "ascii.ply").triangles.size() == 2);
  for (size_t size = 0; size < ascii.size(); ++size)
    REQUIRE_THROWS_AS(parse_ply(std::string_view(ascii).substr(0, size), "cut.ply"), FormatError);
}

TEST_CASE("PLY files with flipped bytes are read or refused, and never crash") {
  const test::TemporaryDirectory folder;
  write_ply(folder.path() / "m.ply", example());
  const std::string whole = read_whole_file(folder.path() / "m.ply");
  std::mt19937 random(1);
  int refused = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    std::string bytes = whole;
    for (int k = 0; k < 3; ++k) bytes[random() % bytes.size()] = char(random());
    try {
      const TriangleMesh mesh = parse_ply(bytes, "flipped.ply");
      for (const Triangle& t : mesh.triangles) REQUIRE(t.maxCoeff() < mesh.positions.size());
    } catch (const FormatError&) {
      ++refused;
    }
  }
  CHECK(refused > 100);
}

TEST_CASE("PLY messages say where, what was expected and what was found") {
  const auto message = [](std::string text) {
    try {
      parse_ply(text, "x.ply");
    } catch (const FormatError& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  const std::string head =
      "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n";
  const std::string face = "element face 1\nproperty list uchar int vertex_indices\n";
  CHECK_THAT(message("solid\n"), Contains("x.ply") && Contains("expected ply"));
  CHECK_THAT(message(head + "property quad w\nend_header\n"), Contains("a PLY type") && Contains("property quad w"));
  CHECK_THAT(message("ply\nformat ascii 1.0\nelement vertex 18446744073709551615\nproperty float x\nproperty float y\n"
                     "property float z\nend_header\n1 2 3\n"),
             Contains("18446744073709551615 records") && Contains("6 bytes left"));
  CHECK_THAT(message("ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n"),
             Contains("property y"));
  CHECK_THAT(message(head + face + "end_header\n0 0 0 1 1 1\n3 0 1 2\n"),
             Contains("face 0") && Contains("vertex numbers below 2") && Contains("found 2"));
  CHECK_THAT(message(head + "end_header\n0 0 zero 1 1 1\n"), Contains("a number") && Contains("'zero'"));
}

TEST_CASE("OBJ files are read with polygons, negative indices and colours") {
  const TriangleMesh mesh = parse_obj(
      "# comment\nv 0 0 0 1 0 0.5\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\nusemtl m\nf 1/1/1 2/1/1 3//1 4\nf -4 "
      "-2 -1 "
      "# end\n",
      "m.obj");
  REQUIRE(mesh.triangles.size() == 3);
  CHECK(mesh.triangles[1] == Triangle(0, 2, 3));
  CHECK(mesh.triangles[2] == Triangle(0, 2, 3));
  CHECK(mesh.colors[0] == Rgba8{255, 0, 128, 255});
  CHECK(mesh.colors[3].a == 0);
}

TEST_CASE("OBJ messages name the line") {
  CHECK_THROWS_WITH(parse_obj("v 0 0 0\nv 1 0 x\n", "m.obj"), Contains("m.obj:2") && Contains("'x'"));
  CHECK_THROWS_WITH(parse_obj("v 0 0 0\nv 1 0 0\nv 1 1 0\n\nf 1 2 4\n", "m.obj"),
                    Contains("m.obj:5") && Contains("'4'"));
  CHECK_THROWS_WITH(parse_obj("v 0 0 0\nf 1 1\n", "m.obj"), Contains("m.obj:2") && Contains("three vertices"));
  CHECK_THROWS_WITH(parse_obj("v 0 0 0\nf 0 1 1\n", "m.obj"), Contains("'0'"));
  CHECK_THROWS_AS(parse_obj("", "m.obj"), FormatError);
}

TEST_CASE("a mesh written as OBJ is read back to the last bit of its positions") {
  const test::TemporaryDirectory folder;
  const TriangleMesh mesh = example();
  write_mesh(folder.path() / "m.obj", mesh);
  const TriangleMesh again = read_mesh(folder.path() / "m.obj");
  CHECK(again.positions == mesh.positions);
  CHECK(again.colors == mesh.colors);
  CHECK(again.triangles == mesh.triangles);
}

TEST_CASE("a GLB file keeps every number where its letters make two names one") {
  const test::TemporaryDirectory folder;
  TriangleMesh mesh = example();
  mesh.scalars = {{"friction_mean", {1, 2, 3, 4}}, {"Friction_mean", {5, 6, 7, 8}}, {"friction-mean", {9, 9, 9, 9}}};
  write_glb(folder.path() / "m.glb", mesh);
  const std::string bytes = read_whole_file(folder.path() / "m.glb");
  uint32_t json_size;
  std::memcpy(&json_size, bytes.data() + 12, 4);
  const auto document = nlohmann::json::parse(bytes.substr(20, json_size));
  const auto first_of = [&](const char* attribute) {
    const auto& attributes = document["meshes"][0]["primitives"][0]["attributes"];
    const auto& accessor = document["accessors"][attributes.at(attribute).get<size_t>()];
    const auto& view = document["bufferViews"][accessor["bufferView"].get<size_t>()];
    float value;
    std::memcpy(&value, bytes.data() + 28 + json_size + view["byteOffset"].get<size_t>(), 4);
    return value;
  };
  CHECK(first_of("_FRICTION_MEAN") == 1);
  CHECK(first_of("_FRICTION_MEAN_2") == 5);
  CHECK(first_of("_FRICTION_MEAN_3") == 9);
}

TEST_CASE("a GLB file holds the chunks and accessors that its header announces") {
  const test::TemporaryDirectory folder;
  TriangleMesh mesh = example();
  write_mesh(folder.path() / "m.glb", mesh);
  const std::string bytes = read_whole_file(folder.path() / "m.glb");
  const auto u32 = [&](size_t at) {
    uint32_t v;
    std::memcpy(&v, bytes.data() + at, 4);
    return v;
  };
  REQUIRE(bytes.substr(0, 4) == "glTF");
  CHECK(u32(4) == 2);
  CHECK(u32(8) == bytes.size());
  const uint32_t json_size = u32(12);
  CHECK(json_size % 4 == 0);
  const auto document = nlohmann::json::parse(bytes.substr(20, json_size));
  const size_t binary = 20 + json_size + 8;
  CHECK(bytes.substr(20 + json_size + 4, 4) == std::string("BIN\0", 4));
  CHECK(u32(20 + json_size) == document["buffers"][0]["byteLength"]);
  CHECK(binary + u32(20 + json_size) == bytes.size());
  const auto& primitive = document["meshes"][0]["primitives"][0];
  const auto accessor = [&](const nlohmann::json& number) -> const nlohmann::json& {
    return document["accessors"][number.get<size_t>()];
  };
  const auto offset = [&](const nlohmann::json& number) {
    return binary + document["bufferViews"][accessor(number)["bufferView"].get<size_t>()]["byteOffset"].get<size_t>();
  };
  const auto& position = primitive["attributes"]["POSITION"];
  CHECK(accessor(position)["count"] == 4);
  CHECK(accessor(position)["min"] == nlohmann::json({0.0, -1.25, 0.0}));
  Eigen::Vector3f second;
  std::memcpy(second.data(), bytes.data() + offset(position) + 12, 12);
  CHECK(second == mesh.positions[1]);
  CHECK(accessor(primitive["indices"])["count"] == 6);
  CHECK(u32(offset(primitive["indices"]) + 12) == 2);
  // 255 is white in sRGB and linear; 128 is 0.2158605 in linear light (IEC 61966-2-1).
  uint16_t color[4];
  std::memcpy(color, bytes.data() + offset(primitive["attributes"]["COLOR_0"]) + 16, 8);
  CHECK(color[0] == 65535);
  CHECK(color[1] == 0);
  CHECK(color[2] / 65535.0 == Approx(0.2158605).epsilon(1e-4));

  write_glb(folder.path() / "empty.glb", {});
  const std::string empty = read_whole_file(folder.path() / "empty.glb");
  CHECK_FALSE(nlohmann::json::parse(empty.substr(20)).contains("meshes"));
}

TEST_CASE("unknown extensions and unreadable files are refused by name") {
  const test::TemporaryDirectory folder;
  CHECK_THROWS_AS(write_mesh(folder.path() / "m.stl", example()), ConfigError);
  CHECK_THROWS_AS(read_mesh(folder.path() / "m.stl"), FormatError);
  CHECK_THROWS_AS(read_mesh(folder.path() / "absent.ply"), IoError);
  std::filesystem::create_directory(folder.path() / "d.ply");
  CHECK_THROWS_AS(read_mesh(folder.path() / "d.ply"), IoError);
  const std::filesystem::path pipe = folder.path() / "p.ply";
  REQUIRE(mkfifo(pipe.c_str(), 0600) == 0);
  CHECK_THROWS_WITH(read_mesh(pipe), Contains("p.ply") && Contains("found a device or pipe"));
}

TEST_CASE("meshes made elsewhere are read") {
  FELTMAP_REQUIRE_DATA(house, "house_living_rendered");
  FELTMAP_REQUIRE_DATA(meshes, "meshes");
  const TriangleMesh room = read_mesh(house / "gt_mesh.ply");
  CHECK(room.positions.size() == 21229);
  CHECK(room.triangles.size() == 25798);
  REQUIRE(TriangleMesh::find(room.triangle_scalars, "semantic") != nullptr);
  CHECK(TriangleMesh::find(room.triangle_scalars, "instance")->size() == 25798);
  CHECK(read_mesh(meshes / "stanford-bunny.obj").triangles.size() > 60000);
  CHECK(read_mesh(meshes / "spot.obj").triangles.size() > 5000);
}
