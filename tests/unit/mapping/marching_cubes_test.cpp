#include "mapping/surface/marching_cubes.h"

#include <tbb/global_control.h>

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cstring>
#include <map>
#include <random>
#include <set>

#include "mapping/surface/marching_cubes_table.h"
#include "tests/support/analytic_map.h"

using namespace felt;
using Eigen::Vector3d;
using Eigen::Vector3f;
using Eigen::Vector3i;

namespace {

struct EdgeCounts {
  size_t interior = 0;  ///< two triangles, opposite directions
  size_t border = 0;    ///< one triangle
  size_t faulty = 0;    ///< more than two, or two in the same direction
};

EdgeCounts count_edges(const TriangleMesh& mesh, const std::function<void(uint32_t, uint32_t)>& on_border = {}) {
  std::map<std::pair<uint32_t, uint32_t>, std::pair<int, int>> uses;  // (forward, backward)
  for (const Triangle& t : mesh.triangles)
    for (int i = 0; i < 3; ++i) {
      const uint32_t a = t[i], b = t[(i + 1) % 3];
      (a < b ? uses[{a, b}].first : uses[{b, a}].second) += 1;
    }
  EdgeCounts counts;
  for (const auto& [edge, use] : uses) {
    if (use.first == 1 && use.second == 1)
      ++counts.interior;
    else if (use.first + use.second == 1) {
      ++counts.border;
      if (on_border) on_border(edge.first, edge.second);
    } else
      ++counts.faulty;
  }
  return counts;
}

Vector3f cross(const TriangleMesh& mesh, const Triangle& t) {
  const Vector3f a = mesh.positions[t[0]];
  return (mesh.positions[t[1]] - a).cross(mesh.positions[t[2]] - a);
}

size_t unreferenced_vertices(const TriangleMesh& mesh) {
  std::set<uint32_t> used;
  for (const Triangle& t : mesh.triangles) used.insert({t[0], t[1], t[2]});
  return mesh.positions.size() - used.size();
}

/// A field whose signs are random: every case occurs, next to every other.
Map random_map(unsigned seed, double observed_share) {
  Map map(0.5, 2.0);
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> value(-1, 1), uniform(0, 1);
  for (int x = -10; x < 14; ++x)
    for (int y = -9; y < 12; ++y)
      for (int z = -12; z < 10; ++z)
        test::set_voxel(map, {x, y, z}, value(random), uniform(random) < observed_share ? 1.0f : 0.0f);
  return map;
}

}  // namespace

TEST_CASE("the cases of marching cubes use exactly the edges where the sign changes") {
  std::set<int> counts;
  for (int negative = 0; negative < 256; ++negative) {
    const CubeCase& cube = cube_cases()[negative];
    std::set<int> used, crossing;
    for (int i = 0; i < 3 * cube.triangles; ++i) used.insert(cube.edge[i]);
    for (int e = 0; e < 12; ++e) {
      const int low = kCubeEdges[e].corner, high = low | (4 >> kCubeEdges[e].axis);
      REQUIRE(low != high);
      if ((negative >> low & 1) != (negative >> high & 1)) crossing.insert(e);
    }
    REQUIRE(used == crossing);
    counts.insert(cube.triangles);
  }
  CHECK(counts == std::set<int>{0, 1, 2, 3, 4, 5});
}

TEST_CASE("the mesh of a sphere is closed, oriented outwards, of genus zero, and on the sphere") {
  Map map(0.02, 0.08);
  const Vector3d centre(0.013, -0.021, 0.007);
  const double radius = 0.31;
  test::fill_map(map, {-24, -24, -24}, {24, 24, 24}, [&](const Vector3d& p) { return (p - centre).norm() - radius; });
  const TriangleMesh mesh = extract_mesh(map);
  const EdgeCounts edges = count_edges(mesh);
  CHECK(edges.border == 0);
  CHECK(edges.faulty == 0);
  CHECK(int(mesh.positions.size()) - int(edges.interior) + int(mesh.triangles.size()) == 2);
  CHECK(unreferenced_vertices(mesh) == 0);
  CHECK(mesh.colors.empty());
  double farthest = 0, worst_normal = 1, volume = 0;
  for (size_t i = 0; i < mesh.positions.size(); ++i) {
    const Vector3d out = mesh.positions[i].cast<double>() - centre;
    farthest = std::max(farthest, std::abs(out.norm() - radius));
    worst_normal = std::min(worst_normal, mesh.normals[i].cast<double>().dot(out.normalized()));
  }
  for (const Triangle& t : mesh.triangles) {
    REQUIRE(cross(mesh, t).dot(mesh.normals[t[0]]) > 0);
    volume += mesh.positions[t[0]].dot(cross(mesh, t)) / 6;
  }
  // Linear interpolation of a distance across one voxel errs by at most h^2 / (8 radius).
  CHECK(farthest < 0.02 * 0.02 / (8 * radius) * 1.1);
  CHECK(worst_normal > 0.999);
  CHECK(volume == Approx(4 * M_PI / 3 * radius * radius * radius).epsilon(0.005));
}

