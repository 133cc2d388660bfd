#include "mapping/store/region.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <map>
#include <numbers>
#include <random>
#include <set>

#include "mapping/regions/region_area.h"
#include "mapping/regions/region_query.h"
#include "tests/support/labelled_map.h"
#include "tests/support/region_voxels.h"

using namespace felt;
using namespace felt::test;

namespace {

Region random_region(uint32_t seed) {
  std::mt19937 rng(seed);
  std::set<BlockCoord> coords;
  for (int i = 0; i < 20; ++i) coords.insert({int(rng() % 3) - 1, int(rng() % 3) - 1, int(rng() % 3) - 1});
  Region region;
  for (const BlockCoord& c : coords) {
    BlockMask bits;
    for (int i = 0; i < 40; ++i) bits.set(int(rng() % 512));
    region.append(c, bits);
  }
  return region;
}

constexpr double kVoxel = 0.02;

/// Floor z = 0 and wall x = 1, meeting in a concave crease.
Map room_corner(const LabelAt& label) {
  return labelled_map(
      kVoxel, {-0.5, -0.5, -0.1}, {1.1, 0.5, 1.0}, [](const Eigen::Vector3d& p) { return std::min(p.z(), 1 - p.x()); },
      class_table({"floor", "wall", "rug"}), label);
}

}  // namespace

TEST_CASE("dilation of a block's bits reaches exactly the 26 neighbours, across block faces, edges and corners") {
  const Region region = random_region(1);
  for (size_t b = 0; b < region.blocks(); ++b) {
    Region one, grown;
    one.append(region.coord[b], region.mask[b]);
    const auto reached = dilated(region.mask[b]);
    std::set<Index3> expected, found;
    for (const Index3& v : voxels_of(one))
      for (int i = 0; i < 27; ++i) expected.insert({v.x + i / 9 - 1, v.y + i / 3 % 3 - 1, v.z + i % 3 - 1});
    for (int i = 0; i < 27; ++i) {
      Region part;
      const BlockCoord c = region.coord[b];
      if (reached[i].any()) part.append({c.x + i / 9 - 1, c.y + i / 3 % 3 - 1, c.z + i % 3 - 1}, reached[i]);
      found.merge(voxels_of(part));
    }
    CHECK(found == expected);
    CHECK(dilated_inside(region.mask[b]) == reached[13]);
  }
}

TEST_CASE("union, intersection and difference of regions are those of their voxel sets") {
  for (uint32_t seed = 0; seed < 10; ++seed) {
    const Region a = random_region(2 * seed), b = random_region(2 * seed + 1);
    const std::set<Index3> va = voxels_of(a), vb = voxels_of(b);
    std::set<Index3> either = va, both, only;
    either.insert(vb.begin(), vb.end());
    for (const Index3& v : va) (vb.contains(v) ? both : only).insert(v);
    CHECK(voxels_of(united(a, b)) == either);
    CHECK(voxels_of(intersected(a, b)) == both);
    CHECK(voxels_of(subtracted(a, b)) == only);
    CHECK(united(a, b).voxels() == either.size());
    for (const Index3& v : va) REQUIRE(a.contains(v));
    CHECK(subtracted(a, a).empty());
  }
}

TEST_CASE("a region stops at a crease between two surfaces of one class") {
  const Map map = room_corner([](const Eigen::Vector3d&) { return 0; });
  const RegionSettings settings;
  const Region floor = find_region(map, find_contact(map, {0.2, 0, 0.005}, settings), settings);
  const Region wall = find_region(map, find_contact(map, {1.01, 0, 0.5}, settings), settings);
  size_t floor_expected = 0;
  for (const Index3& v : voxels_of(floor)) {
    REQUIRE(std::abs(v.z) <= 1);
    REQUIRE(v.x <= 50);
  }
  for (const Index3& v : voxels_of(wall)) {
    REQUIRE(std::abs(v.x - 50) <= 1);
    REQUIRE(v.z >= 0);
  }
  // All of the floor belongs to it that is nearer to it than to the wall.
  for (int x = -25; x <= 48; ++x)
    for (int y = -25; y <= 25; ++y)
      for (int z = -1; z <= 1; ++z, ++floor_expected) REQUIRE(floor.contains({x, y, z}));
  CHECK(floor.voxels() >= floor_expected);
  // Only voxels of the crease itself, as near to one as to the other, belong to both.
  for (const Index3& v : voxels_of(intersected(floor, wall))) REQUIRE(v.z == 50 - v.x);
}

