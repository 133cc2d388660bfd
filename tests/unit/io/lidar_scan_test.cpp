#include "io/sequence/lidar_scan.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <fstream>

#include "core/error.h"
#include "io/images/image_decode.h"
#include "io/sequence/open_sequence.h"
#include "tests/support/data.h"
#include "tests/support/recorded_sequence.h"

using namespace felt;
using namespace felt::test;
namespace fs = std::filesystem;

namespace {

/// What a sensor with 64 rows sees within a room: walls at x = 6, x = -4, y = 3 and y = -5, floor at z = -1.5.
std::vector<Eigen::Vector3f> room_scan() {
  std::vector<Eigen::Vector3f> points;
  for (int row = 0; row < 64; ++row)
    for (int column = 0; column < 2048; ++column) {
      const double elevation = (2 - 26.8 * row / 63) * M_PI / 180, azimuth = (column + 0.5) / 2048 * 2 * M_PI - M_PI;
      const Eigen::Vector3d d(std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth),
                              std::sin(elevation));
      double range = 1e9;
      const auto meet = [&](double along, double wall) {
        if (along * wall > 0) range = std::min(range, wall / along);
      };
      meet(d.x(), 6), meet(d.x(), -4), meet(d.y(), 3), meet(d.y(), -5), meet(d.z(), -1.5);
      points.push_back((range * d).cast<float>());
    }
  return points;
}

std::string as_bytes(const std::vector<Eigen::Vector3f>& points) {
  std::string bytes;
  for (const Eigen::Vector3f& p : points) {
    const float values[4] = {p.x(), p.y(), p.z(), 0.5f};
    bytes.append(reinterpret_cast<const char*>(values), sizeof values);
  }
  return bytes;
}

}  // namespace

TEST_CASE("the faces of a scan of a room show its walls where they are") {
  const std::vector<Eigen::Vector3f> points = room_scan();
  const double walls[kScanFaces] = {6, 3, 4, 5};  // forward, left, backward, right
  const PinholeCamera camera = scan_face_camera();
  for (int face = 0; face < kScanFaces; ++face) {
    const DepthImage depth = depth_of_scan(points, face);
    const Eigen::Isometry3d T = T_scan_face(face);
    CHECK(T.linear().determinant() == Approx(1));
    CHECK(T.linear().col(1).isApprox(-Eigen::Vector3d::UnitZ()));
    int measured = 0;
    double worst = 0;
    for (int v = 0; v < camera.height; ++v)
      for (int u = 0; u < camera.width; ++u) {
        if (depth(u, v) == 0) continue;
        ++measured;
        const Eigen::Vector3d p = T * (double(depth(u, v)) * camera.ray(u, v));
        const double off = std::min({std::abs(p.x() - 6), std::abs(p.x() + 4), std::abs(p.y() - 3), std::abs(p.y() + 5),
                                     std::abs(p.z() + 1.5)});
        worst = std::max(worst, off);
      }
    CHECK(measured > 50000);  // the fan covers about a quarter of a square face
    CHECK(worst < 0.06);      // half a column's width at the far corner, and the edges between walls
    CHECK(depth(256, 256) == Approx(walls[face]).epsilon(0.01));
  }
}

TEST_CASE("a scan that is cut within a point is refused, and points that are not finite are left out") {
  const std::string bytes = as_bytes({{1, 2, 3}, {NAN, 0, 0}, {4, 5, 6}});
  const auto span = [](const std::string& text) {
    return std::span(reinterpret_cast<const uint8_t*>(text.data()), text.size());
  };
  CHECK(decode_scan(span(bytes), "here").size() == 2);
  CHECK_THROWS_AS(decode_scan(span(bytes.substr(0, 40)), "here"), ImageError);
  CHECK_THROWS_AS(decode_scan(span(""), "here"), ImageError);
}

TEST_CASE("scans are a sequence: the first alone at the origin without poses, several with them") {
  TemporaryDirectory folder;
  const std::string bytes = as_bytes(room_scan());
  write_text(folder.path() / "velodyne" / "000000.bin", bytes);
  const auto one = open_sequence(folder.path() / "velodyne" / "000000.bin");
  CHECK(one->info().layout == "lidar");
  CHECK(one->info().voxel_size_m == 0.2);
  REQUIRE(one->size() == 4);
  const auto left = std::get<Frame>(one->read(1));
  CHECK(left.T_world_camera.linear().col(2).isApprox(Eigen::Vector3d::UnitY()));
  CHECK(left.depth_m(256, 256) == Approx(3).epsilon(0.01));

  write_text(folder.path() / "velodyne" / "000001.bin", bytes);
  const auto without_poses = open_sequence(folder.path());
  REQUIRE(without_poses->size() == 8);
  CHECK(std::holds_alternative<Frame>(without_poses->read(0)));
  CHECK(skip_of(*without_poses, 4).reason == "missing pose");
  write_text(folder.path() / "poses.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n0 -1 0 7 1 0 0 0 0 0 1 0\n");
  const auto two = open_sequence(folder.path());
  REQUIRE(two->size() == 8);
  const auto turned = std::get<Frame>(two->read(4));
  CHECK(turned.T_world_camera.linear().col(2).isApprox(Eigen::Vector3d::UnitY()));
  CHECK(turned.T_world_camera.translation().x() == Approx(7));
}

TEST_CASE("recorded scans of a street have depth on every face") {
  FELTMAP_REQUIRE_DATA(folder, "lidar_kitti");
  const auto reader = open_sequence(folder / "tp3d_000000.bin");
  for (int64_t face = 0; face < reader->size(); ++face) {
    const auto frame = std::get<Frame>(reader->read(face));
    CHECK(std::count_if(frame.depth_m.begin(), frame.depth_m.end(), [](float d) { return d > 0; }) > 20000);
  }
}
