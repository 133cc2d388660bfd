// Connected regions against a flood that looks at one voxel at a time.
#include <tbb/global_control.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <random>
#include <set>
#include <vector>

#include "mapping/regions/interior_kernels.h"
#include "mapping/regions/region_query.h"
#include "mapping/regions/region_surface.h"
#include "tests/support/labelled_map.h"
#include "tests/support/region_voxels.h"
#include "tests/support/simd_targets.h"

using namespace felt;
using namespace felt::test;

namespace {

/// A rippled floor and a wall, noisy, with holes that were never observed and a few voxels of another class.
Map rough_corner(uint32_t seed, double noise_voxels) {
  constexpr double kVoxel = 0.02;
  std::mt19937 rng(seed);
  std::normal_distribution<double> normal(0, noise_voxels * kVoxel);
  Map map = labelled_map(
      kVoxel, {-0.45, -0.3, -0.1}, {0.45, 0.3, 0.5},
      [&](const Eigen::Vector3d& p) {
        const double floor = p.z() - 0.03 * std::sin(9 * p.x()) * std::sin(7 * p.y());
        return std::min(floor, 0.4 - p.x()) + normal(rng);
      },
      class_table({"floor", "rug"}), [&](const Eigen::Vector3d& p) { return p.y() > 0.2 || rng() % 100 == 0 ? 1 : 0; });
  for (Block& block : map.store.blocks())
    for (float& weight : block.geometry->weight)
      if (rng() % 50 == 0) weight = 0;
  return map;
}

/// One voxel of the map; nothing where it was not observed.
struct Voxel {
  float tsdf = 0;
  std::vector<float> evidence;
};
std::optional<Voxel> voxel_at(const Map& map, const Index3& v, float min_weight) {
  const Block* block = map.store.get(block_of_voxel(v));
  const int i = offset_in_block(v);
  if (block == nullptr || block->geometry->weight[i] < min_weight) return std::nullopt;
  Voxel voxel{block->geometry->tsdf[i], std::vector<float>(size_t(map.classes.size()), 0.0f)};
  for (const EvidencePlane& e : block->evidence) voxel.evidence[e.slot] = e.counts->value[i];
  return voxel;
}

template <typename Visit>
void for_each_neighbour(const Index3& v, const Visit& visit) {
  for (int n = 0; n < 27; ++n)
    if (n != 13) visit(Index3{v.x + n / 9 - 1, v.y + n / 3 % 3 - 1, v.z + n % 3 - 1});
}

/// The plane that fits the 27 voxels around one.
SurfacePlane plane_at(const Map& map, const Index3& v, float min_weight) {
  SurfaceTile tile;
  for (int n = 0; n < 27; ++n) {
    const Index3 d{n / 9 - 1, n / 3 % 3 - 1, n % 3 - 1};
    const auto voxel = voxel_at(map, {v.x + d.x, v.y + d.y, v.z + d.z}, min_weight);
    tile.tsdf[SurfaceTile::index(d.x, d.y, d.z)] = voxel ? voxel->tsdf : std::numeric_limits<float>::quiet_NaN();
  }
  return fitted_plane(tile, SurfaceTile::index(0, 0, 0));
}

/// The rule as docs/touch.md words it.
std::set<Index3> flooded(const Map& map, const Contact& contact, const RegionSettings& settings) {
  const float band_m = float(settings.band_voxels * map.voxel_size_m), min_weight = float(settings.min_weight);
  const float cos_limit = float(std::cos(normal_limit_deg(map, contact, settings) * std::numbers::pi / 180));
  const auto in_band = [&](const Index3& v) {
    const auto voxel = voxel_at(map, v, min_weight);
    return voxel && std::abs(voxel->tsdf) <= band_m;
  };
  const auto is_candidate = [&](const Index3& v) {
    if (!in_band(v)) return false;
    const std::vector<float> evidence = voxel_at(map, v, min_weight)->evidence;
    const float most = *std::max_element(evidence.begin(), evidence.end());
    const float own = evidence[size_t(contact.slot)];
    return most > 0 && (own >= most || 1 + own > float(settings.class_ratio) * (1 + most));
  };
  const auto agree = [&](const Index3& a, const Index3& b) {
    const Eigen::Vector3f m = surface_normal(map, a, min_weight), n = surface_normal(map, b, min_weight);
    return (m.x() * n.x() + m.y() * n.y()) + m.z() * n.z() >= cos_limit;
  };
  const auto is_interior = [&](const Index3& v) {
    bool all = is_candidate(v);
    for_each_neighbour(v, [&](const Index3& u) { all = all && (!in_band(u) || agree(v, u)); });
    return all;
  };
  std::set<Index3> region, grown;
  std::vector<Index3> open;
  const auto reach = [&](const Index3& v) {
    if (is_candidate(v) && !grown.contains(v) && is_interior(v)) grown.insert(v), open.push_back(v);
  };
  const auto plant = [&](const Index3& v) {
    if (is_candidate(v)) region.insert(v);
    reach(v);
  };
  plant(contact.voxel);
  for_each_neighbour(contact.voxel, [&](const Index3& u) {
    if (agree(contact.voxel, u)) plant(u);
  });
  while (!open.empty()) {
    const Index3 v = open.back();
    open.pop_back();
    for_each_neighbour(v, reach);
  }
  // What ends the region: candidates within two voxels on the plane of one that it grew through.
  for (const Index3& v : grown) {
    region.insert(v);
    const SurfacePlane plane = plane_at(map, v, min_weight);
    for (int dx = -2; dx <= 2; ++dx)
      for (int dy = -2; dy <= 2; ++dy)
        for (int dz = -2; dz <= 2; ++dz)
          if (const Index3 u{v.x + dx, v.y + dy, v.z + dz}; !region.contains(u) && is_candidate(u))
            if (lies_on(plane, dx, dy, dz, voxel_at(map, u, min_weight)->tsdf, float(map.voxel_size_m), 0.5f))
              region.insert(u);
  }
  return region;
}

/// Random surface voxels in random directions, some unobserved.
SurfaceTile random_tile(uint32_t seed, BlockMask& candidate, float band_m) {
  std::mt19937 rng(seed);
  std::normal_distribution<float> normal;
  Eigen::Vector3f n(normal(rng), normal(rng), normal(rng));
  n.normalize();
  const float noise = 0.002f * float(seed % 8), level = 0.02f * normal(rng);
  const unsigned hole_every = seed % 3 == 0 ? 1u << 30 : seed % 3 == 1 ? 200u : 8u;
  SurfaceTile tile;
  for (float& t : tile.tsdf) t = std::numeric_limits<float>::quiet_NaN();
  for (int x = -2; x < 10; ++x)
    for (int y = -2; y < 10; ++y)
      for (int z = -2; z < 10; ++z) {
        const float d = 0.02f * n.dot(Eigen::Vector3f(float(x) - 4, float(y) - 4, float(z) - 4)) - level;
        if (rng() % hole_every == 0) continue;
        const float t = std::clamp(d + noise * normal(rng), -0.08f, 0.08f);
        tile.tsdf[SurfaceTile::index(x, y, z)] = t;
        const bool inside = ((x | y | z) & ~7) == 0;
        if (inside && std::abs(t) <= band_m && rng() % 10 != 0) candidate.set(voxel_offset(x, y, z));
      }
  return tile;
}

}  // namespace