TEST_CASE("a crease stops every region whose limit is below half the angle by which the surface turns") {
  for (const double turn_deg : {44.0, 62.0, 90.0})
    for (const double shift : {0.0, 0.3, 0.5, 0.8}) {
      const double turn = turn_deg * std::numbers::pi / 180;
      const auto ramp = [&](const Eigen::Vector3d& p) {
        return (p.z() - 0.6 * shift * kVoxel) * std::cos(turn) - (p.x() - shift * kVoxel) * std::sin(turn);
      };
      const Map map = labelled_map(
          kVoxel, {-0.4, -0.2, -0.1}, {0.4, 0.2, 0.4},
          [&](const Eigen::Vector3d& p) { return std::min(p.z() - 0.6 * shift * kVoxel, ramp(p)); },
          class_table({"floor"}), [](const Eigen::Vector3d&) { return 0; });
      const auto reaches_ramp = [&](double limit_deg) {
        RegionSettings settings;
        settings.normal_change_deg = limit_deg;
        const Contact contact = find_contact(map, {-0.25, 0, 0}, settings);
        CHECK(normal_limit_deg(map, contact, settings) == limit_deg);
        const std::set<Index3> region = voxels_of(find_region(map, contact, settings));
        return std::any_of(region.begin(), region.end(), [](const Index3& v) { return v.z >= 5; });
      };
      INFO(turn_deg << " degrees, " << shift);
      CHECK_FALSE(reaches_ramp(turn_deg / 2 - 1));
      CHECK(reaches_ramp(turn_deg));
    }
}

TEST_CASE("the limit between normals grows with their noise, up to 30 degrees, and noisy surfaces stay whole") {
  std::mt19937 rng(1);
  std::normal_distribution<double> normal;
  double last_deg = 0;
  for (const double noise_voxels : {0.0, 0.1, 0.3, 0.6, 1.0}) {
    const Map map = labelled_map(
        kVoxel, {-0.5, -0.5, -0.2}, {0.5, 0.5, 0.2},
        [&](const Eigen::Vector3d& p) { return p.z() + noise_voxels * kVoxel * normal(rng); }, class_table({"floor"}),
        [](const Eigen::Vector3d&) { return 0; });
    RegionSettings settings;
    settings.snap_voxels = 1;
    const Contact contact = find_contact(map, {0, 0, 0}, settings);
    const double limit_deg = normal_limit_deg(map, contact, settings);
    INFO(noise_voxels << " voxels of noise: " << limit_deg << " degrees");
    CHECK(limit_deg >= last_deg);
    CHECK(limit_deg >= 20);
    CHECK(limit_deg <= 30);
    if (noise_voxels == 0) CHECK(limit_deg == 20);
    if (noise_voxels == 1) CHECK(limit_deg == 30);
    if (noise_voxels <= 0.3) CHECK(find_region(map, contact, settings).voxels() > 0.9 * 51 * 51 * 2);
    last_deg = limit_deg;
    settings.normal_change_deg = 50;
    CHECK(normal_limit_deg(map, contact, settings) == 50);
  }
}

