#include "io/simulation/depth_noise.h"

#include <tbb/global_control.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>
#include <set>

#include "io/simulation/render_sequence.h"
#include "tests/support/scenes.h"

using namespace felt;

namespace {

/// A wall across the whole image at one depth and incidence.
SceneView wall(float depth_m, double incidence_rad, int width = 200, int height = 150) {
  SceneView view;
  view.depth_m = DepthImage(width, height, depth_m);
  view.incidence_cos = Image<float>(width, height, float(std::cos(incidence_rad)));
  return view;
}

DepthNoise axial_only() {
  DepthNoise noise;
  noise.lateral_scale = noise.disparity_step_px = noise.edge_dropout = noise.random_dropout = 0;
  return noise;
}

}  // namespace

TEST_CASE("axial noise has no bias and the spread of the model at every depth and angle") {
  for (const double depth_m : {0.6, 1.0, 2.0, 3.5}) {
    for (const double angle : {0.0, 0.9, 1.2}) {
      const SceneView view = wall(float(depth_m), angle);
      double sum = 0, squares = 0;
      const DepthImage measured = add_depth_noise(view, simulated_camera(200, 150), axial_only(), 7, 0);
      for (const float z : measured) sum += z - depth_m, squares += (z - depth_m) * (z - depth_m);
      const double n = double(measured.size()), sigma = axial_sigma_m(depth_m, angle);
      INFO(depth_m << " m at " << angle);
      CHECK(std::abs(sum / n) < 4 * sigma / std::sqrt(n) + 1e-7);
      CHECK(std::sqrt(squares / n) == Approx(sigma).epsilon(4 / std::sqrt(2 * n)));
    }
  }
  // Equations 3 and 4 of the paper at 1.4 m: 1.2 mm + 1.9 mm, and the term of grazing angles.
  CHECK(axial_sigma_m(1.4, 0.5) == Approx(0.0031));
  CHECK(axial_sigma_m(1.4, 1.2) - axial_sigma_m(1.4, 0.5) ==
        Approx(0.0001 / std::sqrt(1.4) * 1.44 / std::pow(std::numbers::pi / 2 - 1.2, 2)));
  CHECK(lateral_sigma_px(0) == Approx(0.8));
}

TEST_CASE("lateral noise moves a depth edge by its standard deviation") {
  SceneView view = wall(1.0f, 0, 200, 400);
  for (int v = 0; v < 400; ++v)
    for (int u = 100; u < 200; ++u) view.depth_m(u, v) = 2.0f;
  DepthNoise noise = axial_only();
  noise.axial_scale = 0;
  noise.lateral_scale = 4;  // sigma 3.2 pixels: the rounding to whole pixels hardly counts
  const DepthImage measured = add_depth_noise(view, simulated_camera(200, 400), noise, 3, 0);
  // The share of far pixels in column u is the probability that a normal deviate exceeds 99.5 - u.
  for (const int u : {95, 98, 100, 103}) {
    int far = 0;
    for (int v = 0; v < 400; ++v) far += measured(u, v) > 1.5f;
    const double expected = 0.5 * std::erfc((99.5 - u) / 3.2 / std::sqrt(2.0));
    INFO(u);
    CHECK(far / 400.0 == Approx(expected).margin(4 * std::sqrt(expected * (1 - expected) / 400)));
  }
}

TEST_CASE("quantised depth takes the values of whole steps of disparity") {
  DepthNoise noise = axial_only();
  noise.disparity_step_px = 0.125;
  const PinholeCamera camera = simulated_camera(200, 150);
  std::set<float> values;
  for (const float z : add_depth_noise(wall(2.0f, 0), camera, noise, 5, 0)) {
    const double steps = camera.fx * noise.baseline_m / z / noise.disparity_step_px;
    REQUIRE(steps == Approx(std::round(steps)).margin(1e-3));
    values.insert(z);
  }
  CHECK(values.size() > 1);
}

TEST_CASE("the sensor measures nothing out of range, at grazing angles, and at the stated share of other pixels") {
  DepthNoise noise = axial_only();
  const PinholeCamera camera = simulated_camera(200, 150);
  const auto lost = [&](const SceneView& view) {
    const DepthImage z = add_depth_noise(view, camera, noise, 5, 0);
    return double(std::count(z.begin(), z.end(), 0.0f)) / double(z.size());
  };
  CHECK(lost(wall(0.3f, 0)) == 1);
  CHECK(lost(wall(9.0f, 0)) == 1);
  CHECK(lost(wall(2.0f, 1.5)) == 1);
  CHECK(lost(wall(2.0f, 1.2)) == 0);
  noise.random_dropout = 0.1;
  CHECK(lost(wall(2.0f, 0)) == Approx(0.1).margin(4 * std::sqrt(0.09 / 30000)));
}

TEST_CASE("frames are the same for any number of threads and differ from seed to seed and frame to frame") {
  RenderOptions options;
  options.noise = DepthNoise{};
  const auto with_threads = [&](int threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, size_t(threads));
    return test::simulated_frames("boxes", 2, options);
  };
  const auto one = with_threads(1), three = with_threads(3);
  for (size_t i = 0; i < one.size(); ++i) {
    CHECK(one[i].depth_m == three[i].depth_m);
    CHECK(one[i].color == three[i].color);
    CHECK(one[i].labels == three[i].labels);
    CHECK(one[i].instances == three[i].instances);
  }
  options.seed = 2;
  CHECK(test::simulated_frames("boxes", 2, options)[0].depth_m != one[0].depth_m);
  const SceneView view = wall(1.0f, 0);
  CHECK(add_depth_noise(view, simulated_camera(200, 150), DepthNoise{}, 1, 0) !=
        add_depth_noise(view, simulated_camera(200, 150), DepthNoise{}, 1, 1));
}