TEST_CASE("a plane through the voxel centres gives no degenerate triangle and lies within a thousandth of a voxel") {
  Map map(0.02, 0.08);
  test::fill_map(map, {-9, -9, -4}, {12, 9, 4}, [](const Vector3d& p) { return p.z(); });
  const TriangleMesh mesh = extract_mesh(map);
  REQUIRE(mesh.triangles.size() == 2u * 21 * 18);
  for (const Vector3f& p : mesh.positions) REQUIRE(std::abs(p.z()) <= 0.02f / 1000);
  for (const Triangle& t : mesh.triangles) REQUIRE(cross(mesh, t).norm() == Approx(0.02 * 0.02));
  for (const Vector3f& n : mesh.normals) REQUIRE(n.z() == Approx(1));
}

TEST_CASE("distances that are exactly zero leave a closed mesh without degenerate triangles") {
  Map map(1, 4);
  // An octahedron: its faces pass through voxel centres.
  test::fill_map(map, {-9, -9, -9}, {9, 9, 9}, [](const Vector3d& p) { return p.lpNorm<1>() - 6; });
  const TriangleMesh mesh = extract_mesh(map);
  const EdgeCounts edges = count_edges(mesh);
  CHECK(edges.border + edges.faulty == 0);
  CHECK(int(mesh.positions.size()) - int(edges.interior) + int(mesh.triangles.size()) == 2);
  for (const Triangle& t : mesh.triangles) REQUIRE(cross(mesh, t).norm() > 0);
}

TEST_CASE("the faces of a box are met to the rounding of a float away from its edges") {
  Map map(0.05, 0.2);
  const Vector3d half(0.42, 0.33, 0.27);
  test::fill_map(map, {-14, -14, -14}, {14, 14, 14}, [&](const Vector3d& p) {
    const Vector3d q = p.cwiseAbs() - half;
    return q.cwiseMax(0).norm() + std::min(q.maxCoeff(), 0.0);
  });
  const TriangleMesh mesh = extract_mesh(map);
  CHECK(count_edges(mesh).border + count_edges(mesh).faulty == 0);
  size_t checked = 0;
  for (const Vector3f& p : mesh.positions) {
    const Vector3d q = p.cast<double>().cwiseAbs() - half;
    const int near = int((q.array() > -0.06).count());
    if (near != 1) continue;
    ++checked;
    REQUIRE(std::abs(q.maxCoeff()) < 1e-6);
  }
  CHECK(checked > mesh.positions.size() / 2);
}

TEST_CASE("random signs give a mesh whose edges all have two triangles except where observation ends") {
  for (unsigned seed = 0; seed < 5; ++seed) {
    const Map map = random_map(seed, 1);
    std::vector<VertexEdge> where;
    const TriangleMesh mesh = extract_mesh(map, {}, &where);
    REQUIRE(mesh.triangles.size() > 10000);
    REQUIRE(unreferenced_vertices(mesh) == 0);
    size_t inside = 0;
    const EdgeCounts edges = count_edges(mesh, [&](uint32_t a, uint32_t b) {
      // An edge of one triangle must lie in a face of the observed box.
      const Vector3f m = 0.5f * (mesh.positions[a] + mesh.positions[b]) / 0.5f;
      const Vector3f low(-10, -9, -12), high(13, 11, 9);
      inside += (m - low).minCoeff() > 1e-4f && (high - m).minCoeff() > 1e-4f;
    });
    CHECK(inside == 0);
    CHECK(edges.faulty == 0);
    for (const Triangle& t : mesh.triangles) REQUIRE(cross(mesh, t).norm() > 0);
  }
}

