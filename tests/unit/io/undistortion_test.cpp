#include "io/sequence/undistortion.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "core/error.h"
#include "io/images/image_encode.h"
#include "io/sequence/open_sequence.h"
#include "io/sequence/registration.h"
#include "tests/support/data.h"
#include "tests/support/recorded_sequence.h"

using namespace felt;
using namespace felt::test;

namespace {

const PinholeCamera kCamera{20, 20, 11.5, 7.5, kWidth, kHeight};
const Distortion kLens{-0.2, 0.05, 0.002, -0.003, 0.01};

Frame only_frame(const std::filesystem::path& folder, const SequenceOptions& options = {}) {
  return std::get<Frame>(open_sequence(folder, options)->read(0));
}

}  // namespace

TEST_CASE("a ray falls where OpenCV's formula, worked out by hand, says") {
  const PinholeCamera camera{525, 520, 319.5, 239.5, 640, 480};
  // x = 0.3, y = -0.2: r^2 = 0.13, radial 1 - 0.026 + 0.000845 + 0.00002197, x' = 0.291290091, y' = -0.194193394.
  const Eigen::Vector2d pixel = project_distorted(camera, kLens, 0.3, -0.2);
  CHECK(pixel.x() == Approx(472.4272978).epsilon(1e-9));
  CHECK(pixel.y() == Approx(138.5194351).epsilon(1e-9));
  const Image<int32_t> map = undistortion_map(camera, kLens);
  CHECK(map(477, 136) == 139 * 640 + 472);  // 0.3 525 + 319.5 = 477, -0.2 520 + 239.5 = 135.5
}

TEST_CASE("rays beyond the radius at which the model folds back show nothing") {
  const Distortion strong{-0.5, 0, 0, 0, 0};  // r (1 - 0.5 r^2) is largest at r = sqrt(2 / 3)
  CHECK(std::isfinite(project_distorted(kCamera, strong, 0.8, 0).x()));
  CHECK(std::isnan(project_distorted(kCamera, strong, 0.83, 0).x()));
}

TEST_CASE("depth, colour and labels of a distorting lens are undistorted alike") {
  TemporaryDirectory folder;
  write_generic(folder.path(), 1);
  const Frame plain = only_frame(folder.path()), straight = only_frame(folder.path(), {.distortion = kLens});
  const Image<int32_t> map = undistortion_map(kCamera, kLens);
  int moved = 0;
  for (size_t p = 0; p < map.size(); ++p) {
    const int32_t from = map.data()[p];
    moved += from != int32_t(p);
    CHECK(straight.depth_m.data()[p] == (from < 0 ? 0.0f : plain.depth_m.data()[from]));
    CHECK(straight.color.data()[p] == (from < 0 ? Rgba8{0, 0, 0, 0} : plain.color.data()[from]));
    CHECK(straight.labels.data()[p] == (from < 0 ? kNoLabel : plain.labels.data()[from]));
  }
  CHECK(moved > 50);
  // The same from the sequence's own calibration.
  write_text(folder.path() / "sequence.yaml",
             "camera: {fx: 20, fy: 20, cx: 11.5, cy: 7.5, width: 24, height: 16, "
             "distortion: [-0.2, 0.05, 0.002, -0.003, 0.01]}\ndepth_scale: 2000\n");
  CHECK(only_frame(folder.path()).depth_m == straight.depth_m);
}

TEST_CASE("probabilities of a distorting lens are undistorted as labels are, in each way to store them") {
  TemporaryDirectory folder;
  write_generic(folder.path(), 1);
  const Image<int32_t> map = undistortion_map(kCamera, kLens);
  const auto check = [&](const SequenceOptions& plain_options) {
    SequenceOptions lens_options = plain_options;
    lens_options.distortion = kLens;
    const ProbabilityImage plain = only_frame(folder.path(), plain_options).probabilities,
                           straight = only_frame(folder.path(), lens_options).probabilities;
    REQUIRE(straight.top == plain.top);
    REQUIRE(straight.probability.size() == plain.probability.size());
    size_t moved = 0;
    for (size_t p = 0; p < map.size(); ++p)
      for (size_t m = 0; m < size_t(plain.top); ++m) {
        const int32_t from = map.data()[p];
        const size_t to = p * size_t(plain.top) + m, source = size_t(from < 0 ? 0 : from) * size_t(plain.top) + m;
        if (from < 0) {
          // The rest belongs to class 0 where maps of single classes leave any.
          CHECK((straight.probability[to] == 0 || straight.class_id[to] == 0));
          continue;
        }
        CHECK(straight.probability[to] == plain.probability[source]);
        CHECK(straight.class_id[to] == plain.class_id[source]);
        moved += straight.probability[to] != plain.probability[to];
      }
    CHECK(moved > 20);
  };
  Image<uint16_t> values(kWidth, kHeight), stack(kWidth, 4 * kHeight);
  for (size_t p = 0; p < values.size(); ++p) values.data()[p] = uint16_t(100 * p + 7);
  for (size_t p = 0; p < values.size(); ++p) {
    stack.data()[p] = uint16_t(1 + p % 3);
    stack.data()[values.size() + p] = uint16_t(1 + (p + 1) % 3);
    stack.data()[2 * values.size() + p] = uint16_t(30000 + 50 * p);
    stack.data()[3 * values.size() + p] = uint16_t(10000 - 20 * p);
  }
  std::filesystem::create_directories(folder.path() / "probs");
  write_bytes(folder.path() / "probs" / "0.png", encode_png(stack));
  check({});
  write_bytes(folder.path() / "probs" / "0.png", encode_png(values));  // of the label
  check({});
  std::filesystem::remove_all(folder.path() / "probs");
  for (const char* name : {"frame-000000.wall.png", "frame-000000.sofa.mask.png"}) {
    std::filesystem::create_directories(folder.path() / "maps");
    write_bytes(folder.path() / "maps" / name, encode_png(values));
  }
  check({.probs_dir = folder.path() / "maps"});
}

