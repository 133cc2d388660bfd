#include <tbb/global_control.h>

#include <hwy/targets.h>
#include <bit>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <map>
#include <set>

#include "io/map_file/map_file.h"
#include "io/simulation/render_sequence.h"
#include "mapping/fusion/block_allocation.h"
#include "mapping/fusion/survey_kernels.h"
#include "mapping/fusion/tsdf_integrator.h"
#include "mapping/surface/marching_cubes.h"
#include "tests/support/data.h"
#include "tests/support/views.h"

using namespace felt;
using felt::test::ball_before_wall;
using felt::test::jittered_pose;
using felt::test::Random;

namespace {

IntegrationConfig some_config(int variant) {
  IntegrationConfig config;
  config.distance = DistanceModel(variant % 3);
  config.weight = WeightModel(variant / 3 % 3);
  config.carve = variant / 9 % 2 == 1;
  config.max_weight = 3;  // so that the cap takes part
  return config;
}

Map fused(int frames, const IntegrationConfig& config, double voxel_size_m = 0.02) {
  Map map(voxel_size_m, 4 * voxel_size_m);
  IntegrationScratch scratch;
  Random random(5);
  for (int n = 0; n < frames; ++n) integrate(map, ball_before_wall(jittered_pose(random)), config, scratch);
  return map;
}

/// Salts a depth image with everything that recorded depth may hold.
void corrupt(DepthImage& depth, Random& random) {
  const float bad[] = {0, -1, std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), 1e30f};
  for (float& d : depth)
    if (random() < 0.1) d = bad[int(random() * 5)];
}

}  // namespace

TEST_CASE("every SIMD target fuses the scalar version's bits") {
  for (int variant = 0; variant < 18; ++variant) {
    const IntegrationConfig config = some_config(variant);
    Random random(uint64_t(variant) + 1);
    Frame frame = ball_before_wall(jittered_pose(random), 161, 119);
    corrupt(frame.depth_m, random);
    for (Rgba8& pixel : frame.color) pixel.a = random() < 0.1 ? 0 : 255;
    std::vector<float> scale;
    if (config.distance == DistanceModel::tangent_plane)
      for (size_t i = 0; i < frame.depth_m.size(); ++i) scale.push_back(random() < 0.1 ? 0.0f : float(random()));
    const Map map(0.02, 0.08);
    const DepthView view = depth_view(frame, config, map, scale.empty() ? nullptr : scale.data());
    std::vector<float> noisy(frame.depth_m.size());
    for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
      hwy::SetSupportedTargetsForTest(target);
      size_t observed = 0;
      for (int block = 0; block < 200; ++block) {
        const BlockCoord coord{int(random.between(-4, 4)), int(random.between(-4, 4)), int(random.between(4, 14))};
        BlockObservation expected, found;
        const bool any = observe_block_scalar(coord, view, expected);
        CAPTURE(target, variant);
        REQUIRE(observe_block(coord, view, found) == any);
        REQUIRE(std::memcmp(expected.valid, found.valid, sizeof found.valid) == 0);
        GeometryPlanes planes, planes_scalar;
        ColorPlanes color, color_scalar;
        for (int i = 0; i < kBlockVoxels; ++i) {
          planes.tsdf[i] = float(random.between(-.08, .08)), planes.weight[i] = float(int(random() * 4));
          color.r[i] = color.g[i] = color.b[i] = uint16_t(random() * 65280), color.count[i] = uint16_t(random() * 256);
          if ((found.valid[i >> 3] >> (i & 7) & 1) == 0) continue;
          ++observed;
          REQUIRE(expected.sdf_m[i] == found.sdf_m[i]);
          REQUIRE(expected.weight[i] == found.weight[i]);
          REQUIRE(expected.pixel[i] == found.pixel[i]);
          REQUIRE(found.weight[i] > 0);
        }
        planes_scalar = planes, color_scalar = color;
        fuse_tsdf_scalar(expected, view.max_weight, planes_scalar);
        fuse_tsdf(found, view.max_weight, planes);
        REQUIRE(std::memcmp(&planes, &planes_scalar, sizeof planes) == 0);
        const auto* rgba = reinterpret_cast<const uint32_t*>(frame.color.data());
        fuse_color_scalar(expected, rgba, 0.05f, color_scalar);
        fuse_color(found, rgba, 0.05f, color);
        REQUIRE(std::memcmp(&color, &color_scalar, sizeof color) == 0);
      }
      REQUIRE(observed > 1000);
    }
    hwy::SetSupportedTargetsForTest(0);
  }
}