TEST_CASE("a cell with an unobserved corner gives no triangle, and every other cell with both signs does") {
  for (const double share : {0.97, 0.7}) {
    const Map map = random_map(7, share);
    const auto observed = [&](int x, int y, int z) {
      const Block* block = map.store.get(block_of_voxel({x, y, z}));
      return block != nullptr && block->geometry->weight[offset_in_block({x, y, z})] > 0;
    };
    const auto value = [&](int x, int y, int z) {
      return map.store.get(block_of_voxel({x, y, z}))->geometry->tsdf[offset_in_block({x, y, z})];
    };
    size_t expected = 0;
    for (int x = -11; x < 14; ++x)
      for (int y = -10; y < 12; ++y)
        for (int z = -13; z < 10; ++z) {
          int pattern = 0;
          bool whole = true;
          for (int c = 0; c < 8 && whole; ++c) {
            const int cx = x + (c >> 2), cy = y + (c >> 1 & 1), cz = z + (c & 1);
            whole = observed(cx, cy, cz);
            if (whole && value(cx, cy, cz) < 0) pattern |= 1 << c;
          }
          if (whole) expected += cube_cases()[pattern].triangles;
        }
    const TriangleMesh mesh = extract_mesh(map);
    CHECK(mesh.triangles.size() == expected);
    CHECK(expected > 1000);
    CHECK(unreferenced_vertices(mesh) == 0);
    CHECK(count_edges(mesh).faulty == 0);
    for (const Vector3f& n : mesh.normals) REQUIRE(n.norm() == Approx(1));
  }
}

TEST_CASE("voxels below the asked weight count as unobserved") {
  Map map(0.1, 0.4);
  test::fill_map(map, {0, 0, 0}, {1, 1, 1}, [](const Vector3d& p) { return p.x() - 0.05; });
  CHECK(extract_mesh(map).triangles.size() == 2);
  test::set_voxel(map, {1, 1, 1}, 0.05f, 0.5f);
  CHECK(extract_mesh(map, {.min_weight = 0.5f}).triangles.size() == 2);
  CHECK(extract_mesh(map, {.min_weight = 0.6f}).triangles.empty());
  test::set_voxel(map, {1, 1, 1}, 0.05f, 0);
  CHECK(extract_mesh(map, {.min_weight = 0}).triangles.empty());
}

TEST_CASE("a map without blocks, and one without a surface, give an empty mesh") {
  Map map(0.1, 0.4);
  CHECK(extract_mesh(map).positions.empty());
  test::fill_map(map, {0, 0, 0}, {20, 3, 3}, [](const Vector3d&) { return 0.3; });
  CHECK(extract_mesh(map).positions.empty());
}

TEST_CASE("the mesh has the same bytes for any number of threads and any order of block creation") {
  const Map map = random_map(3, 0.95);
  Map shuffled(map.voxel_size_m, map.truncation_m);
  std::vector<uint32_t> order = map.store.sorted();
  std::shuffle(order.begin(), order.end(), std::mt19937(1));
  for (const uint32_t i : order)
    *shuffled.store[shuffled.store.find_or_create(map.store[i].coord)].geometry = *map.store[i].geometry;
  const auto same = [](const auto& a, const auto& b) {
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof a[0]) == 0;
  };
  std::vector<VertexEdge> first_edges;
  const TriangleMesh first = extract_mesh(map, {}, &first_edges);
  for (int threads = 1; threads <= 8; ++threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, size_t(threads));
    std::vector<VertexEdge> edges;
    const TriangleMesh again = extract_mesh(threads % 2 ? map : shuffled, {}, &edges);
    CHECK(same(first.positions, again.positions));
    CHECK(same(first.normals, again.normals));
    CHECK(same(first.triangles, again.triangles));
    CHECK(first_edges == edges);
  }
}

TEST_CASE("a vertex's edge says where it lies") {
  const Map map = random_map(5, 1);
  std::vector<VertexEdge> edges;
  const TriangleMesh mesh = extract_mesh(map, {}, &edges);
  REQUIRE(edges.size() == mesh.positions.size());
  for (size_t i = 0; i < edges.size(); ++i) {
    Vector3d p(edges[i].voxel.x, edges[i].voxel.y, edges[i].voxel.z);
    p[edges[i].axis] += edges[i].t;
    REQUIRE((p * map.voxel_size_m - mesh.positions[i].cast<double>()).norm() < 1e-5);
  }
}

