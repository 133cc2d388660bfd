#include "mapping/fusion/block_allocation.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <span>

#include "core/error.h"
#include "mapping/fusion/survey_kernels.h"

namespace felt {
namespace {

/// Boxes up to here are scanned without a second thought; larger ones are fitted to what the view really holds.
constexpr double kCheapCells = 1 << 18;
constexpr double kMostCells = double(1u << 30);
/// Index coordinates are 32-bit: a pose farther out is no place on the map.
constexpr double kFarthestBlock = 1 << 27;

/// The blocks that a view may reach: `cells` of them along each axis from `lowest`.
struct ViewBox {
  Eigen::Vector3d lowest, cells;
  double count() const { return cells.prod(); }
  bool on_map() const {
    return lowest.cwiseAbs().maxCoeff() < kFarthestBlock && (lowest + cells).cwiseAbs().maxCoeff() < kFarthestBlock;
  }
};

ViewBox view_box(const PinholeCamera& camera, const Eigen::Isometry3d& T_world_camera, double voxel_size_m,
                 double nearest_m, double farthest_m) {
  Eigen::AlignedBox3d box;
  for (const double u : {-0.5, camera.width - 0.5})
    for (const double v : {-0.5, camera.height - 0.5})
      for (const double d : {nearest_m, farthest_m}) box.extend(T_world_camera * (d * camera.ray(u, v)));
  // Voxel i belongs to [i - 1/2, i + 1/2) in index units, so block b begins half a voxel before 8 b.
  const auto block_of = [&](const Eigen::Vector3d& p) {
    return Eigen::Vector3d(((p.array() / voxel_size_m + 0.5) / kBlockDim).floor());
  };
  const Eigen::Vector3d lowest = block_of(box.min());
  return {lowest, block_of(box.max()) - lowest + Eigen::Vector3d::Ones()};
}

/// Coordinates of the marked cells, ascending.
std::vector<BlockCoord> marked_blocks(const std::vector<uint8_t>& marks, const ViewBox& box) {
  const Eigen::Vector3i lowest = box.lowest.cast<int>(), extent = box.cells.cast<int>();
  std::vector<BlockCoord> blocks;
  const std::span cells(marks.data(), marks.size() - 1);  // without the spare one
  constexpr size_t kAtOnce = 64;                          // most of the box is empty
  for (size_t begin = 0; begin < cells.size(); begin += kAtOnce) {
    uint64_t words[kAtOnce / 8] = {};
    const size_t length = std::min(kAtOnce, cells.size() - begin);
    std::memcpy(words, &cells[begin], length);
    uint64_t any = 0;
    for (const uint64_t word : words) any |= word;
    for (size_t cell = begin; any != 0 && cell < begin + length; ++cell) {
      if (cells[cell] == 0) continue;
      const auto column = int(cell / size_t(extent.z()));
      blocks.push_back({lowest.x() + column / extent.y(), lowest.y() + column % extent.y(),
                        lowest.z() + int(cell % size_t(extent.z()))});
    }
  }
  return blocks;
}

/// Marks the cells that image row `v` sees, with every stride-th pixel.
void mark_row(const DepthImage& depth_m, int v, int stride, float min_depth_m, float max_depth_m,
              const AllocationView& view, uint8_t* cells) {
  const float* row = depth_m.row(v);
  RowSamples samples;
  for (int u = 0; u < depth_m.width();) {
    samples.count = 0;
    for (; u < depth_m.width() && samples.count < RowSamples::kMost; u += stride) {
      samples.u[samples.count] = float(u);
      samples.depth_m[samples.count] = row[u];
      samples.count += row[u] >= min_depth_m && row[u] <= max_depth_m;
    }
    mark_cells(view, v, samples, cells);
  }
}

}  // namespace

bool on_map(const Eigen::Isometry3d& T_world_camera, double voxel_size_m, double reach_m) {
  const double farthest_m = T_world_camera.translation().cwiseAbs().maxCoeff() + reach_m;
  return farthest_m < kFarthestBlock * kBlockDim * voxel_size_m;
}

std::vector<BlockCoord> blocks_in_view(const DepthImage& depth_m, const PinholeCamera& camera,
                                       const Eigen::Isometry3d& T_world_camera, double voxel_size_m,
                                       double truncation_m, float min_depth_m, float max_depth_m,
                                       AllocationScratch& scratch) {
  const int width = depth_m.width(), height = depth_m.height();
  DepthTiles& tiles = scratch.tiles;
  shape_tiles(width, height, tiles);
  DepthTiles::Level& finest = tiles.levels[0];
  const auto survey = [&](int tile_row) {
    tile_range_row(depth_m.data(), width, height, tile_row, min_depth_m, max_depth_m, finest.row(tile_row));
  };
  constexpr int kTileRowsATask = 8;
  const tbb::blocked_range<int> all_tile_rows(0, finest.rows, kTileRowsATask);

  double farthest_m = max_depth_m;
  ViewBox box = view_box(camera, T_world_camera, voxel_size_m, 0, farthest_m + truncation_m);
  const bool fitted = !(box.count() <= kCheapCells);
  if (fitted) {
    tbb::parallel_for(all_tile_rows, [&](const tbb::blocked_range<int>& range) {
      for (int row = range.begin(); row < range.end(); ++row) survey(row);
    });
    const DepthRange depth = range_of_image(tiles);
    if (!(-depth.minus_farthest_m > 0)) return {};
    farthest_m = -depth.minus_farthest_m;
    box = view_box(camera, T_world_camera, voxel_size_m, std::max(0.0, depth.nearest_m - truncation_m),
                   farthest_m + truncation_m);
  }
  if (!box.on_map()) return {};
  if (box.count() > kMostCells)
    throw ConfigError(
        describe_mismatch("depth fusion", "blocks in the box around one view", "at most 2^30",
                          std::to_string(box.count()) + ": use larger voxels or a smaller maximum depth"));
  scratch.cells.assign(size_t(box.count()) + 1, 0);  // the spare cell takes what falls outside

  const double block_m = voxel_size_m * kBlockDim;
  const auto samples = size_t(std::ceil(2 * truncation_m / (0.5 * block_m))) + 1;
  scratch.offsets_m.resize(samples);
  for (size_t s = 0; s < samples; ++s)
    scratch.offsets_m[s] = float(truncation_m * (2.0 * double(s) / double(samples - 1) - 1));

  AllocationView view;
  view.offsets_m = scratch.offsets_m.data();
  view.samples = int(samples);
  const Eigen::Vector3d ray0 = T_world_camera.linear() * camera.ray(0, 0) / block_m;
  const Eigen::Vector3d ray_u = T_world_camera.linear().col(0) / camera.fx / block_m;
  const Eigen::Vector3d ray_v = T_world_camera.linear().col(1) / camera.fy / block_m;
  for (int c = 0; c < 3; ++c) {
    view.ray0[c] = float(ray0[c]), view.ray_u[c] = float(ray_u[c]), view.ray_v[c] = float(ray_v[c]);
    view.origin[c] = float((T_world_camera.translation()[c] / voxel_size_m + 0.5) / kBlockDim - box.lowest[c]);
    view.cells[c] = int(box.cells[c]);
  }
  constexpr int kCoarsestStride = 4;
  const double quarter_block_px = 0.25 * block_m * std::max(camera.fx, camera.fy) / farthest_m;
  const int stride = int(std::clamp(quarter_block_px, 1.0, double(kCoarsestStride)));
  // Depth is marked while the survey has it at hand.
  tbb::parallel_for(all_tile_rows, [&](const tbb::blocked_range<int>& range) {
    for (int tile_row = range.begin(); tile_row < range.end(); ++tile_row) {
      if (!fitted) survey(tile_row);
      const int first = tile_row * DepthTiles::kFinestTile, end = std::min(height, first + DepthTiles::kFinestTile);
      for (int v = (first + stride - 1) / stride * stride; v < end; v += stride)
        mark_row(depth_m, v, stride, min_depth_m, max_depth_m, view, scratch.cells.data());
    }
  });
  spread_ranges(tiles);
  return marked_blocks(scratch.cells, box);
}

}  // namespace felt
