#include "io/simulation/scene.h"

#include <catch2/catch.hpp>
#include <random>

#include "core/error.h"
#include "io/simulation/render_scene.h"
#include "io/simulation/scene_library.h"
#include "io/simulation/trajectory.h"
#include "tests/support/scenes.h"

using namespace felt;
using Eigen::Vector3d;

namespace {

Vector3d random_point(const Scene& scene, std::mt19937& random) {
  std::uniform_real_distribution<double> unit(0, 1);
  const Vector3d share(unit(random), unit(random), unit(random));
  return scene.bounds.min() + share.cwiseProduct(scene.bounds.sizes());
}

}  // namespace

TEST_CASE("rays hit where the signed distance is zero, and meet nothing before") {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  for (const std::string& name : scene_names()) {
    const Scene scene = make_scene(name);
    int hits = 0;
    for (int i = 0; i < 300; ++i) {
      const Vector3d origin = random_point(scene, random), direction(normal(random), normal(random), normal(random));
      if (signed_distance_m(scene, origin) <= 1e-3) continue;
      const SceneHit hit = cast_ray(scene, origin, direction);
      const double reach = hit.primitive >= 0 ? hit.depth_m : 5 / direction.norm();
      for (int step = 0; step < 20; ++step)
        REQUIRE(signed_distance_m(scene, origin + reach * step / 20.0 * direction) > 0);
      if (hit.primitive < 0) continue;
      ++hits;
      const Vector3d p = origin + hit.depth_m * direction;
      REQUIRE(std::abs(signed_distance_m(scene, p)) < 1e-6);
      REQUIRE(std::abs(signed_distance_m(scene.primitives[hit.primitive], p)) < 1e-6);
      REQUIRE(hit.normal.norm() == Approx(1));
      REQUIRE(hit.normal.dot(direction) < 0);
      // The normal is the gradient: a small step along it gains the step's length.
      REQUIRE(signed_distance_m(scene.primitives[hit.primitive], p + 1e-4 * hit.normal) == Approx(1e-4).margin(1e-6));
    }
    INFO(name);
    CHECK(hits > 20);
  }
}

TEST_CASE("the signed distance changes no faster than the point moves") {
  std::mt19937 random(5);
  for (const std::string& name : scene_names()) {
    const Scene scene = make_scene(name);
    for (int i = 0; i < 500; ++i) {
      const Vector3d a = random_point(scene, random), b = random_point(scene, random);
      REQUIRE(std::abs(signed_distance_m(scene, a) - signed_distance_m(scene, b)) <= (a - b).norm() + 1e-12);
    }
  }
}

TEST_CASE("a rendered view is the ray cast of every pixel") {
  for (const std::string& name : scene_names()) {
    const Scene scene = make_scene(name);
    const PinholeCamera camera = simulated_camera(40, 30);
    for (const auto& T : standard_trajectory(scene, 3)) {
      const SceneView view = render_view(scene, camera, T);
      for (int v = 0; v < camera.height; ++v) {
        for (int u = 0; u < camera.width; ++u) {
          const SceneHit hit = cast_ray(scene, T.translation(), T.linear() * camera.ray(u, v));
          INFO(name << " pixel " << u << ", " << v);
          if (hit.primitive < 0) {
            REQUIRE(view.depth_m(u, v) == 0);
            REQUIRE(view.instances(u, v) == 0);
            continue;
          }
          REQUIRE(view.depth_m(u, v) == Approx(hit.depth_m).epsilon(1e-6));
          // Where two solids meet, rounding decides which of them a ray meets first.
          const Primitive& p = scene.primitives[hit.primitive];
          const Vector3d point = T.translation() + hit.depth_m * (T.linear() * camera.ray(u, v));
          int touching = 0;
          for (const Primitive& other : scene.primitives)
            if (std::abs(signed_distance_m(other, point)) < 1e-9 && other.instance != p.instance) ++touching;
          if (touching > 0) continue;
          REQUIRE(view.instances(u, v) == p.instance);
          REQUIRE(view.semantics(u, v) == p.semantic);
        }
      }
    }
  }
}

TEST_CASE("every scene's class ids are in its tables and its standard path keeps clear of everything") {
  for (const std::string& name : scene_names()) {
    const Scene scene = make_scene(name);
    INFO(name);
    CHECK(scene.name == name);
    for (const Primitive& p : scene.primitives) {
      CHECK(scene.semantics.slot_of_id(p.semantic) != ClassTable::kNoSlot);
      CHECK(scene.materials.slot_of_id(p.material) != ClassTable::kNoSlot);
      CHECK(p.instance > 0);
    }
    CHECK(clearance_m(scene, standard_trajectory(scene, 200)) > 0.25);
  }
}

TEST_CASE("an unknown scene is refused with the names of the known ones") {
  CHECK_THROWS_WITH(make_scene("castle"), Catch::Contains("room1") && Catch::Contains("'castle'"));
}

TEST_CASE("a sequence in memory holds frames of the camera's size with true labels") {
  const auto frames = test::simulated_frames("boxes", 4);
  REQUIRE(frames.size() == 4);
  for (size_t i = 0; i < frames.size(); ++i) {
    CHECK(frames[i].index == int64_t(i));
    CHECK(frames[i].depth_m.width() == 160);
    CHECK(frames[i].labels.height() == 120);
    CHECK(frames[i].color.size() == 160 * 120);
    CHECK(frames[i].camera.fx == Approx(525.0 / 4));
  }
}
