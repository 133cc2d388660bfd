// The layout of SceneNet RGB-D, written field by field.
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>

#include "core/error.h"
#include "io/images/image_encode.h"
#include "io/sequence/open_sequence.h"
#include "tests/support/data.h"
#include "tests/support/recorded_sequence.h"

using namespace felt;
using namespace felt::test;
namespace fs = std::filesystem;

namespace {

/// Key of a field: its number and how its content is stored (0 number, 2 bytes, 5 float). Lengths stay below 128.
std::string message_field(int number, const std::string& bytes) {
  std::string size;
  for (size_t left = bytes.size(); size.empty() || left > 0; left >>= 7)
    size += char((left & 127) | (left > 127 ? 128 : 0));
  return char(number << 3 | 2) + size + bytes;
}
std::string float_field(int number, float value) {
  std::string bytes(4, '\0');
  std::memcpy(bytes.data(), &value, 4);
  return char(number << 3 | 5) + bytes;
}
std::string point(const Eigen::Vector3f& p) {
  return float_field(1, p.x()) + float_field(2, p.y()) + float_field(3, p.z());
}
std::string shutter(const Eigen::Vector3f& camera, const Eigen::Vector3f& target) {
  return message_field(1, point(camera)) + message_field(2, point(target)) + float_field(3, 0.5f);
}

/// Frames 0 and 25: the camera looks along +x from (0, 1, 0) and, 2 cm on while the shutter is open, from (1, 1, 0).
std::string trajectories(const std::string& render_path) {
  std::string views;
  for (int i = 0; i < 2; ++i) {
    const Eigen::Vector3f open(float(i), 1, 0), close(float(i) + 0.02f, 1, 0), along(3, 0, 0);
    views +=
        message_field(3, std::string({char(1 << 3), char(25 * i)}) + message_field(2, shutter(open, open + along)) +
                             message_field(3, shutter(close, close + along)));
  }
  const std::string other = message_field(4, "0/1"), ours = message_field(1, message_field(2, "MODEL")) + views;
  return message_field(1, other) + message_field(1, ours + message_field(4, render_path));
}

void write_images(const fs::path& folder) {
  for (const char* name : {"25", "0"}) {
    for (const char* kind : {"photo", "depth", "instance"}) fs::create_directories(folder / kind);
    write_bytes(folder / "photo" / (std::string(name) + ".jpg"),
                encode_jpeg(ColorImage(320, 240, {90, 60, 30, 255}), 95));
    write_bytes(folder / "depth" / (std::string(name) + ".png"), encode_png(Image<uint16_t>(320, 240, 2000)));
    write_bytes(folder / "instance" / (std::string(name) + ".png"), encode_png(Image<uint16_t>(320, 240, 3)));
  }
}

}  // namespace

TEST_CASE("SceneNet RGB-D gives poses of the middle of the exposure and depth along the axis") {
  TemporaryDirectory folder;
  const fs::path sequence = folder.path() / "train" / "0" / "223";
  write_images(sequence);
  write_text(folder.path() / "train_protobufs" / "scenenet_rgbd_train_0.pb", trajectories("0/223"));
  const auto reader = open_sequence(sequence);
  CHECK(reader->info().layout == "scenenet");
  REQUIRE(reader->size() == 2);
  CHECK(reader->info().camera.fx == Approx(277.1281));
  CHECK(reader->info().camera.fy == Approx(289.7056));
  const auto frame = std::get<Frame>(reader->read(1));
  CHECK(frame.index == 25);
  CHECK(frame.T_world_camera.translation().isApprox(Eigen::Vector3d(1.01, 1, 0), 1e-6));
  // Along +x with y up: right is +z, down is -y.
  CHECK(frame.T_world_camera.linear().col(0).isApprox(Eigen::Vector3d::UnitZ(), 1e-6));
  CHECK(frame.T_world_camera.linear().col(1).isApprox(-Eigen::Vector3d::UnitY(), 1e-6));
  CHECK(frame.T_world_camera.linear().col(2).isApprox(Eigen::Vector3d::UnitX(), 1e-6));
  // 2 m along every ray: z at the corner is 2 / |ray|.
  CHECK(frame.depth_m(0, 0) == Approx(2 / frame.camera.ray(0, 0).norm()));
  CHECK(frame.depth_m(160, 120) == Approx(2).epsilon(1e-4));
  CHECK(frame.instances(7, 7) == 3);
  CHECK(frame.color(9, 9).r > 80);
}

TEST_CASE("SceneNet RGB-D without its trajectory says which file it looks for") {
  TemporaryDirectory folder;
  const fs::path sequence = folder.path() / "val" / "0" / "7";
  write_images(sequence);
  CHECK_THROWS_WITH(open_sequence(sequence), Catch::Contains("*.pb") && Catch::Contains("render_path"));
  const fs::path protobuf = folder.path() / "val" / "scenenet_rgbd_val.pb";
  write_text(protobuf, trajectories("0/17"));
  CHECK_THROWS_AS(open_sequence(sequence), FormatError);
  const std::string whole = trajectories("0/7");
  write_text(protobuf, whole);
  CHECK(open_sequence(sequence)->size() == 2);
  for (const size_t size : {whole.size() - 1, whole.size() / 2, size_t(1)}) {
    write_text(protobuf, whole.substr(0, size));
    CHECK_THROWS_AS(open_sequence(sequence), FormatError);
  }
}