TEST_CASE("the normal around a contact is that of the plane, noise or not, and a wall beside it does not turn it") {
  std::mt19937 rng(2);
  std::normal_distribution<double> noise;
  const Eigen::Vector3d tilted = Eigen::Vector3d(0.1, -0.05, 1).normalized();
  for (const double noise_voxels : {0.0, 0.3}) {
    const Map map = labelled_map(
        kVoxel, {-0.5, -0.5, -0.3}, {0.5, 0.5, 0.3},
        [&](const Eigen::Vector3d& p) { return tilted.dot(p) + noise_voxels * kVoxel * noise(rng); },
        class_table({"floor"}), [](const Eigen::Vector3d&) { return 0; });
    double worst_single = 0;
    for (const double x : {-0.2, 0.0, 0.2}) {
      const Eigen::Vector3d at = Eigen::Vector3d(x, 0.1, 0) - tilted.dot(Eigen::Vector3d(x, 0.1, 0)) * tilted;
      const Contact contact = find_contact(map, at, {});
      const FittedNormal fitted = surrounding_normal(map, contact, {});
      const double off = std::acos(std::min(1.0, fitted.normal.dot(tilted)));
      INFO(noise_voxels << " voxels of noise at " << x << ": off by " << off << ", said to be " << fitted.sd_rad);
      CHECK(off <= 4 * fitted.sd_rad + 1e-3);
      CHECK(fitted.sd_rad < 0.02);
      worst_single = std::max(worst_single, std::acos(std::min(1.0, contact.normal.dot(tilted))));
    }
    if (noise_voxels > 0) CHECK(worst_single > 0.03);  // a voxel's own
  }
  const Map corner = labelled_map(
      kVoxel, {-0.5, -0.5, -0.3}, {0.5, 0.5, 0.6},
      [](const Eigen::Vector3d& p) { return std::min(p.z(), 0.1 - p.x()); }, class_table({"floor"}),
      [](const Eigen::Vector3d&) { return 0; });
  CHECK(surrounding_normal(corner, find_contact(corner, {0, 0, 0}, {}), {}).normal.z() > 0.999);
}

TEST_CASE("a region stops at the border of another class and passes voxels with little contrary evidence") {
  Map map = room_corner([](const Eigen::Vector3d& p) { return p.z() > 0.1 ? 1 : p.x() < 0 ? 2 : 0; });
  add_evidence(map, {20, 3, 0}, 1, 3);
  const RegionSettings settings;
  const Region floor = find_region(map, find_contact(map, {0.2, 0, 0}, settings), settings);
  for (const Index3& v : voxels_of(floor)) REQUIRE(v.x >= 0);
  CHECK(floor.contains({0, 0, 0}));
  CHECK(floor.contains({20, 3, 0}));
  add_evidence(map, {20, 3, 0}, 1, 30);
  CHECK_FALSE(find_region(map, find_contact(map, {0.2, 0, 0}, settings), settings).contains({20, 3, 0}));
}

TEST_CASE("a curved surface is one region and a neck of band voxels connects diagonally") {
  const Map ball = labelled_map(
      kVoxel, {-0.4, -0.4, -0.4}, {0.4, 0.4, 0.4}, [](const Eigen::Vector3d& p) { return p.norm() - 0.3; },
      class_table({"ball"}), [](const Eigen::Vector3d&) { return 0; });
  const RegionSettings settings;
  const Contact top = find_contact(ball, {0, 0, 0.31}, settings);
  CHECK(top.normal.z() == Approx(1).margin(1e-3));
  CHECK(top.surface_m.norm() == Approx(0.3).margin(1e-3));
  const Region region = find_region(ball, top, settings);
  CHECK(region.contains({0, 0, -15}));
  size_t band = 0;
  for (const Block& b : ball.store.blocks())
    for (int i = 0; i < 512; ++i) band += b.geometry->weight[i] > 0 && std::abs(b.geometry->tsdf[i]) <= float(kVoxel);
  CHECK(region.voxels() == band);
}

