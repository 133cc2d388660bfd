#include "io/simulation/scene_mesh.h"

#include <catch2/catch.hpp>
#include <random>

#include "io/simulation/convex_clip.h"
#include "io/simulation/render_scene.h"
#include "io/simulation/scene_library.h"
#include "io/simulation/trajectory.h"
#include "mapping/evaluation/mesh_distance.h"
#include "tests/support/scenes.h"

using namespace felt;
using Eigen::Vector3d;

namespace {

constexpr double kChordError_m = 2e-4;

double area(const Polygon& polygon) {
  Vector3d twice = Vector3d::Zero();
  for (size_t i = 2; i < polygon.size(); ++i) twice += (polygon[i - 1] - polygon[0]).cross(polygon[i] - polygon[0]);
  return twice.norm() / 2;
}

}  // namespace

TEST_CASE("points of a scene's mesh lie on its surface and its triangles look outward") {
  for (const std::string& name : scene_names()) {
    INFO(name);
    const Scene scene = make_scene(name);
    const SurfaceSamples samples = sample_surface(scene_mesh(scene, kChordError_m), 4000);
    REQUIRE(samples.positions.size() == 4000);
    for (size_t i = 0; i < samples.positions.size(); ++i) {
      const Vector3d p = samples.positions[i].cast<double>(), n = samples.normals[i].cast<double>();
      REQUIRE(std::abs(signed_distance_m(scene, p)) < kChordError_m + 1e-6);
      // In a crease a step off one solid may lead into the other.
      const bool outward = std::any_of(scene.primitives.begin(), scene.primitives.end(), [&](const Primitive& solid) {
        return std::abs(signed_distance_m(solid, p)) < kChordError_m + 1e-6 &&
               signed_distance_m(solid, p + 4 * kChordError_m * n) > 2 * kChordError_m;
      });
      REQUIRE(outward);
    }
  }
}

TEST_CASE("outside of the solids the signed distance is the distance to the mesh") {
  std::mt19937 random(9);
  std::uniform_real_distribution<double> unit(0, 1);
  for (const std::string& name : scene_names()) {
    const Scene scene = make_scene(name);
    const TriangleTree tree(scene_mesh(scene, kChordError_m));
    int compared = 0;
    for (int i = 0; i < 2000; ++i) {
      const Vector3d share(unit(random), unit(random), unit(random));
      const Vector3d p = scene.bounds.min() + share.cwiseProduct(scene.bounds.sizes());
      const double exact_m = signed_distance_m(scene, p);
      if (exact_m <= 0) continue;
      INFO(name << " " << p.transpose());
      REQUIRE(tree.nearest(p).distance_m == Approx(exact_m).margin(kChordError_m + 1e-6));
      ++compared;
    }
    CHECK(compared > 500);
  }
}

TEST_CASE("everything that a camera sees within the bounds is on the mesh, with the class and material it sees") {
  for (const std::string& name : scene_names()) {
    const Scene scene = make_scene(name);
    const TriangleMesh mesh = scene_mesh(scene, kChordError_m);
    const TriangleTree tree(mesh);
    const PinholeCamera camera = simulated_camera(40, 30);
    int seen = 0, same = 0;
    for (const auto& T : standard_trajectory(scene, 5)) {
      const SceneView view = render_view(scene, camera, T);
      for (int v = 0; v < camera.height; ++v) {
        for (int u = 0; u < camera.width; ++u) {
          const Vector3d p = T * Vector3d(double(view.depth_m(u, v)) * camera.ray(u, v));
          if (view.depth_m(u, v) <= 0 || !scene.bounds.contains(p)) continue;
          const auto nearest = tree.nearest(p);
          INFO(name << " pixel " << u << ", " << v);
          REQUIRE(nearest.distance_m < kChordError_m + 1e-6);
          ++seen;
          same += (*TriangleMesh::find(mesh.triangle_scalars, "instance"))[nearest.triangle] == view.instances(u, v) &&
                  (*TriangleMesh::find(mesh.triangle_scalars, "semantic"))[nearest.triangle] == view.semantics(u, v) &&
                  (*TriangleMesh::find(mesh.triangle_scalars, "material"))[nearest.triangle] == view.materials(u, v);
        }
      }
    }
    INFO(name);
    CHECK(seen > 500);
    CHECK(same > 0.99 * seen);  // a pixel beside a border may be nearest to the other side of it
  }
}

TEST_CASE("a polygon minus a convex keeps its area but for the part inside") {
  const Polygon square = {{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}};
  const auto box = [](double x0, double x1, double y0, double y1, double z0, double z1) {
    return std::vector<HalfSpace>{{Vector3d::UnitX(), x1},   {-Vector3d::UnitX(), -x0}, {Vector3d::UnitY(), y1},
                                  {-Vector3d::UnitY(), -y0}, {Vector3d::UnitZ(), z1},   {-Vector3d::UnitZ(), -z0}};
  };
  const auto left = [&](const std::vector<HalfSpace>& convex) {
    double sum = 0;
    for (const Polygon& piece : subtracted(square, convex)) sum += area(piece);
    return sum;
  };
  CHECK(left(box(0.5, 1, 0.5, 1, -1, 1)) == Approx(3.75));
  CHECK(left(box(0.5, 1, 0.5, 1, 0, 1)) == Approx(3.75));  // standing on it
  CHECK(left(box(0.5, 1, 0.5, 1, 0.1, 1)) == Approx(4));   // floating above it
  CHECK(left(box(-1, 3, -1, 3, -1, 1)) == 0);
  CHECK(left(box(2, 3, 0, 2, -1, 1)) == Approx(4));  // beside it
  CHECK(subtracted(square, box(5, 6, 0.5, 1, -1, 1)).size() == 1);
}