TEST_CASE("colours are interpolated between the voxels that have one") {
  Map map(0.1, 0.4);
  test::fill_map(map, {6, 0, 0}, {9, 1, 1}, [](const Vector3d& p) { return p.x() - 0.725; });
  const auto paint = [&](int x, int grey, int count) {
    for (int y = 0; y < 2; ++y)
      for (int z = 0; z < 2; ++z) {
        Block& block = map.store[map.store.find(block_of_voxel({x, y, z}))];
        ColorPlanes& color = map.store.add_color(block);
        const int i = offset_in_block({x, y, z});
        color.r[i] = color.g[i] = uint16_t(grey * 256);
        color.b[i] = 255 * 256;
        color.count[i] = uint16_t(count);
      }
  };
  // The surface crosses the border of two blocks, a quarter of the way from voxel 7 to voxel 8.
  CHECK(extract_mesh(map).colors.empty());
  paint(7, 100, 1);
  const auto only_low = extract_mesh(map).colors;
  REQUIRE(only_low.size() == 4);
  CHECK(only_low[0] == Rgba8{100, 100, 255, 255});
  paint(8, 200, 9);
  CHECK(extract_mesh(map).colors[3] == Rgba8{125, 125, 255, 255});
  paint(7, 0, 0);
  CHECK(extract_mesh(map).colors[0] == Rgba8{200, 200, 255, 255});
  paint(8, 0, 0);
  CHECK(extract_mesh(map).colors[0].a == 0);
  CHECK(extract_mesh(map, {.colors = false}).colors.empty());
}

TEST_CASE("normals use what was observed on one side where the other was not") {
  Map map(0.1, 0.4);
  const Vector3d normal = Vector3d(1, 2, 3).normalized();
  test::fill_map(map, {0, 0, 0}, {1, 1, 1}, [&](const Vector3d& p) { return normal.dot(p) - 0.08; });
  const TriangleMesh mesh = extract_mesh(map);
  REQUIRE_FALSE(mesh.normals.empty());
  for (const Vector3f& n : mesh.normals) CHECK((n.cast<double>() - normal).norm() < 1e-5);
}

TEST_CASE("normals are the gradient between the two voxels, of whatever was observed around each") {
  for (const double share : {0.7, 0.9, 1.0}) {
    Map map(0.5, 2.0);
    std::mt19937 random(11);
    std::uniform_real_distribution<float> value(-1, 1), uniform(0, 1);
    // Few edges, so that most rows of a block hold none.
    for (int x = -10; x < 14; ++x)
      for (int y = -9; y < 12; ++y)
        for (int z = -12; z < 10; ++z)
          test::set_voxel(map, {x, y, z}, uniform(random) < 0.05f ? -0.5f : 1.1f + value(random),
                          uniform(random) < share ? 1.0f : 0.0f);
    const auto distance = [&](const Vector3i& v) {
      const Block* block = map.store.get(block_of_voxel({v.x(), v.y(), v.z()}));
      const int i = offset_in_block({v.x(), v.y(), v.z()});
      return block == nullptr || block->geometry->weight[i] == 0 ? std::nan("") : double(block->geometry->tsdf[i]);
    };
    const auto gradient = [&](const Vector3i& v) {
      Vector3d slopes;
      for (int axis = 0; axis < 3; ++axis) {
        const double low = distance(v - Vector3i::Unit(axis)), here = distance(v),
                     high = distance(v + Vector3i::Unit(axis));
        const bool has_low = !std::isnan(low), has_high = !std::isnan(high);
        slopes[axis] = has_low && has_high ? 0.5 * (high - low) : has_low ? here - low : has_high ? high - here : 0;
      }
      return slopes;
    };
    std::vector<VertexEdge> edges;
    const TriangleMesh mesh = extract_mesh(map, {}, &edges);
    CHECK(mesh.normals.size() == edges.size());
    for (size_t i = 0; i < edges.size(); ++i) {
      const Vector3i low(edges[i].voxel.x, edges[i].voxel.y, edges[i].voxel.z);
      const Vector3d expected =
          (1 - edges[i].t) * gradient(low) + edges[i].t * gradient(low + Vector3i::Unit(edges[i].axis));
      if (expected.norm() < 0.01) continue;
      REQUIRE((mesh.normals[i].cast<double>() - expected.normalized()).norm() < 1e-4);
    }
    CHECK(edges.size() > 100);
  }
}