TEST_CASE("a connected region is what a flood voxel by voxel finds, for any number of threads and SIMD target") {
  size_t smallest = 1u << 30, largest = 0;
  for (uint32_t seed = 1; seed <= 4; ++seed) {
    const Map map = rough_corner(seed, 0.1 + 0.2 * (seed - 1));
    for (const double limit_deg : {8.0, 20.0, 45.0, 180.0}) {
      RegionSettings settings;
      settings.normal_change_deg = limit_deg;
      const Contact contact = find_contact(map, {-0.1, 0.02 * seed, 0}, settings);
      const std::set<Index3> expected = flooded(map, contact, settings);
      INFO("seed " << seed << ", " << limit_deg << " degrees, " << expected.size() << " voxels");
      smallest = std::min(smallest, expected.size());
      largest = std::max(largest, expected.size());
      on_every_simd_target([&](const std::string& target) {
        INFO(target);
        for (const int threads : {1, 2, 8}) {
          const tbb::global_control control(tbb::global_control::max_allowed_parallelism, size_t(threads));
          CHECK((voxels_of(find_region(map, contact, settings)) == expected));
        }
      });
    }
  }
  // The limits made a difference.
  INFO(smallest << " to " << largest << " voxels");
  CHECK(smallest < 3 * largest / 4);
  CHECK(largest > 2000);
}

