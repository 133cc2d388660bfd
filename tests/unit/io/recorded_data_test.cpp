#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "io/sequence/open_sequence.h"
#include "tests/support/data.h"

using namespace felt;

namespace {

Frame frame_numbered(const SequenceReader& reader, int64_t number) {
  for (int64_t i = 0; i < reader.size(); ++i) {
    ReadResult result = reader.read(i);
    if (auto* frame = std::get_if<Frame>(&result); frame != nullptr && frame->index == number) return std::move(*frame);
  }
  FAIL("no usable frame " << number);
  return {};
}

/// Median of |z of a's points seen from b - depth of b there|, metres, where the two are within 20 cm; infinity where
/// fewer than a twentieth of a's points meet b's surface.
double median_residual_m(const Frame& a, const Frame& b) {
  const Eigen::Isometry3d T_b_a = b.T_world_camera.inverse() * a.T_world_camera;
  std::vector<double> residuals;
  size_t points = 0;
  for (int v = 0; v < a.depth_m.height(); v += 3)
    for (int u = 0; u < a.depth_m.width(); u += 3) {
      const double z = a.depth_m(u, v);
      if (z <= 0) continue;
      ++points;
      const Eigen::Vector3d p = T_b_a * (z * a.camera.ray(u, v));
      if (p.z() <= 0) continue;
      const Eigen::Vector2d pixel = b.camera.project(p);
      const int x = int(std::floor(pixel.x() + 0.5)), y = int(std::floor(pixel.y() + 0.5));
      if (x < 0 || y < 0 || x >= b.depth_m.width() || y >= b.depth_m.height() || b.depth_m(x, y) <= 0) continue;
      const double residual = std::abs(p.z() - b.depth_m(x, y));
      if (residual < 0.2) residuals.push_back(residual);
    }
  if (residuals.size() * 20 < points || residuals.empty()) return INFINITY;
  std::nth_element(residuals.begin(), residuals.begin() + residuals.size() / 2, residuals.end());
  return residuals[residuals.size() / 2];
}

/// A pair of frames whose residual the data set's description states: right poses, intrinsics, depth scale and stamps
/// reproduce it.
struct Pair {
  const char* data;
  const char* layout;
  int64_t a, b;
  double stated_m;
};

}  // namespace

TEST_CASE("frames of recorded sequences overlap as well as their descriptions state, with no option given") {
  const auto pair = GENERATE(
      Pair{"7scenes_redkitchen_png", "7scenes", 150, 155, 0.0070},
      Pair{"7scenes_redkitchen_png", "7scenes", 150, 170, 0.0118}, Pair{"sun3d_nvblox_5", "7scenes", 0, 1, 0.0098},
      Pair{"labelfusion_shelf", "7scenes", 0, 1, 0.0040}, Pair{"labelfusion_shelf", "7scenes", 5, 6, 0.0031},
      Pair{"house_living_rendered", "replica", 0, 3, 0.0020},
      Pair{"house_living_rendered", "replica", 100, 105, 0.0024}, Pair{"tum_fr1_rpy", "tum", 10, 13, 0.0102},
      Pair{"open3d_redwood_5", "redwood", 0, 1, 0.0050}, Pair{"open3d_redwood_5", "redwood", 0, 4, 0.0055},
      Pair{"icl_livingroom_maskrcnn", "icl", 200, 230, 0.0008},
      Pair{"icl_livingroom_maskrcnn", "icl", 401, 440, 0.0008}, Pair{"apc_shelf_probs", "apc", 0, 1, 0.0037},
      Pair{"apc_shelf_probs", "apc", 5, 6, 0.0034});
  FELTMAP_REQUIRE_DATA(folder, pair.data);
  INFO(pair.data << " " << pair.a << " " << pair.b);
  const auto reader = open_sequence(folder, {.read_color = false});
  CHECK(reader->info().layout == pair.layout);
  const Frame a = frame_numbered(*reader, pair.a), b = frame_numbered(*reader, pair.b);
  const double right_m = median_residual_m(a, b);
  CHECK(right_m < 1.3 * pair.stated_m);

  const auto inverted =
      open_sequence(folder, {.pose_convention = PoseConvention{.world_to_camera = true}, .read_color = false});
  CHECK(median_residual_m(frame_numbered(*inverted, pair.a), frame_numbered(*inverted, pair.b)) > 1.3 * right_m);
}

