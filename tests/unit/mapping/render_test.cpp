#include "mapping/surface/render.h"

#include <tbb/global_control.h>

#include <catch2/catch.hpp>
#include <random>

#include "mapping/evaluation/mesh_distance.h"
#include "mapping/surface/marching_cubes.h"
#include "tests/support/analytic_map.h"

using namespace felt;
using Eigen::Isometry3d;
using Eigen::Vector3d;

namespace {

constexpr PinholeCamera kCamera{100, 100, 49.5, 39.5, 100, 80};

/// A room seen from inside with a ball in it.
double room_distance(const Vector3d& p) {
  return std::min((Vector3d(0.7, 0.6, 0.5) - p.cwiseAbs()).minCoeff(), (p - Vector3d(0.2, 0.1, -0.2)).norm() - 0.2);
}

Map room(const Vector3d& shift_m = Vector3d::Zero()) {
  Map map(0.02, 0.08);
  for (int x = -38; x <= 38; ++x)
    for (int y = -33; y <= 33; ++y)
      for (int z = -28; z <= 28; ++z) {
        const double d = room_distance(Vector3d(x, y, z) * 0.02 - shift_m);
        if (std::abs(d) < 0.08) test::set_voxel(map, {x, y, z}, float(d));
      }
  return map;
}

Isometry3d looking(const Vector3d& from, const Vector3d& to) {
  Isometry3d T = Isometry3d::Identity();
  const Vector3d z = (to - from).normalized(), x = Vector3d(0.1, 1, 0.3).cross(z).normalized();
  T.linear() << x, z.cross(x), z;
  T.translation() = from;
  return T;
}

}  // namespace

TEST_CASE("the rendered depth of a wall is exact") {
  Map map(0.02, 0.08);
  const Vector3d normal = Vector3d(0.2, -0.1, -1).normalized();
  test::fill_map(map, {-60, -60, 40}, {60, 60, 60}, [&](const Vector3d& p) { return normal.dot(p) + 1.0; });
  const RenderedView view = RayCaster(map).render(kCamera, Isometry3d::Identity());
  int seen = 0;
  for (int v = 0; v < 80; ++v)
    for (int u = 0; u < 100; ++u) {
      const double exact = -1.0 / normal.dot(kCamera.ray(u, v));
      if (view.depth_m(u, v) == 0) continue;
      ++seen;
      REQUIRE(view.depth_m(u, v) == Approx(exact).margin(2e-5));
      REQUIRE((view.normal(u, v).cast<double>() - normal).norm() < 1e-3);
    }
  CHECK(seen == 8000);
}

TEST_CASE("rays meet the surface that the mesh of the same map shows") {
  const Map map = room();
  const RayCaster caster(map);
  const TriangleMesh mesh = extract_mesh(map);
  const TriangleTree tree(mesh);
  std::mt19937 random(9);
  std::normal_distribution<double> n;
  int compared = 0;
  for (int i = 0; i < 4000; ++i) {
    const Vector3d from(0.05 * n(random) - 0.3, 0.05 * n(random) - 0.2, 0.05 * n(random) + 0.2);
    const Vector3d direction(n(random), n(random), n(random));
    const auto met = caster.cast(from, direction, 0, 1e4);
    const auto hit = tree.first_hit(from, direction);
    REQUIRE(met.has_value());
    REQUIRE(hit.triangle != TriangleTree::kNone);
    // Within a cell the trilinear zero is curved where the triangles are flat: they part at edges and corners.
    compared += std::abs(*met - hit.distance) * direction.norm() < 0.1 * 0.02;
    REQUIRE(std::abs(room_distance(from + *met * direction)) < 0.2 * 0.02);
  }
  CHECK(compared > 3900);
}

TEST_CASE("depth, normal and colour agree with the scene, and the voxel is the nearest one") {
  Map map = room();
  for (Block& block : map.store.blocks()) {
    ColorPlanes& color = map.store.add_color(block);
    for (int i = 0; i < kBlockVoxels; ++i) {
      const Index3 v = voxel_of_offset(i);
      color.count[i] = 1;
      color.r[i] = uint16_t(256 * (100 + block.coord.x * 8 + v.x));
      color.g[i] = 256 * 50;
    }
  }
  const Isometry3d T = looking({-0.4, -0.35, 0.3}, {0.2, 0.1, -0.2});
  const RenderedView view = RayCaster(map).render(kCamera, T);
  for (int v = 0; v < 80; ++v)
    for (int u = 0; u < 100; ++u) {
      REQUIRE(view.depth_m(u, v) > 0);
      const Vector3d p = T * (kCamera.ray(u, v) * double(view.depth_m(u, v)));
      REQUIRE(std::abs(room_distance(p)) < 0.004);
      REQUIRE(std::abs(view.color(u, v).r - (100 + p.x() / 0.02)) < 1.01);
      REQUIRE(int(view.color(u, v).g) == 50);
      const VoxelRef voxel = view.voxel(u, v);
      const Index3 first = first_voxel(map.store[voxel.block].coord), local = voxel_of_offset(voxel.offset);
      const Vector3d centre = Vector3d(first.x + local.x, first.y + local.y, first.z + local.z) * 0.02;
      REQUIRE((p - centre).cwiseAbs().maxCoeff() < 0.01 + 1e-5);
    }
  const Vector3d to_ball = (Vector3d(0.2, 0.1, -0.2) - T.translation()).normalized();
  CHECK((view.normal(50, 40).cast<double>() + to_ball).norm() < 0.05);
}

