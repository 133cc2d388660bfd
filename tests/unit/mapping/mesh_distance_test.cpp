#include "mapping/evaluation/mesh_distance.h"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>
#include <random>

using namespace felt;
using Eigen::Vector3d;
using Eigen::Vector3f;

namespace {

TriangleMesh random_triangles(int count, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> where(-2, 2), size(-0.4f, 0.4f);
  TriangleMesh mesh;
  for (int i = 0; i < count; ++i) {
    const Vector3f p(where(random), where(random), where(random));
    for (int j = 0; j < 3; ++j) mesh.positions.push_back(p + Vector3f(size(random), size(random), size(random)));
    mesh.triangles.push_back({uint32_t(3 * i), uint32_t(3 * i + 1), uint32_t(3 * i + 2)});
  }
  return mesh;
}

/// Smallest distance over a fine barycentric lattice: an upper bound within one lattice step of the distance.
double distance_by_lattice(const Vector3d& p, const Vector3d& a, const Vector3d& b, const Vector3d& c, int steps) {
  double best = 1e300;
  for (int i = 0; i <= steps; ++i)
    for (int j = 0; i + j <= steps; ++j)
      best = std::min(best, (a + (b - a) * i / steps + (c - a) * j / steps - p).norm());
  return best;
}

TriangleMesh square(float side) {
  TriangleMesh mesh;
  mesh.positions = {{0, 0, 0}, {side, 0, 0}, {side, side, 0}, {0, side, 0}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

}  // namespace

TEST_CASE("the nearest point of a triangle is no farther than any point of a fine lattice on it") {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> u(-1, 1);
  const auto point = [&] { return Vector3d(u(random), u(random), u(random)); };
  for (int trial = 0; trial < 400; ++trial) {
    const Vector3d a = point(), b = point(), c = trial % 10 ? point() : Vector3d(0.5 * (a + b)), p = 2 * point();
    const Vector3d q = nearest_on_triangle(p, a, b, c);
    const double lattice = distance_by_lattice(p, a, b, c, 60),
                 step = 2 * std::max((b - a).norm(), (c - a).norm()) / 60;
    REQUIRE((q - p).norm() <= lattice + 1e-12);
    REQUIRE((q - p).norm() >= lattice - step);
    REQUIRE((nearest_on_triangle(q, a, b, c) - q).norm() < 1e-7);
  }
}

TEST_CASE("the tree finds the same nearest distance as a search through every triangle") {
  const TriangleMesh mesh = random_triangles(700, 1);
  const TriangleTree tree(mesh);
  std::mt19937 random(2);
  std::uniform_real_distribution<float> u(-3, 3);
  std::vector<Vector3f> points(300);
  for (Vector3f& p : points) p = {u(random), u(random), u(random)};
  const std::vector<float> distances = distances_to_mesh(points, tree);
  for (size_t i = 0; i < points.size(); ++i) {
    const Vector3d p = points[i].cast<double>();
    double best = 1e300;
    for (const Triangle& t : mesh.triangles)
      best = std::min(best,
                      (nearest_on_triangle(p, mesh.positions[t[0]].cast<double>(), mesh.positions[t[1]].cast<double>(),
                                           mesh.positions[t[2]].cast<double>()) -
                       p)
                          .norm());
    REQUIRE(distances[i] == Approx(best).epsilon(1e-6));
    const auto found = tree.nearest(p);
    REQUIRE((found.point - p).norm() == Approx(best));
    REQUIRE(tree.nearest(p, best * 0.999).triangle == TriangleTree::kNone);
    REQUIRE(tree.nearest(p, best * 1.001).triangle == found.triangle);
  }
}

TEST_CASE("a ray meets the same first triangle as a search through every triangle") {
  const TriangleMesh mesh = random_triangles(500, 3);
  const TriangleTree tree(mesh);
  std::mt19937 random(5);
  std::normal_distribution<double> n;
  int hits = 0;
  for (int trial = 0; trial < 500; ++trial) {
    const Vector3d origin = 2 * Vector3d(n(random), n(random), n(random));
    Vector3d direction(n(random), n(random), n(random));
    if (trial % 3 == 0) direction = Vector3d::Unit(trial % 9 / 3);
    double best = INFINITY;
    for (const Triangle& t : mesh.triangles) {
      const Vector3d a = mesh.positions[t[0]].cast<double>();
      Eigen::Matrix3d m;
      m << mesh.positions[t[1]].cast<double>() - a, mesh.positions[t[2]].cast<double>() - a, -direction;
      const Vector3d x = m.fullPivLu().solve(origin - a);
      if (x[0] >= 0 && x[1] >= 0 && x[0] + x[1] <= 1 && x[2] > 0) best = std::min(best, x[2]);
    }
    const auto hit = tree.first_hit(origin, direction);
    hits += std::isfinite(best);
    REQUIRE(std::isfinite(hit.distance) == std::isfinite(best));
    if (std::isfinite(best)) {
      REQUIRE(hit.distance == Approx(best));
      REQUIRE(tree.first_hit(origin, direction, 0.99 * best).triangle == TriangleTree::kNone);
    }
  }
  CHECK(hits > 100);
}

TEST_CASE("meshes without usable triangles have no nearest point") {
  TriangleMesh mesh = square(1);
  mesh.positions[0].x() = NAN;
  mesh.triangles[1] = {1, 2, 9};
  const TriangleTree tree(mesh);
  CHECK(tree.empty());
  CHECK(tree.nearest({0, 0, 0}).triangle == TriangleTree::kNone);
  CHECK(tree.first_hit({0.5, 0.5, 1}, {0, 0, -1}).triangle == TriangleTree::kNone);
  const std::vector<Vector3f> points = {{0, 0, 0}, {NAN, 0, 0}};
  const auto distances = distances_to_mesh(points, tree);
  CHECK(std::isinf(distances[0]));
  CHECK(std::isnan(distances[1]));
  CHECK(sample_surface(mesh, 10).positions.empty());
}

TEST_CASE("samples are spread by area, lie on the surface, and repeat with the seed") {
  TriangleMesh mesh = square(2);
  mesh.positions.insert(mesh.positions.end(), {{5, 0, 1}, {6, 0, 1}, {5, 1, 1}});  // an eighth of the square's area
  mesh.triangles.push_back({4, 5, 6});
  const size_t count = 9000;
  const SurfaceSamples samples = sample_surface(mesh, count, 11);
  REQUIRE(samples.positions.size() == count);
  size_t on_small = 0, quadrant = 0;
  const TriangleTree tree(mesh);
  for (size_t i = 0; i < count; ++i) {
    on_small += samples.triangles[i] == 2;
    quadrant += samples.triangles[i] < 2 && samples.positions[i].x() < 1 && samples.positions[i].y() < 1;
    REQUIRE(tree.nearest(samples.positions[i].cast<double>()).distance_m < 1e-6);
    REQUIRE(samples.normals[i].z() == Approx(1));
  }
  CHECK(std::abs(double(on_small) - count / 9.0) <= 1);
  CHECK(std::abs(double(quadrant) - count * 2 / 9.0) < 4 * std::sqrt(count * 2 / 9.0));
  CHECK(sample_surface(mesh, count, 11).positions == samples.positions);
  CHECK(sample_surface(mesh, count, 12).positions != samples.positions);
}