TEST_CASE("interior voxels of a block are the same on every SIMD target") {
  int some = 0;
  for (uint32_t seed = 0; seed < 300; ++seed) {
    const float band_m = 0.02f, cos_limit = std::cos(float(5 + seed % 40) * 0.0174533f);
    BlockMask candidate;
    const SurfaceTile tile = random_tile(seed, candidate, band_m);
    const BlockMask expected = interior_voxels_scalar(tile, candidate, band_m, cos_limit);
    some += expected.any() && !(expected == candidate);
    on_every_simd_target([&](const std::string& target) {
      INFO("seed " << seed << ", " << target);
      REQUIRE((interior_voxels(tile, candidate, band_m, cos_limit) == expected));
    });
  }
  CHECK(some > 60);
}

TEST_CASE("a smoothed normal is exact for a plane, whatever is unobserved around the voxel, and less noisy otherwise") {
  std::mt19937 rng(3);
  std::normal_distribution<float> normal;
  double central = 0, smoothed = 0;
  for (int n = 0; n < 2000; ++n) {
    Eigen::Vector3f direction(normal(rng), normal(rng), normal(rng));
    direction.normalize();
    SurfaceTile exact, noisy;
    for (int i = 0; i < 27; ++i) {
      const Index3 d{i / 9 - 1, i / 3 % 3 - 1, i % 3 - 1};
      const float t = 0.02f * direction.dot(Eigen::Vector3f(float(d.x), float(d.y), float(d.z)));
      exact.tsdf[SurfaceTile::index(d.x, d.y, d.z)] = t;
      noisy.tsdf[SurfaceTile::index(d.x, d.y, d.z)] = t + 0.002f * normal(rng);
    }
    const int here = SurfaceTile::index(0, 0, 0);
    const auto off = [&](const SurfaceNormal& found) {
      return std::acos(std::min(1.0f, direction.dot(Eigen::Vector3f(found.x, found.y, found.z))));
    };
    CHECK(off(smoothed_normal(exact, here)) < 1e-3f);
    smoothed += off(smoothed_normal(noisy, here));
    const auto half = [&](int step) { return noisy.tsdf[here + step] - noisy.tsdf[here - step]; };
    const Eigen::Vector3f difference(half(SurfaceTile::kStepX), half(SurfaceTile::kStepY), half(1));
    central += std::acos(std::min(1.0f, direction.dot(difference.normalized())));
    // Up to six of the neighbours missing, but not both along an axis.
    for (int hole = 0; hole < 6; ++hole) {
      Index3 d{int(rng() % 3) - 1, int(rng() % 3) - 1, int(rng() % 3) - 1};
      if (d == Index3{}) continue;
      exact.tsdf[SurfaceTile::index(d.x, d.y, d.z)] = std::numeric_limits<float>::quiet_NaN();
    }
    CHECK(off(smoothed_normal(exact, here)) < 1e-3f);
  }
  CHECK(smoothed < 0.4 * central);
}
