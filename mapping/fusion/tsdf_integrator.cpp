#include "mapping/fusion/tsdf_integrator.h"

#include <tbb/parallel_for.h>

#include <atomic>
#include <cmath>
#include <limits>

#include "core/stopwatch.h"

namespace felt {
namespace {

/// Per-pixel factor of (d - z) to the tangent plane.
const float* tangent_scale(const Frame& frame, const IntegrationConfig& config, IntegrationScratch& scratch) {
  const PinholeCamera& camera = frame.camera;
  const int width = frame.depth_m.width(), height = frame.depth_m.height();
  scratch.depth_scale.resize(size_t(width) * height);
  // Neighbours farther off than a surface seen at 80 degrees would be are another surface's.
  constexpr float kSteepest = 5.67f;
  const SlopeView view{.depth_m = frame.depth_m.data(),
                       .width = width,
                       .height = height,
                       .fx = float(camera.fx),
                       .fy = float(camera.fy),
                       .cx = float(camera.cx),
                       .cy = float(camera.cy),
                       .max_depth_m = config.max_depth_m,
                       .max_step = kSteepest / float(std::min(camera.fx, camera.fy))};
  tbb::parallel_for(tbb::blocked_range<int>(0, height, 32), [&](const tbb::blocked_range<int>& rows) {
    for (int v = rows.begin(); v < rows.end(); ++v)
      tangent_scale_row(view, v, scratch.depth_scale.data() + size_t(v) * width);
  });
  return scratch.depth_scale.data();
}

/// Depth 0 means that nothing was measured, also where no least depth is asked for.
float least_usable_m(float min_depth_m) { return std::max(min_depth_m, std::numeric_limits<float>::min()); }

/// Finds or creates the blocks, with the planes that this frame writes: the only serial step. A block that was never
/// observed is as if it had not been allocated before, since saved maps do not hold it.
void allocate_blocks(Map& map, const std::vector<BlockCoord>& coords, bool with_color, std::vector<uint32_t>& blocks) {
  blocks.clear();
  blocks.reserve(coords.size());
  for (const BlockCoord& coord : coords) {
    blocks.push_back(map.store.find_or_create(coord));
    Block& block = map.store[blocks.back()];
    if (with_color)
      map.store.add_color(block);
    else if (block.color != nullptr && !block.geometry->observed())
      block.color = nullptr;
  }
}

/// Carving reaches what the map has in the free space before this frame's surfaces, besides the blocks around them. A
/// block that was never observed is as if it were not there, as above.
void add_blocks_in_front(const Map& map, const Eigen::Isometry3d& T_world_camera, const DepthView& view,
                         std::vector<BlockCoord>& coords, std::vector<uint32_t>& blocks) {
  std::vector<bool> taken(map.store.size());
  for (const uint32_t n : blocks) taken[n] = true;
  const Eigen::Isometry3d T_camera_world = T_world_camera.inverse();
  const double radius_m = 0.5 * std::sqrt(3.0) * kBlockDim * map.voxel_size_m;
  const auto behind = [&](const BlockCoord& block) {
    const Index3 first = first_voxel(block);
    const Eigen::Vector3d centre = Eigen::Vector3d(first.x, first.y, first.z).array() + 0.5 * (kBlockDim - 1);
    return (T_camera_world * (map.voxel_size_m * centre)).z() < -radius_m;
  };
  for (uint32_t n = 0; n < map.store.size(); ++n) {
    const Block& block = map.store[n];
    if (taken[n] || behind(block.coord) || cubes_in_band(block.coord, view) == 0 || !block.geometry->observed())
      continue;
    coords.push_back(block.coord);
    blocks.push_back(n);
  }
}

/// What the next block needs of its planes travels while this one is fused. Always inline: GCC drops calls of a
/// function that does nothing but prefetch.
[[gnu::always_inline]] inline void prefetch(const Block& block, uint64_t cubes) {
  const GeometryPlanes& planes = *block.geometry;
  for (uint32_t groups = groups_of_cubes(cubes); groups != 0; groups &= groups - 1) {
    const int first = __builtin_ctz(groups) * kGroupVoxels;  // a group of floats is a cache line
    __builtin_prefetch(planes.tsdf + first, 1, 2);
    __builtin_prefetch(planes.weight + first, 1, 2);
  }
  __builtin_prefetch(block.evidence.data(), 0, 3);
}

}  // namespace

DepthView depth_view(const Frame& frame, const IntegrationConfig& config, const Map& map, const float* scale,
                     const DepthTiles* tiles) {
  DepthView view;
  view.depth_m = frame.depth_m.data();
  view.scale = scale;
  view.width = frame.depth_m.width(), view.height = frame.depth_m.height();
  const PinholeCamera& camera = frame.camera;
  Eigen::Matrix3d K;
  K << camera.fx, 0, camera.cx + 0.5, 0, camera.fy, camera.cy + 0.5, 0, 0, 1;
  const Eigen::Isometry3d T_camera_world = frame.T_world_camera.inverse();
  const Eigen::Matrix3d per_voxel = K * T_camera_world.linear() * map.voxel_size_m;
  const Eigen::Vector3d at_origin = K * T_camera_world.translation();
  for (int c = 0; c < 3; ++c) {
    for (int axis = 0; axis < 3; ++axis) view.first[c][axis] = per_voxel(c, axis);
    view.first[c][3] = at_origin[c];
    view.step_x[c] = float(per_voxel(c, 0));
    for (int y = 0; y < 8; ++y)
      for (int z = 0; z < 8; ++z) view.plane[c][y * 8 + z] = float(per_voxel(c, 1) * y + per_voxel(c, 2) * z);
  }
  view.along_ray = config.distance == DistanceModel::ray;
  view.centre[0] = float(camera.cx + 0.5), view.centre[1] = float(camera.cy + 0.5);
  view.inverse_focal[0] = float(1 / camera.fx), view.inverse_focal[1] = float(1 / camera.fy);
  view.min_depth_m = least_usable_m(config.min_depth_m), view.max_depth_m = config.max_depth_m;
  view.truncation_m = float(map.truncation_m);
  const double dropoff_start = std::min(double(config.dropoff_start_vox) * map.voxel_size_m, 0.99 * map.truncation_m);
  view.dropoff_start_m = float(dropoff_start);
  view.dropoff_slope = float(1 / (map.truncation_m - dropoff_start));
  view.weight = config.weight;
  view.max_weight = config.max_weight;
  view.carve = config.carve;

  view.tiles = tiles;
  view.nearest_cube_m = std::numeric_limits<float>::infinity();
  for (int cube = 0; cube < 64; ++cube) {
    const Eigen::Vector3d centre(2 * (cube >> 4) + 0.5, 2 * (cube >> 2 & 3) + 0.5, 2 * (cube & 3) + 0.5);
    for (int c = 0; c < 3; ++c) view.cube[c][cube] = float(per_voxel.row(c).dot(centre));
    view.nearest_cube_m = std::min(view.nearest_cube_m, view.cube[2][cube]);
  }
  // A voxel is at centre + delta, |delta| <= 1/2 voxel an axis, and its pixel u' satisfies
  // (u' - u) (z + delta . row 2) = delta . (row 0 - u row 2): largest in u at one end of where u is looked at.
  view.reach_m = float(0.5 * per_voxel.row(2).cwiseAbs().sum());
  const double margin = DepthTiles::kFinestTile << (DepthTiles::kLevels - 1);
  for (const double u : {-margin, camera.width + margin})
    view.reach_px_m =
        std::max(view.reach_px_m, float(0.5 * (per_voxel.row(0) - u * per_voxel.row(2)).cwiseAbs().sum()));
  for (const double v : {-margin, camera.height + margin})
    view.reach_px_m =
        std::max(view.reach_px_m, float(0.5 * (per_voxel.row(1) - v * per_voxel.row(2)).cwiseAbs().sum()));
  view.band_m = view.truncation_m + view.reach_m + 1e-5f * (view.max_depth_m + view.truncation_m);
  return view;
}

FrameStats integrate(Map& map, const Frame& frame, const IntegrationConfig& config, IntegrationScratch& scratch) {
  FrameStats stats;
  const Stopwatch allocating;
  std::vector<BlockCoord> coords =
      blocks_in_view(frame.depth_m, frame.camera, frame.T_world_camera, map.voxel_size_m, map.truncation_m,
                     least_usable_m(config.min_depth_m), config.max_depth_m, scratch.allocation);
  allocate_blocks(map, coords, !frame.color.empty(), scratch.blocks);
  stats.blocks_in_view = coords.size();
  stats.allocate_s = allocating.seconds();

  const Stopwatch fusing;
  // Distance to the tangent plane is shorter than along the optical axis: a voxel far in front may be in the band.
  const bool tangent = config.distance == DistanceModel::tangent_plane;
  const DepthView view = depth_view(frame, config, map, tangent ? tangent_scale(frame, config, scratch) : nullptr,
                                    tangent ? nullptr : &scratch.allocation.tiles);
  if (config.carve) add_blocks_in_front(map, frame.T_world_camera, view, coords, scratch.blocks);
  const auto* rgba = reinterpret_cast<const uint32_t*>(frame.color.data());
  const float color_band_m = std::min(view.truncation_m, config.color_band_vox * float(map.voxel_size_m));
  const bool says_classes = !frame.labels.empty() || !frame.probabilities.empty();
  const double novelty =
      says_classes ? scratch.viewpoints.add(frame.T_world_camera, config.labels.novelty_m, config.labels.novelty_deg)
                   : 1;
  const LabelView labels = label_view(frame, map.classes, config.labels, map.voxel_size_m, novelty);
  const bool labelled = labels.says_classes() || labels.says_instances();
  std::atomic<uint64_t> label_voxels{0}, label_unknown{0}, label_invalid{0};
  tbb::parallel_for(tbb::blocked_range<size_t>(0, coords.size(), 16), [&](const tbb::blocked_range<size_t>& range) {
    BlockObservation observation;
    LabelFusion fusion(labels, map.store);
    uint64_t next_cubes = cubes_in_band(coords[range.begin()], view);
    for (size_t n = range.begin(); n < range.end(); ++n) {
      Block& block = map.store[scratch.blocks[n]];
      const uint64_t cubes = next_cubes;
      if (n + 1 < range.end()) {
        next_cubes = cubes_in_band(coords[n + 1], view);
        prefetch(map.store[scratch.blocks[n + 1]], next_cubes);
      }
      if (cubes == 0 || !observe_block(coords[n], view, observation, cubes)) continue;
      fuse_tsdf(observation, view.max_weight, *block.geometry);
      if (block.color != nullptr && rgba != nullptr) fuse_color(observation, rgba, color_band_m, *block.color);
      if (labelled) fusion.add(observation, block);
    }
    const LabelStats label_stats = fusion.finish();
    label_voxels.fetch_add(label_stats.voxels, std::memory_order_relaxed);
    label_unknown.fetch_add(label_stats.unknown, std::memory_order_relaxed);
    label_invalid.fetch_add(label_stats.invalid, std::memory_order_relaxed);
  });
  stats.labels = {label_voxels, label_unknown, label_invalid};
  stats.fuse_s = fusing.seconds();
  return stats;
}

}  // namespace felt