TEST_CASE("every SIMD target marks the scalar version's cells, slopes and ranges of depth") {
  Random random(3);
  Frame frame = ball_before_wall(jittered_pose(random), 161, 119);
  corrupt(frame.depth_m, random);
  for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    const float offsets[] = {-0.08f, 0, 0.08f};
    const AllocationView view{.origin = {8, 8, 1},
                              .ray0 = {-3, -2, 6},
                              .ray_u = {.04f, 0, 0},
                              .ray_v = {0, .04f, 0},
                              .cells = {16, 14, 13},
                              .offsets_m = offsets,
                              .samples = 3};
    constexpr size_t kCells = 16 * 14 * 13;
    std::vector<uint8_t> marked(kCells + 1), marked_scalar(kCells + 1);
    for (int v = 0; v < 119; ++v) {
      RowSamples row;
      row.count = v % 41;
      for (int i = 0; i < row.count; ++i) {
        row.u[i] = float(int(random() * 161));
        row.depth_m[i] = frame.depth_m(int(row.u[i]), v);
        if (!(row.depth_m[i] > 0 && row.depth_m[i] < 4)) row.depth_m[i] = 1;
      }
      mark_cells_scalar(view, v, row, marked_scalar.data());
      mark_cells(view, v, row, marked.data());
    }
    marked.back() = marked_scalar.back();  // the spare cell is nobody's
    REQUIRE(marked == marked_scalar);
    REQUIRE(std::count(marked.begin(), marked.end(), 1) > 20);

    constexpr int kColumns = 21, kRows = 15;
    std::vector<DepthRange> ranges(kColumns * kRows), ranges_scalar(kColumns * kRows);
    for (int row = 0; row < kRows; ++row) {
      tile_range_row_scalar(frame.depth_m.data(), 161, 119, row, 0.1f, 4, &ranges_scalar[row * kColumns]);
      tile_range_row(frame.depth_m.data(), 161, 119, row, 0.1f, 4, &ranges[row * kColumns]);
    }
    REQUIRE(std::memcmp(ranges.data(), ranges_scalar.data(), ranges.size() * sizeof ranges[0]) == 0);
    std::vector<DepthRange> spread(kColumns - 2), spread_scalar(kColumns - 2);
    spread_range_row_scalar(ranges.data(), kColumns, spread_scalar.data(), kColumns - 2);
    spread_range_row(ranges.data(), kColumns, spread.data(), kColumns - 2);
    REQUIRE(std::memcmp(spread.data(), spread_scalar.data(), spread.size() * sizeof spread[0]) == 0);

    const SlopeView slopes{.depth_m = frame.depth_m.data(),
                           .width = 161,
                           .height = 119,
                           .fx = 144,
                           .fy = 150,
                           .cx = 80,
                           .cy = 59,
                           .max_depth_m = 4,
                           .max_step = 0.04f};
    std::vector<float> expected(161), found(161);
    for (int v = 0; v < 119; ++v) {
      tangent_scale_row_scalar(slopes, v, expected.data());
      tangent_scale_row(slopes, v, found.data());
      REQUIRE(found == expected);
    }
  }
  hwy::SetSupportedTargetsForTest(0);
}