TEST_CASE("colour of a camera beside the depth camera is taken where depth projects into it") {
  TemporaryDirectory folder;
  write_generic(folder.path(), 1);
  // 5 cm to the right, of the same kind: a point at depth z moves 20 * 0.05 / z = 1 / z pixels to the left.
  write_text(folder.path() / "sequence.yaml",
             "camera: {fx: 20, fy: 20, cx: 11.5, cy: 7.5, width: 24, height: 16}\ndepth_scale: 2000\n"
             "color_camera: {fx: 20, fy: 20, cx: 11.5, cy: 7.5, width: 24, height: 16}\n"
             "T_color_depth: [1, 0, 0, -0.05, 0, 1, 0, 0, 0, 0, 1, 0]\n");
  const Frame frame = only_frame(folder.path());
  for (int u = 2; u < kWidth; ++u)
    CHECK(int(frame.color(u, 3).r) == 10 * int(std::floor(u - 1 / depth_m_at(0, u) + 0.5)));
}

TEST_CASE("poses of a body are brought to its camera") {
  TemporaryDirectory folder;
  write_generic(folder.path(), 1);
  Eigen::Isometry3d T_body_camera = Eigen::Isometry3d::Identity();
  T_body_camera.linear() = Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitX()).toRotationMatrix();
  T_body_camera.translation() << 0.1, 0.2, 0.3;
  const Frame frame = only_frame(folder.path(), {.T_body_camera = T_body_camera});
  CHECK(frame.T_world_camera.isApprox(pose_at(0) * T_body_camera, 1e-9));
  write_text(folder.path() / "sequence.yaml",
             "camera: {fx: 20, fy: 20, cx: 11.5, cy: 7.5, width: 24, height: 16}\ndepth_scale: 2000\n"
             "T_body_camera: [1, 0, 0, 0.1, 0, 0, -1, 0.2, 0, 1, 0, 0.3]\n");
  CHECK(only_frame(folder.path()).T_world_camera.isApprox(pose_at(0) * T_body_camera, 1e-9));
}

TEST_CASE("calibration that is no lens or no transform is refused by name") {
  CHECK(parse_distortion("0.1,-0.2,0,0", "here").k2 == -0.2);
  CHECK_THROWS_WITH(parse_distortion("0.1,x,0,0", "--distortion"), Catch::Contains("--distortion"));
  CHECK_THROWS_AS(parse_distortion("1,2,3", "here"), ConfigError);
  TemporaryDirectory folder;
  write_generic(folder.path(), 1);
  write_text(folder.path() / "sequence.yaml",
             "camera: {fx: 20, fy: 20, cx: 11.5, cy: 7.5, width: 24, height: 16, distortion: [1, 2]}\n"
             "T_body_camera: [2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]\n");
  CHECK_THROWS_WITH(open_sequence(folder.path()),
                    Catch::Contains("distortion") && Catch::Contains("T_body_camera") && Catch::Contains("rigid"));
}

TEST_CASE("what the colour camera sees another surface before takes no colour") {
  // A plate at 1 m before a wall at 3 m; the colour camera stands 20 cm to the right and sees the plate 20 pixels
  // farther left than the depth camera does, the wall 6.7.
  const PinholeCamera camera{100, 100, 49.5, 19.5, 100, 40};
  DepthImage depth_m(100, 40, 3.0f);
  Image<uint16_t> labels(100, 40, 7);
  for (int v = 0; v < 40; ++v)
    for (int u = 0; u < 100; ++u) {
      if (u >= 50 && u < 70) depth_m(u, v) = 1;
      if (u >= 30 && u < 50) labels(u, v) = 9;
    }
  Eigen::Matrix4d T = Eigen::Matrix4d::Identity();
  T(0, 3) = -0.2;
  const Image<uint16_t> registered = registered_to_depth<uint16_t>(labels, camera, depth_m, camera, T, 0);
  for (int u = 7; u < 100; ++u) {
    INFO("column " << u);
    const bool plate = u >= 50 && u < 70;
    const double in_color = plate ? u - 20 : u - 20.0 / 3;
    const bool hidden = !plate && in_color >= 30 && in_color < 49.5;
    // At the plate's edges a cell holds both.
    const bool at_edge = !plate && (std::abs(in_color - 29.5) < 2.5 || std::abs(in_color - 49.5) < 2.5);
    const int found = registered(u, 20);
    if (at_edge)
      CHECK((found == 0 || found == 7));
    else
      CHECK(found == (plate ? 9 : hidden ? 0 : 7));
  }
}

TEST_CASE("a colour camera beside the depth camera by next to nothing sees all that it sees") {
  const PinholeCamera camera{100, 100, 49.5, 19.5, 100, 40};
  DepthImage depth_m(100, 40, 3.0f);
  for (int v = 0; v < 40; ++v)
    for (int u = 50; u < 70; ++u) depth_m(u, v) = 1;
  const Image<uint16_t> labels(100, 40, 7);
  Eigen::Matrix4d T = Eigen::Matrix4d::Identity();
  T(0, 3) = -0.002;
  const Image<uint16_t> registered = registered_to_depth<uint16_t>(labels, camera, depth_m, camera, T, 0);
  for (int u = 1; u < 100; ++u) CHECK(int(registered(u, 20)) == 7);
}