TEST_CASE("every frame of the red kitchen and of the rendered house can be read, colour and labels included") {
  FELTMAP_REQUIRE_DATA(kitchen, "7scenes_redkitchen");
  FELTMAP_REQUIRE_DATA(house, "house_living_rendered");
  const auto kitchen_reader = open_sequence(kitchen, {.frames = {.step = 9}});
  for (int64_t i = 0; i < kitchen_reader->size(); ++i) {
    const ReadResult result = kitchen_reader->read(i);
    REQUIRE(std::holds_alternative<Frame>(result));
    CHECK(std::get<Frame>(result).color.width() == 640);
  }
  const auto house_reader = open_sequence(house, {.frames = {.step = 20}});
  CHECK(house_reader->info().classes.size() > 10);
  for (int64_t i = 0; i < house_reader->size(); ++i) {
    const ReadResult result = house_reader->read(i);
    REQUIRE(std::holds_alternative<Frame>(result));
    const Frame& frame = std::get<Frame>(result);
    const auto known = [&](uint16_t id) { return house_reader->info().classes.known(id); };
    CHECK(std::all_of(frame.labels.begin(), frame.labels.end(), known));
    CHECK(frame.instances.width() == 640);
  }
}

TEST_CASE("the TUM recording leaves out the depth images that have no colour partner") {
  FELTMAP_REQUIRE_DATA(folder, "tum_fr1_rpy");
  const auto reader = open_sequence(folder);
  int64_t frames = 0, without_color = 0;
  for (int64_t i = 0; i < reader->size(); ++i) {
    const ReadResult result = reader->read(i);
    if (const auto* skip = std::get_if<SkippedFrame>(&result))
      without_color += skip->reason == "missing colour image";
    else
      ++frames;
  }
  CHECK(reader->size() == 50);
  CHECK(frames == 44);
  CHECK(without_color == 6);
}

TEST_CASE("a .sens container gives the frames it was made of, and its lost frame is skipped") {
  FELTMAP_REQUIRE_DATA(folder, "scannet_sens_small");
  FELTMAP_REQUIRE_DATA(house, "house_living_rendered");
  const auto reader = open_sequence(folder / "house_living.sens");
  CHECK(reader->info().layout == "sens");
  CHECK(open_sequence(folder / "house_living.sens", {.format = "scannet"})->info().layout == "sens");
  REQUIRE(reader->size() == 16);
  int skipped = 0;
  for (int64_t i = 0; i < reader->size(); ++i) {
    const ReadResult result = reader->read(i);
    const auto* skip = std::get_if<SkippedFrame>(&result);
    skipped += skip != nullptr;
    if (skip != nullptr) CHECK((i == 14 && skip->reason == "non-finite pose"));
  }
  CHECK(skipped == 1);
  const Frame first = frame_numbered(*reader, 0), original = frame_numbered(*open_sequence(house), 0);
  CHECK(first.T_world_camera.isApprox(original.T_world_camera, 1e-5));
  CHECK(first.color == original.color);
  for (size_t p = 0; p < first.depth_m.size(); p += 97)
    CHECK(std::abs(first.depth_m.data()[p] - original.depth_m.data()[p]) < 0.0007f);  // millimetres are stored
}

TEST_CASE("a folder with one container is that container, and recordings of ROS are told as what they are") {
  FELTMAP_REQUIRE_DATA(folder, "scannet_sens_small");
  FELTMAP_REQUIRE_DATA(logs, "small_logs");
  CHECK(open_sequence(folder)->size() == open_sequence(folder / "house_living.sens")->size());
  CHECK_THROWS_WITH(open_sequence(logs), Catch::Contains("*.bag") && Catch::Contains("ROS"));
}

TEST_CASE("probability maps of single classes become probabilities that sum to one") {
  FELTMAP_REQUIRE_DATA(folder, "apc_shelf_probs");
  const auto reader = open_sequence(folder);
  CHECK(reader->info().has_probabilities);
  CHECK(reader->info().classes.size() == 5);
  const Frame frame = frame_numbered(*reader, 3);
  REQUIRE(frame.probabilities.top == 5);
  float most = 0;
  for (size_t p = 0; p < frame.depth_m.size(); p += 13) {
    float sum = 0;
    for (size_t m = 0; m < 5; ++m) sum += frame.probabilities.probability[p * 5 + m];
    for (size_t m = 1; m < 5; ++m) most = std::max(most, frame.probabilities.probability[p * 5 + m]);
    REQUIRE(sum == Approx(1).margin(1e-5));
  }
  CHECK(most > 0.5f);
}