TEST_CASE("cubes out of the band hold no observed voxel, on every SIMD target") {
  Random random(11);
  size_t dropped = 0, observed = 0;
  for (int variant = 0; variant < 6; ++variant) {
    IntegrationConfig config;
    config.carve = variant == 5;
    const bool small = variant % 2 == 1;
    Frame frame = ball_before_wall(jittered_pose(random), small ? 97 : 320, small ? 61 : 240);
    corrupt(frame.depth_m, random);
    const double voxel_m = variant < 2 ? 0.01 : variant < 4 ? 0.02 : 0.05;
    Map map(voxel_m, 4 * voxel_m);
    AllocationScratch scratch;
    blocks_in_view(frame.depth_m, frame.camera, frame.T_world_camera, voxel_m, map.truncation_m, config.min_depth_m,
                   config.max_depth_m, scratch);
    const DepthView view = depth_view(frame, config, map, nullptr, &scratch.tiles);
    const double reach = 0.5 / (voxel_m * kBlockDim);
    for (int block = 0; block < 1000; ++block) {
      // In front of the camera, beside it and around it.
      const BlockCoord coord{int(random.between(-2, 2) * reach), int(random.between(-2, 2) * reach),
                             int(random.between(-1, 5) * reach)};
      const uint64_t cubes = cubes_in_band_scalar(coord, view);
      BlockObservation all, some;
      observe_block_scalar(coord, view, all);
      const bool any = observe_block_scalar(coord, view, some, cubes);
      REQUIRE(std::memcmp(all.valid, some.valid, sizeof all.valid) == 0);
      for (int i = 0; i < kBlockVoxels; ++i) {
        if ((all.valid[i >> 3] >> (i & 7) & 1) == 0) continue;
        const Index3 at = voxel_of_offset(i);
        REQUIRE((cubes >> (at.x / 2 << 4 | at.y / 2 << 2 | at.z / 2) & 1) == 1);
        ++observed;
      }
      dropped += size_t(64 - std::popcount(cubes));
      for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
        hwy::SetSupportedTargetsForTest(target);
        REQUIRE(cubes_in_band(coord, view) == cubes);
        BlockObservation found;
        REQUIRE(observe_block(coord, view, found, cubes) == any);
        REQUIRE(std::memcmp(found.valid, some.valid, sizeof some.valid) == 0);
      }
      hwy::SetSupportedTargetsForTest(0);
    }
  }
  CHECK(observed > 50000);
  CHECK(dropped > 6 * 1000 * 64 / 2);  // they are worth asking for
}

TEST_CASE("the map does not depend on the number of threads") {
  for (const int variant : {0, 4, 17}) {
    std::set<std::string> hashes;
    for (const int threads : {1, 2, 3, 8}) {
      const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, size_t(threads));
      hashes.insert(map_hash(fused(4, some_config(variant))));
    }
    CHECK(hashes.size() == 1);
  }
}

TEST_CASE("shifting scene and cameras by whole blocks shifts the map") {
  // Voxel size and shift are powers of two, so that the shifted poses are exact.
  const double voxel = 1.0 / 64;
  const Index3 shift{8, -24, 16};  // whole blocks: allocation samples blocks, so their edges matter
  Map here(voxel, 4 * voxel), there(voxel, 4 * voxel);
  IntegrationScratch scratch;
  Random random(9);
  for (int n = 0; n < 3; ++n) {
    Frame frame = ball_before_wall(jittered_pose(random));
    integrate(here, frame, {}, scratch);
    frame.T_world_camera.pretranslate(Eigen::Vector3d(shift.x, shift.y, shift.z) * voxel);
    integrate(there, frame, {}, scratch);
  }
  size_t compared = 0, different = 0, rounded = 0;
  double largest = 0;
  for (const Block& block : here.store.blocks())
    for (int i = 0; i < kBlockVoxels; ++i) {
      if (block.geometry->weight[i] == 0) continue;
      const Index3 at = first_voxel(block.coord), in = voxel_of_offset(i);
      const Index3 moved{at.x + in.x + shift.x, at.y + in.y + shift.y, at.z + in.z + shift.z};
      const Block* other = there.store.get(block_of_voxel(moved));
      ++compared;
      const int at_moved = offset_in_block(moved);
      if (other == nullptr || std::abs(other->geometry->weight[at_moved] - block.geometry->weight[i]) > 1e-3f) {
        ++different;  // a pixel boundary or the truncation crossed by a rounding
        continue;
      }
      const double difference = std::abs(other->geometry->tsdf[at_moved] - block.geometry->tsdf[i]);
      largest = std::max(largest, difference);
      rounded += difference >= 1e-5;
    }
  REQUIRE(compared > 50000);
  CHECK(different < compared / 10000);
  CHECK(rounded < compared / 1000);
  CHECK(largest < 0.02);
}

