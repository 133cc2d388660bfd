#include "mapping/regions/map_segments.h"

#include <tbb/global_control.h>

#include <catch2/catch.hpp>
#include <cmath>

#include "tests/support/labelled_map.h"

namespace felt::test {
namespace {

/// A table top 0.2 m above a floor and a wall behind both: floor z = 0, table |x|, |y| < 0.3 below z = 0.2, wall y =
/// 0.8.
double room_sdf(const Eigen::Vector3d& p) {
  const Eigen::Vector3d q = (p - Eigen::Vector3d(0, 0, 0.1)).cwiseAbs() - Eigen::Vector3d(0.3, 0.3, 0.1);
  const double box = q.cwiseMax(0.0).norm() + std::min(q.maxCoeff(), 0.0);
  return std::min({p.z(), box, 0.8 - p.y()});
}

const ClassTable kClasses = class_table({"floor", "table", "wall"});

int room_label(const Eigen::Vector3d& p) {
  if (p.y() > 0.77) return 2;
  return std::abs(p.x()) < 0.32 && std::abs(p.y()) < 0.32 && p.z() > 0.03 ? 1 : 0;
}

Map room() { return labelled_map(0.02, {-0.8, -0.8, -0.06}, {0.8, 0.86, 0.8}, room_sdf, kClasses, room_label); }

const Region& segment_at(const std::vector<Region>& segments, const Eigen::Vector3d& p) {
  const Index3 v{int32_t(std::lround(p.x() / 0.02)), int32_t(std::lround(p.y() / 0.02)),
                 int32_t(std::lround(p.z() / 0.02))};
  for (const Region& region : segments)
    if (region.contains(v)) return region;
  FAIL("no segment at " << p.transpose());
  return segments.front();
}

}  // namespace

TEST_CASE("a room falls into its surfaces, and every surface voxel belongs to one", "[segments]") {
  const Map map = room();
  const std::vector<Region> segments = map_segments(map);
  const Region &floor = segment_at(segments, {-0.6, -0.6, 0}), &top = segment_at(segments, {0, 0, 0.2}),
               &wall = segment_at(segments, {0, 0.8, 0.5}), &side = segment_at(segments, {0.3, 0, 0.1});
  CHECK(&floor == &segment_at(segments, {0.6, 0.6, 0}));
  CHECK(&wall == &segment_at(segments, {-0.7, 0.8, 0.1}));
  CHECK(&floor != &top);
  CHECK(&floor != &wall);
  CHECK(&side != &top);
  size_t covered = 0, surface = 0;
  for (const Region& region : segments) covered += region.voxels();
  for (const Block& block : map.store.blocks())
    for (int i = 0; i < kBlockVoxels; ++i)
      surface += block.geometry->weight[i] > 0 && std::abs(block.geometry->tsdf[i]) <= float(map.voxel_size_m);
  CHECK(covered == surface);
  for (size_t a = 0; a < segments.size(); ++a)
    for (size_t b = a + 1; b < segments.size(); ++b) REQUIRE(intersected(segments[a], segments[b]).empty());
}

TEST_CASE("a flat surface of two classes is two segments, or one where classes do not count", "[segments]") {
  const Map map = labelled_map(
      0.02, {-0.5, -0.5, -0.06}, {0.5, 0.5, 0.06}, [](const auto& p) { return p.z(); }, kClasses,
      [](const auto& p) { return p.x() < 0.09 ? 0 : 2; });
  CHECK(map_segments(map).size() == 2);
  MapSegmentSettings settings;
  settings.classes = false;
  CHECK(map_segments(map, settings).size() == 1);
}

TEST_CASE("a speck of another class goes to the surface around it", "[segments]") {
  const Map map = labelled_map(
      0.02, {-0.5, -0.5, -0.06}, {0.5, 0.5, 0.06}, [](const auto& p) { return p.z(); }, kClasses,
      [](const auto& p) { return p.norm() < 0.05 ? 1 : 0; });
  const std::vector<Region> segments = map_segments(map);
  REQUIRE(segments.size() == 1);
  CHECK(segments[0].contains({0, 0, 0}));
}

TEST_CASE("colour parts a surface where it is asked to", "[segments]") {
  Map map = labelled_map(
      0.02, {-0.5, -0.5, -0.06}, {0.5, 0.5, 0.06}, [](const auto& p) { return p.z(); }, kClasses,
      [](const auto&) { return 0; });
  for (uint32_t n = 0; n < map.store.size(); ++n) {
    Block& block = map.store[n];
    ColorPlanes& c = map.store.add_color(block);
    for (int i = 0; i < kBlockVoxels; ++i) {
      const bool left = first_voxel(block.coord).x + voxel_of_offset(i).x < 3;
      c.r[i] = uint16_t((left ? 200 : 90) * 256), c.g[i] = 100 * 256, c.b[i] = 100 * 256, c.count[i] = 4;
    }
  }
  CHECK(map_segments(map).size() == 1);
  MapSegmentSettings settings;
  settings.color_change = 12;
  CHECK(map_segments(map, settings).size() == 2);
}

TEST_CASE("map segments do not depend on the number of threads or the order of blocks", "[segments]") {
  const Map map = room();
  std::vector<Region> one;
  {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
    one = map_segments(map);
  }
  CHECK(one == map_segments(map));
  // The same room, its blocks made in another order.
  Map other(map.voxel_size_m, map.truncation_m);
  other.classes = map.classes;
  for (uint32_t n = uint32_t(map.store.size()); n-- > 0;) other.store.find_or_create(map.store[n].coord);
  for (const Block& block : map.store.blocks()) {
    Block& copy = other.store[other.store.find(block.coord)];
    *copy.geometry = *block.geometry;
    for (const EvidencePlane& e : block.evidence) {
      copy.evidence.push_back({e.slot, other.store.new_plane()});
      *copy.evidence.back().counts = *e.counts;
    }
  }
  CHECK(one == map_segments(other));
}

TEST_CASE("an empty map has no segments", "[segments]") { CHECK(map_segments(Map(0.02, 0.08)).empty()); }

}  // namespace felt::test