TEST_CASE("the geodesic radius is measured along the surface, the sphere's through space") {
  // A sheet folded back: z = 0 and z = 0.2 joined far away by nothing, so only the sphere reaches the upper one.
  const Map map = labelled_map(
      kVoxel, {-0.6, -0.6, -0.1}, {0.6, 0.6, 0.3},
      [](const Eigen::Vector3d& p) { return p.z() < 0.1 ? p.z() : 0.2 - p.z(); }, class_table({"sheet"}),
      [](const Eigen::Vector3d&) { return 0; });
  RegionSettings settings;
  settings.radius_m = 0.3;
  const Contact contact = find_contact(map, {0, 0, 0}, settings);
  const Region geodesic = find_region(map, contact, settings);
  CHECK(geodesic.contains({15, 0, 0}));
  CHECK_FALSE(geodesic.contains({16, 0, 0}));
  CHECK_FALSE(geodesic.contains({0, 0, 10}));
  // Along the worst direction 26-neighbour steps overestimate a straight line by 8 %.
  for (const Index3& v : voxels_of(geodesic)) REQUIRE(std::hypot(v.x, v.y) <= 15.0 + 1e-6);
  CHECK(geodesic.contains({12, 6, 0}));
  settings.rule = RegionRule::sphere;
  const Region sphere = find_region(map, contact, settings);
  CHECK(sphere.contains({0, 0, 10}));
  CHECK(sphere.contains({15, 0, 0}));
  CHECK_FALSE(sphere.contains({15, 1, 0}));
}

TEST_CASE("a colour limit keeps to the colour of the contact") {
  Map map = room_corner([](const Eigen::Vector3d&) { return 0; });
  for (Block& block : map.store.blocks()) {
    ColorPlanes& color = map.store.add_color(block);
    for (int i = 0; i < 512; ++i) {
      const bool dark = first_voxel(block.coord).x + voxel_of_offset(i).x < 10;
      color.r[i] = color.g[i] = color.b[i] = uint16_t((dark ? 40 : 90) * 256);
      color.count[i] = 1;
    }
  }
  RegionSettings settings;
  settings.color_change = 20;
  const Region region = find_region(map, find_contact(map, {0, 0, 0}, settings), settings);
  CHECK(region.contains({9, 0, 0}));
  CHECK_FALSE(region.contains({10, 0, 0}));
  settings.color_change = 60;
  CHECK(find_region(map, find_contact(map, {0, 0, 0}, settings), settings).contains({10, 0, 0}));
}

TEST_CASE("an image mask selects what it sees and nothing behind it") {
  // A shelf at z = 0.5 above the floor, seen from above.
  const Map map = labelled_map(
      kVoxel, {-0.5, -0.5, -0.1}, {0.5, 0.5, 0.6},
      [](const Eigen::Vector3d& p) {
        const double shelf = std::max({std::abs(p.z() - 0.45) - 0.05, std::abs(p.x()) - 0.1, std::abs(p.y()) - 0.1});
        return std::min(p.z(), shelf);
      },
      class_table({"floor"}), [](const Eigen::Vector3d&) { return 0; });
  ViewMask view;
  view.camera = {100, 100, 50, 50, 101, 101};
  view.mask = Image<uint8_t>(101, 101, 1);
  view.T_world_camera.linear() = Eigen::Vector3d(1, -1, -1).asDiagonal();
  view.T_world_camera.translation() = Eigen::Vector3d(0, 0, 1.5);
  const RegionSettings settings;
  const Region seen = find_region(map, view, settings, nullptr);
  CHECK(seen.contains({0, 0, 25}));
  CHECK_FALSE(seen.contains({0, 0, 0}));
  CHECK(seen.contains({20, 0, 0}));
  // A radius bounds it around the contact.
  RegionSettings near = settings;
  near.radius_m = 0.15;
  const Contact beside = find_contact(map, {0.3, 0, 0}, settings);
  const Region part = find_region(map, view, near, &beside);
  CHECK(part.contains(beside.voxel));
  CHECK(part.voxels() < find_region(map, view, settings, &beside).voxels() / 2);
  CHECK_FALSE(part.contains({0, 0, 25}));
  for (int v = 0; v < 101; ++v)
    for (int u = 0; u < 50; ++u) view.mask(u, v) = 0;
  CHECK_FALSE(find_region(map, view, settings, nullptr).contains({-20, 0, 0}));
  const Contact contact = find_contact(map, {-0.4, 0, 0}, settings);
  CHECK_THROWS_WITH(find_region(map, view, settings, &contact), Catch::Contains("outside"));
  view.mask = Image<uint8_t>(100, 101, 1);
  CHECK_THROWS_WITH(find_region(map, view, settings, nullptr), Catch::Contains("expected 101 x 101, found 100 x 101"));
}

