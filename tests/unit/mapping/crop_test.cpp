#include "mapping/maps/crop.h"

#include <catch2/catch.hpp>

#include "tests/support/random_map.h"

namespace felt {
namespace {

constexpr double kVoxel = 0.1;

/// Two blocks side by side along x (voxels 0..15), every voxel observed, with colour, one class, even evidence and
/// instances.
Map two_blocks() {
  Map map(kVoxel, 4 * kVoxel);
  for (const int bx : {0, 1}) {
    Block& block = map.store[map.store.find_or_create({bx, 0, 0})];
    ColorPlanes& color = map.store.add_color(block);
    block.evidence.push_back({3, map.store.new_plane()});
    block.even_evidence = map.store.new_plane();
    InstancePlanes& instance = map.store.add_instance(block);
    for (int i = 0; i < kBlockVoxels; ++i) {
      block.geometry->tsdf[i] = float(i) * 1e-3f;
      block.geometry->weight[i] = float(bx + 1);
      color.r[i] = uint16_t(i), color.g[i] = 7, color.b[i] = 9, color.count[i] = 2;
      block.evidence[0].counts->value[i] = float(i);
      block.even_evidence->value[i] = float(i) / 8;
      instance.id[i] = uint16_t(i + 1), instance.votes[i] = uint16_t(i + 2);
    }
  }
  return map;
}

}  // namespace

TEST_CASE("a crop keeps every value of the voxels whose centres are inside and forgets the others") {
  const Map map = two_blocks();
  // Voxel centres 0.6, 0.7 | 0.8 lie inside along x.
  const Eigen::AlignedBox3d box(Eigen::Vector3d(0.55, 0, 0), Eigen::Vector3d(0.85, 0.35, 9));
  const Map part = cropped(map, voxels_in(map, box));
  REQUIRE(part.store.size() == 2);
  for (const Block& whole : map.store.blocks()) {
    const Block* kept = part.store.get(whole.coord);
    REQUIRE(kept != nullptr);
    for (int i = 0; i < kBlockVoxels; ++i) {
      const Index3 local = voxel_of_offset(i);
      const int x = whole.coord.x * 8 + local.x;
      if (x >= 6 && x <= 8 && local.y <= 3) {
        REQUIRE(kept->geometry->tsdf[i] == whole.geometry->tsdf[i]);
        REQUIRE(kept->geometry->weight[i] == whole.geometry->weight[i]);
        REQUIRE(kept->color->r[i] == whole.color->r[i]);
        REQUIRE(kept->color->count[i] == whole.color->count[i]);
        REQUIRE(kept->evidence.at(0).slot == 3);
        REQUIRE(kept->evidence[0].counts->value[i] == whole.evidence[0].counts->value[i]);
        REQUIRE(kept->even_evidence->value[i] == whole.even_evidence->value[i]);
        REQUIRE(kept->instance->id[i] == whole.instance->id[i]);
        REQUIRE(kept->instance->votes[i] == whole.instance->votes[i]);
      } else {
        REQUIRE(kept->geometry->weight[i] == 0);
        REQUIRE(kept->geometry->tsdf[i] == part.store.tsdf_background_m());
        REQUIRE(kept->color->count[i] == 0);
        REQUIRE(kept->evidence[0].counts->value[i] == 0);
        REQUIRE(kept->even_evidence->value[i] == 0);
        REQUIRE(kept->instance->id[i] == 0);
        REQUIRE(kept->instance->votes[i] == 0);
      }
    }
  }
  CHECK(active_voxel_count(part) == 3 * 4 * 8);
}

TEST_CASE("a crop to everything has the hash of the map, a crop to nothing has no blocks") {
  const Map map = two_blocks();
  CHECK(map_hash(cropped(map, voxels_in(map, observed_bounds(map)))) == map_hash(map));
  const Map random =
      test::random_map({.seed = 6, .blocks = 10, .classes = 3, .shared_evidence = true, .instances = true});
  CHECK(map_hash(cropped(random, voxels_in(random, observed_bounds(random)))) == map_hash(random));
  const Eigen::AlignedBox3d elsewhere(Eigen::Vector3d(5, 5, 5), Eigen::Vector3d(6, 6, 6));
  CHECK(cropped(map, voxels_in(map, elsewhere)).store.empty());
}

TEST_CASE("a box that is given in decimals holds the voxels on its bounds") {
  Map map(0.05, 0.2);
  const uint32_t number = map.store.find_or_create({0, 0, 0});
  for (int i = 0; i < kBlockVoxels; ++i) map.store[number].geometry->weight[i] = 1;
  // 3 * 0.05 and 7 * 0.05 are a little more than 0.15 and 0.35 in doubles.
  REQUIRE(3 * map.voxel_size_m > 0.15);
  const Region inside = voxels_in(map, {Eigen::Vector3d(0.05, 0.05, 0.05), Eigen::Vector3d(0.15, 0.35, 0.15)});
  CHECK(inside.voxels() == 3 * 7 * 3);
}

TEST_CASE("the bounds of a map are the outermost centres of observed voxels") {
  Map map = two_blocks();
  Block& second = map.store[map.store.find({1, 0, 0})];
  for (int i = 0; i < kBlockVoxels; ++i) second.geometry->weight[i] = voxel_of_offset(i).x == 2 ? 1.0f : 0.0f;
  const Eigen::AlignedBox3d bounds = observed_bounds(map);
  CHECK(bounds.min().norm() == Approx(0).margin(1e-12));
  CHECK(bounds.max().x() == Approx(10 * kVoxel));
  CHECK(bounds.max().y() == Approx(7 * kVoxel));
  CHECK(observed_bounds(Map(0.1, 0.4)).isEmpty());
}

}  // namespace felt