TEST_CASE("fusion equals a naive loop over every voxel of the box around the scene, however it measures and weighs") {
  const auto weight_at = [](WeightModel model, double depth_m) {
    const auto sigma_m = [](double d) { return 0.0012 + 0.0019 * (d - 0.4) * (d - 0.4); };
    if (model == WeightModel::inverse_square) return 1 / (depth_m * depth_m);
    if (model == WeightModel::sensor_noise) return std::pow(sigma_m(1) / sigma_m(depth_m), 2);
    return 1.0;
  };
  for (const DistanceModel distance : {DistanceModel::ray, DistanceModel::optical_axis})
    for (const WeightModel weight : {WeightModel::constant, WeightModel::inverse_square, WeightModel::sensor_noise}) {
      IntegrationConfig config;
      config.distance = distance, config.weight = weight;
      config.dropoff_start_vox = float(1 + 0.5 * int(weight));
      Map map(0.03, 0.12);
      const double dropoff_start_m = double(config.dropoff_start_vox) * map.voxel_size_m;
      IntegrationScratch scratch;
      Random random(2);
      std::map<Index3, std::pair<double, double>> naive;  // sum of w * sdf, sum of w
      for (int n = 0; n < 2; ++n) {
        const Frame frame = ball_before_wall(jittered_pose(random));
        integrate(map, frame, config, scratch);
        const Eigen::Isometry3d T_camera_world = frame.T_world_camera.inverse();
        for (int x = -60; x < 60; ++x)
          for (int y = -60; y < 60; ++y)
            for (int z = 20; z < 80; ++z) {
              const Eigen::Vector3d p = T_camera_world * (Eigen::Vector3d(x, y, z) * map.voxel_size_m);
              if (p.z() <= 0) continue;
              const Eigen::Vector2d pixel = frame.camera.project(p);
              const double u = std::floor(pixel.x() + 0.5), v = std::floor(pixel.y() + 0.5);
              if (u < 0 || v < 0 || u >= frame.camera.width || v >= frame.camera.height) continue;
              const double d = frame.depth_m(int(u), int(v));
              const double sdf = (d - p.z()) * (distance == DistanceModel::ray ? p.norm() / p.z() : 1.0);
              if (d < config.min_depth_m || d > config.max_depth_m || std::abs(sdf) >= map.truncation_m) continue;
              double w = weight_at(weight, d);
              if (sdf < -dropoff_start_m) w *= (sdf + map.truncation_m) / (map.truncation_m - dropoff_start_m);
              auto& [sum, weights] = naive[{x, y, z}];
              sum += w * sdf, weights += w;
            }
      }
      size_t agree = 0, missing = 0, extra = active_voxel_count(map);
      for (const auto& [voxel, value] : naive) {
        const Block* block = map.store.get(block_of_voxel(voxel));
        const int at = offset_in_block(voxel);
        if (block == nullptr || block->geometry->weight[at] == 0) {
          ++missing;
          continue;
        }
        --extra;
        const double expected = value.first / value.second;
        agree += std::abs(block->geometry->tsdf[at] - expected) < 1e-4 &&
                 std::abs(block->geometry->weight[at] - value.second) < 1e-3;
      }
      CAPTURE(int(distance), int(weight), naive.size(), agree, missing, extra);
      CHECK(naive.size() > 20000);
      // Voxels whose projection falls within a float rounding of a pixel's edge may take the neighbouring pixel;
      // blocks grazed by a corner of the band are not allocated.
      CHECK(agree > 0.995 * double(naive.size() - missing));
      CHECK(missing < 0.001 * double(naive.size()));
      CHECK(extra < 0.001 * double(naive.size()));
    }
}