TEST_CASE("a contact that meets no labelled surface says what is there instead") {
  const Map map = room_corner([](const Eigen::Vector3d& p) { return p.x() < 0.5 ? 0 : -1; });
  RegionSettings settings;
  settings.snap_voxels = 2;
  const auto at = [&](double x, double y, double z) { return find_contact(map, {x, y, z}, settings); };
  CHECK_THROWS_WITH(at(0, 0, 0.07), Catch::Contains("free space"));
  CHECK_THROWS_WITH(at(0, 0, -0.07), Catch::Contains("inside"));
  CHECK_THROWS_WITH(at(0, 0, 0.5), Catch::Contains("unobserved"));
  CHECK_THROWS_WITH(at(0, 0, 50), Catch::Contains("outside the map"));
  CHECK_THROWS_WITH(at(0.8, 0, 0), Catch::Contains("without labels"));
  CHECK_THROWS_WITH(at(NAN, 0, 0), Catch::Contains("finite"));
  CHECK_THROWS_WITH(at(1e300, 0, 0), Catch::Contains("finite"));
  CHECK(at(0, 0, 0.03).distance_m == Approx(0.03).margin(1e-4));
}

TEST_CASE("unusable region settings are named all at once") {
  RegionSettings settings;
  settings.rule = RegionRule::sphere;
  settings.band_voxels = 0;
  settings.class_ratio = NAN;
  CHECK_THROWS_WITH(validate(settings), Catch::Contains("band_voxels") && Catch::Contains("class_ratio") &&
                                            Catch::Contains("finite radius"));
}

TEST_CASE("area does not depend on how a surface lies to the grid, nor on what distance is measured along") {
  // A square of 1 m, tilted and shifted against the grid; distances rise by `steepness` along the normal.
  for (const double steepness : {1.0, 1.9})
    for (const double tilt : {0.0, 0.3, 0.7})
      for (const double shift_m : {0.0, 0.003, 0.0099}) {
        INFO("steepness " << steepness << ", tilt " << tilt << ", shift " << shift_m);
        const Eigen::AngleAxisd turn(tilt, Eigen::Vector3d(1, 2, 0).normalized());
        const Eigen::Matrix3d to_plane = turn.toRotationMatrix().transpose();
        const auto within = [&](const Eigen::Vector3d& p) {
          const Eigen::Vector3d q = to_plane * p;
          return std::abs(q.x()) < 0.5 && std::abs(q.y()) < 0.5;
        };
        const Map map = labelled_map(
            kVoxel, {-0.9, -0.9, -0.7}, {0.9, 0.9, 0.7},
            [&](const Eigen::Vector3d& p) { return steepness * ((to_plane * p).z() - shift_m); },
            class_table({"floor"}), [&](const Eigen::Vector3d& p) { return within(p) ? 0 : -1; });
        RegionSettings settings;
        settings.band_voxels = 1;
        std::map<BlockCoord, BlockMask> bits;
        for (const Block& block : map.store.blocks())
          for (int i = 0; i < kBlockVoxels; ++i) {
            const Index3 v = voxel_at(block.coord, i);
            if (std::abs(double(block.geometry->tsdf[i])) <= settings.band_voxels * kVoxel &&
                within(kVoxel * Eigen::Vector3d(v.x, v.y, v.z)))
              bits[block.coord].set(i);
          }
        Region square;
        for (const auto& [coord, mask] : bits) square.append(coord, mask);
        CHECK(surface_area_m2(map, square, settings) == Approx(1).epsilon(0.05));
      }
}