TEST_CASE("where the nearest voxel has no class, the pixel is that of the nearest one around it that has") {
  Map map(0.02, 0.08);
  map.classes = ClassTable({{1, "wall", {}, false}});
  test::fill_map(map, {-30, -30, 40}, {30, 30, 60}, [](const Vector3d& p) { return 1.006 - p.z(); });
  // Beside the optical axis the surface is at (0.2, 0.2, 50.3) voxels: nearest is (0, 0, 50), then (1, 0, 50) and so
  // on.
  const auto label = [&map](const Index3& v) {
    Block& block = map.store[map.store.find(block_of_voxel(v))];
    if (block.evidence.empty()) block.evidence = {{0, map.store.new_plane()}};
    block.evidence[0].counts->value[offset_in_block(v)] = 1;
  };
  const Isometry3d T(Eigen::Translation3d(0.004, 0.004, 0));
  const PinholeCamera camera{100, 100, 0, 0, 1, 1};
  const auto seen = [&] {
    const VoxelRef v = RayCaster(map).render(camera, T).voxel(0, 0);
    const Index3 first = first_voxel(map.store[v.block].coord), local = voxel_of_offset(v.offset);
    return Index3{first.x + local.x, first.y + local.y, first.z + local.z};
  };
  CHECK(seen() == Index3{0, 0, 50});
  label({2, 0, 50});  // not around the point
  CHECK(seen() == Index3{0, 0, 50});
  label({1, 0, 51});
  CHECK(seen() == Index3{1, 0, 51});
  label({0, 0, 51});
  CHECK(seen() == Index3{0, 0, 51});
  label({0, 0, 50});
  CHECK(seen() == Index3{0, 0, 50});
}

TEST_CASE("surfaces are not seen from behind, nor where a voxel was not observed, nor beyond the depth limits") {
  Map map(0.02, 0.08);
  test::fill_map(map, {-30, -30, 40}, {30, 30, 60}, [](const Vector3d& p) { return 1.0 - p.z(); });
  const RayCaster caster(map);
  CHECK(*caster.cast({0, 0, 0}, {0, 0, 1}, 0, 10) == Approx(1.0).margin(1e-5));
  CHECK(*caster.cast({0, 0, 0}, {0, 0, 0.5}, 0, 10) == Approx(2.0).margin(1e-5));
  CHECK_FALSE(caster.cast({0, 0, 3}, {0, 0, -1}, 0, 10).has_value());
  CHECK_FALSE(caster.cast({0, 0, 0}, {0, 0, 1}, 0, 0.9).has_value());
  CHECK_FALSE(caster.cast({0, 0, 0}, {0, 0, 1}, 1.1, 10).has_value());
  CHECK_FALSE(caster.cast({0, 0, 0}, {0, 0, 0}, 0, 10).has_value());
  CHECK_FALSE(caster.cast({0, 0, 0}, {NAN, 0, 1}, 0, 10).has_value());
  test::set_voxel(map, {0, 0, 50}, 0, 0);
  CHECK_FALSE(RayCaster(map).cast({0.001, 0.001, 0}, {0, 0, 1}, 0, 10).has_value());
  CHECK(RayCaster(map).cast({0.101, 0.001, 0}, {0, 0, 1}, 0, 10).has_value());
}

TEST_CASE("a picture shows at every pixel what a ray by itself meets, wherever the camera stands") {
  // Not in the plane of voxels, where a ray along the seam of two walls meets them or not by rounding.
  const Map map = room({0.003, 0.007, -0.004});
  const RayCaster caster(map);
  const ViewOptions options{.min_depth_m = 0.05, .max_depth_m = 1.2};
  std::mt19937 random(4);
  std::uniform_real_distribution<double> any(-1, 1);
  int met = 0, none = 0;
  for (int view = 0; view < 8; ++view) {
    // Within the room, within the band of its walls, outside, and so that blocks lie on both sides of the camera.
    const Vector3d from = Vector3d(any(random), any(random), any(random)).cwiseProduct(Vector3d(0.75, 0.65, 0.55));
    const Isometry3d T = looking(from, from + Vector3d(any(random), any(random), any(random)));
    const RenderedView picture = caster.render(kCamera, T, options);
    for (int v = 0; v < 80; ++v)
      for (int u = 0; u < 100; ++u) {
        const auto depth = caster.cast(from, T.linear() * kCamera.ray(u, v), options.min_depth_m, options.max_depth_m);
        INFO("view " << view << ", pixel " << u << ' ' << v);
        REQUIRE(double(picture.depth_m(u, v)) == Approx(depth.value_or(0)).margin(1e-5));
        depth ? ++met : ++none;
      }
  }
  CHECK(met > 10000);
  CHECK(none > 1000);
}

TEST_CASE("the picture has the same bytes for any number of threads") {
  const Map map = room();
  const Isometry3d T = looking({-0.4, -0.35, 0.3}, {0.2, 0.1, -0.2});
  const RenderedView first = RayCaster(map).render(kCamera, T);
  for (int threads = 1; threads <= 4; ++threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, size_t(threads));
    const RenderedView again = RayCaster(map).render(kCamera, T);
    CHECK(first.depth_m == again.depth_m);
    CHECK(first.normal == again.normal);
  }
}

TEST_CASE("an empty map and one far away render as nothing, quickly") {
  Map map(0.02, 0.08);
  CHECK(RayCaster(map).render(kCamera, Isometry3d::Identity(), {.max_depth_m = 1e3}).depth_m(50, 40) == 0);
  test::set_voxel(map, {1 << 26, 0, 0}, 0.01f);
  CHECK(RayCaster(map).render(kCamera, Isometry3d::Identity(), {.max_depth_m = 1e3}).depth_m(50, 40) == 0);
}