TEST_CASE("the distance to the tangent plane is that to a slanted plane, whatever the angle of view") {
  // z = 2 m + x: 45 degrees to the optical axis. Along the ray it is up to twice as far.
  Frame frame = ball_before_wall(Eigen::Isometry3d::Identity());
  for (int v = 0; v < frame.camera.height; ++v)
    for (int u = 0; u < frame.camera.width; ++u) frame.depth_m(u, v) = float(2 / (1 - frame.camera.ray(u, v).x()));
  const Eigen::Vector3d normal = Eigen::Vector3d(1, 0, -1).normalized(), on_plane(0, 0, 2);
  IntegrationConfig config;
  config.distance = DistanceModel::tangent_plane;
  Map map(0.02, 0.08);
  IntegrationScratch scratch;
  integrate(map, frame, config, scratch);
  size_t observed = 0;
  double largest_px = 0;
  for (const Block& block : map.store.blocks())
    for (int i = 0; i < kBlockVoxels; ++i) {
      if (block.geometry->weight[i] == 0) continue;
      const Index3 voxel = voxel_at(block.coord, i);
      const Eigen::Vector3d p = Eigen::Vector3d(voxel.x, voxel.y, voxel.z) * map.voxel_size_m;
      const double error_m = std::abs(double(block.geometry->tsdf[i]) - normal.dot(p - on_plane));
      largest_px = std::max(largest_px, error_m * frame.camera.fx / p.z());
      ++observed;
    }
  CHECK(observed > 20000);
  // A voxel takes the depth of a pixel up to half a pixel beside it, of which the plane's slope leaves sin(45 degrees).
  CHECK(largest_px < 0.36);
  CHECK(largest_px > 0.3);
}

TEST_CASE("with exact depth the mesh lies within a tenth of a voxel of the surface") {
  Primitive ball;
  ball.shape = ShapeKind::sphere, ball.half_size_m.setConstant(0.4), ball.instance = 1;
  Scene scene;
  scene.primitives = {ball};
  Map map(0.02, 0.08);
  IntegrationScratch scratch;
  RenderOptions depth_only;
  depth_only.with_color = false;
  const Trajectory around = orbit({0, 0, 0}, 1.2, 0.5, 2 * M_PI, 12);
  for (const Frame& frame : render_sequence(scene, around, simulated_camera(320, 240), depth_only))
    integrate(map, frame, {}, scratch);
  double sum = 0;
  const TriangleMesh mesh = extract_mesh(map);
  for (const Eigen::Vector3f& p : mesh.positions) sum += std::abs(signed_distance_m(ball, p.cast<double>()));
  CHECK(mesh.positions.size() > 5000);
  CHECK(sum / double(mesh.positions.size()) < 0.1 * map.voxel_size_m);
}

TEST_CASE("frames without a usable pixel leave the map as it is") {
  Map map(0.02, 0.08);
  IntegrationScratch scratch;
  Frame frame = ball_before_wall(Eigen::Isometry3d::Identity());
  std::fill(frame.depth_m.begin(), frame.depth_m.end(), 0.0f);
  IntegrationConfig from_the_lens;
  from_the_lens.min_depth_m = 0;  // depth 0 still means that nothing was measured
  CHECK(integrate(map, frame, from_the_lens, scratch).blocks_in_view == 0);
  for (const float bad : {0.0f, -1.0f, 100.0f, std::numeric_limits<float>::quiet_NaN(),
                          std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::infinity()}) {
    std::fill(frame.depth_m.begin(), frame.depth_m.end(), bad);
    integrate(map, frame, {}, scratch);
  }
  CHECK(active_voxel_count(map) == 0);
}