TEST_CASE("a region's summary gives its area, extent and classes") {
  const Map map = room_corner([](const Eigen::Vector3d& p) { return p.z() > 0.1 ? 1 : p.y() < -0.4 ? 2 : 0; });
  RegionSettings settings;
  settings.class_ratio = 0;
  const Region region = find_region(map, find_contact(map, {0.2, 0, 0}, settings), settings);
  const RegionSummary summary = summarize(map, region, settings);
  CHECK(summary.voxels == region.voxels());
  // 1.5 m x 1 m of floor.
  CHECK(summary.area_m2 == Approx(1.5).epsilon(0.04));
  CHECK(summary.min_m.z() == Approx(-0.02));
  CHECK(summary.max_m.z() == Approx(0.02));
  CHECK(summary.min_m.x() == Approx(-0.5));
  CHECK(summary.class_voxels[1] == 0);
  CHECK(summary.mixed_fraction == Approx(0.1).margin(0.02));
  CHECK(summary.unlabelled_voxels == 0);
  CHECK(summary.class_voxels[0] > summary.class_voxels[2]);
  CHECK(summary.necks == 0);
  CHECK(summary.open_boundary_fraction > 0.5);
}

TEST_CASE("two rooms that a narrow bridge joins are reported as a neck") {
  const auto floor = [](const Eigen::Vector3d& p) {
    const bool here = std::abs(p.y()) < 0.035 || std::abs(p.x()) > 0.2;
    return here ? p.z() + 0.01 : 1.0;
  };
  const Map map = labelled_map(kVoxel, {-0.7, -0.4, -0.1}, {0.7, 0.4, 0.1}, floor, class_table({"floor"}),
                               [](const Eigen::Vector3d&) { return 0; });
  const RegionSettings settings;
  const Region region = find_region(map, find_contact(map, {0.4, 0, 0}, settings), settings);
  REQUIRE(region.contains({-20, 0, 0}));
  CHECK(summarize(map, region, settings).necks == 1);
}

TEST_CASE("the class limit of a region is a ratio of beliefs, whatever the prior") {
  // Forty classes of prior 8/40: one observation of 0.8 is four times the prior.
  std::vector<std::string> names;
  for (int c = 0; c < 40; ++c) names.push_back("class " + std::to_string(c));
  const Map map = labelled_map(
      kVoxel, {-0.4, -0.4, -0.1}, {0.4, 0.4, 0.1}, [](const Eigen::Vector3d& p) { return p.z(); }, class_table(names),
      [](const Eigen::Vector3d& p) { return p.x() < 0 ? 0 : 1; }, 0.8f);
  const auto farthest = [&](double ratio) {
    RegionSettings settings;
    settings.class_ratio = ratio;
    const Region region = find_region(map, find_contact(map, {-0.2, 0, 0}, settings), settings);
    int x = -100;
    for (const Index3& v : voxels_of(region)) x = std::max(x, v.x);
    return x;
  };
  // On the other side: 0.2 against 1.
  CHECK(farthest(0.5) < 0);
  CHECK(farthest(0.21) < 0);
  CHECK(farthest(0.19) > 10);
}

TEST_CASE("a surface observed too little to be touched is said to be one") {
  const Map map = room_corner([](const Eigen::Vector3d&) { return 0; });
  RegionSettings settings;
  settings.min_weight = 6;  // the map's weights are 5
  CHECK_THROWS_WITH(find_contact(map, {0, 0, 0}, settings), Catch::Contains("found surface of weight 5, least 6"));
}
