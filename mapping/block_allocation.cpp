#include "mapping/block_allocation.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/error.h"
#include "mapping/tsdf_kernels.h"

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

/// Smallest and largest usable depth; false where there is none.
bool depth_range(const DepthImage& depth_m, float min_depth_m, float max_depth_m, float& low, float& high) {
  low = max_depth_m, high = 0;
  for (const float d : depth_m) {
    const bool usable = d >= min_depth_m && d <= max_depth_m;
    low = usable && d < low ? d : low;
    high = usable && d > high ? d : high;
  }
  return high > 0;
}

/// Coordinates of the marked cells, ascending.
std::vector<BlockCoord> marked_blocks(const std::vector<uint8_t>& cells, const ViewBox& box) {
  const Eigen::Vector3i lowest = box.lowest.cast<int>(), extent = box.cells.cast<int>();
  std::vector<BlockCoord> blocks;
  constexpr size_t kWord = 8;
  for (size_t word = 0; word < cells.size(); word += kWord) {
    const size_t length = std::min(kWord, cells.size() - word);
    uint64_t eight = 0;
    std::memcpy(&eight, &cells[word], length);
    for (size_t cell = word; eight != 0 && cell < word + length; ++cell) {
      if (cells[cell] == 0) continue;
      const auto column = int(cell / size_t(extent.z()));
      blocks.push_back({lowest.x() + column / extent.y(), lowest.y() + column % extent.y(),
                        lowest.z() + int(cell % size_t(extent.z()))});
    }
  }
  return blocks;
}

}  // namespace

std::vector<BlockCoord> blocks_in_view(const DepthImage& depth_m, const PinholeCamera& camera,
                                       const Eigen::Isometry3d& T_world_camera, double voxel_size_m,
                                       double truncation_m, float min_depth_m, float max_depth_m,
                                       AllocationScratch& scratch) {
  double farthest_m = max_depth_m;
  ViewBox box = view_box(camera, T_world_camera, voxel_size_m, 0, farthest_m + truncation_m);
  if (!(box.count() <= kCheapCells)) {
    float low = 0, high = 0;
    if (!depth_range(depth_m, min_depth_m, max_depth_m, low, high)) return {};
    farthest_m = high;
    box = view_box(camera, T_world_camera, voxel_size_m, std::max(0.0, low - truncation_m), high + truncation_m);
  }
  if (!box.on_map()) return {};
  if (box.count() > kMostCells)
    throw ConfigError(
        describe_mismatch("depth fusion", "blocks in the box around one view", "at most 2^30",
                          std::to_string(box.count()) + ": use larger voxels or a smaller maximum depth"));
  scratch.cells.assign(size_t(box.count()), 0);

  const double block_m = voxel_size_m * kBlockDim;
  constexpr int kCoarsestStride = 4;
  const double pixels_per_quarter_block = 0.25 * block_m * std::max(camera.fx, camera.fy) / farthest_m;
  const auto samples = size_t(std::ceil(2 * truncation_m / (0.5 * block_m))) + 1;
  scratch.offsets_m.resize(samples);
  for (size_t s = 0; s < samples; ++s)
    scratch.offsets_m[s] = float(truncation_m * (2.0 * double(s) / double(samples - 1) - 1));

  AllocationView view;
  view.depth_m = depth_m.data();
  view.width = depth_m.width(), view.height = depth_m.height();
  view.stride = int(std::clamp(pixels_per_quarter_block, 1.0, double(kCoarsestStride)));
  view.min_depth_m = min_depth_m, view.max_depth_m = max_depth_m;
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
  const int rows = (view.height + view.stride - 1) / view.stride;
  tbb::parallel_for(tbb::blocked_range<int>(0, rows, 16), [&](const tbb::blocked_range<int>& range) {
    for (int row = range.begin(); row < range.end(); ++row)
      mark_cells_in_row(view, row * view.stride, scratch.cells.data());
  });
  return marked_blocks(scratch.cells, box);
}

}  // namespace felt