TEST_CASE("fused colours are the surface's") {
  const Map map = fused(5, {});
  size_t red = 0, blue = 0, wrong = 0;
  for (const Block& block : map.store.blocks())
    for (int i = 0; i < kBlockVoxels; ++i) {
      if (block.color == nullptr || block.color->count[i] < 3 || std::abs(block.geometry->tsdf[i]) > 0.01) continue;
      const bool is_red =
          block.color->r[i] == 200 * 256 && block.color->g[i] == 40 * 256 && block.color->b[i] == 90 * 256;
      const bool is_blue =
          block.color->r[i] == 20 * 256 && block.color->g[i] == 130 * 256 && block.color->b[i] == 250 * 256;
      red += is_red, blue += is_blue, wrong += !is_red && !is_blue;
    }
  CHECK(red > 300);
  CHECK(blue > 300);
  CHECK(wrong < (red + blue) / 20);  // voxels at the ball's silhouette see both
}

TEST_CASE("carving erases what stood before the surface seen later, and nothing else does") {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  const Frame with_ball = ball_before_wall(pose), without = ball_before_wall(pose, 160, 120, 0.3, 2.0, {50, 0, 1.4});
  for (const bool carve : {false, true}) {
    IntegrationConfig config;
    config.carve = carve;
    Map map(0.02, 0.08);
    IntegrationScratch scratch;
    for (int n = 0; n < 3; ++n) integrate(map, with_ball, config, scratch);
    const size_t blocks = map.store.size();
    for (int n = 0; n < 20; ++n) integrate(map, without, config, scratch);
    INFO("carve " << carve);
    // The foremost point of the ball, and the wall beside it.
    const auto tsdf = [&](const Index3& v) {
      return map.store.get(block_of_voxel(v))->geometry->tsdf[offset_in_block(v)];
    };
    CHECK(std::abs(tsdf({50, 0, 100})) < 0.01f);
    if (carve)
      CHECK(tsdf({0, 0, 55}) > 0.06f);
    else
      CHECK(std::abs(tsdf({0, 0, 55})) < 0.01f);
    // The part of the wall that the ball had hidden is new in both.
    CHECK(map.store.size() >= blocks);
  }
}

TEST_CASE("frames that are fused after a load make the map of frames fused without one") {
  const test::TemporaryDirectory folder;
  const std::filesystem::path file = folder.path() / "map.vdb";
  for (int variant = 0; variant < 18; ++variant) {
    const IntegrationConfig config = some_config(variant);
    Map through(0.04, 0.16), loaded(0.04, 0.16);
    IntegrationScratch scratch;
    Random random(17);
    for (int n = 0; n < 8; ++n) {
      // The wall recedes, what stands before it comes and goes, and every third frame has no colours.
      const double beside = random.between(-1.5, 1.5), wall_z = 1.7 + 0.13 * n;
      Frame frame = ball_before_wall(jittered_pose(random), 97, 61, 0.3, wall_z, {beside, 0, 1.2});
      if (n % 3 == 2) frame.color = {};
      integrate(through, frame, config, scratch);
      integrate(loaded, frame, config, scratch);
      save_map(loaded, file);
      loaded = load_map(file);
      INFO("variant " << variant << ", frame " << n);
      REQUIRE(map_hash(loaded) == map_hash(through));
    }
  }
}

TEST_CASE("a camera is on the map as far as index coordinates go") {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  CHECK(on_map(pose, 0.02, 4));
  pose.translation().y() = 5.4e6;
  CHECK(on_map(pose, 0.02, 4));
  CHECK_FALSE(on_map(pose, 0.005, 4));
  pose.translation().y() = -1e300;
  CHECK_FALSE(on_map(pose, 0.02, 4));
}
