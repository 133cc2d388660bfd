#include "mapping/block_allocation.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "mapping/tsdf_kernels.h"

namespace felt {
namespace {

/// Largest and smallest depth that will be used; false where there is none.
bool depth_range(const DepthImage& depth_m, float min_depth_m, float max_depth_m, int stride, float& low, float& high) {
  low = max_depth_m, high = 0;
  for (int v = 0; v < depth_m.height(); v += stride) {
    const float* row = depth_m.row(v);
    for (int u = 0; u < depth_m.width(); u += stride) {
      const float d = row[u];
      const bool usable = d >= min_depth_m && d <= max_depth_m;
      low = usable && d < low ? d : low;
      high = usable && d > high ? d : high;
    }
  }
  return high > 0;
}

}  // namespace

std::vector<BlockCoord> blocks_in_view(const DepthImage& depth_m, const PinholeCamera& camera,
                                       const Eigen::Isometry3d& T_world_camera, double voxel_size_m,
                                       double truncation_m, float min_depth_m, float max_depth_m,
                                       AllocationScratch& scratch) {
  const double block_m = voxel_size_m * kBlockDim;
  const double focal = std::max(camera.fx, camera.fy);
  AllocationView view;
  view.depth_m = depth_m.data();
  view.width = depth_m.width(), view.height = depth_m.height();
  view.min_depth_m = min_depth_m, view.max_depth_m = max_depth_m;

  constexpr int kCoarsestStride = 4;
  float low = 0, high = 0;
  if (!depth_range(depth_m, min_depth_m, max_depth_m, kCoarsestStride, low, high) &&
      !depth_range(depth_m, min_depth_m, max_depth_m, 1, low, high))
    return {};
  view.stride = std::clamp(int(0.25 * block_m * focal / high), 1, kCoarsestStride);
  // The coarse pass may have missed the extremes: cells outside the box are ignored, so leave a margin and clip.
  const double reach = std::min<double>(max_depth_m, high * 1.1 + block_m) + truncation_m;
  const double nearest = std::max(0.0, low * 0.9 - block_m - truncation_m);

  Eigen::AlignedBox3d box;
  for (const double u : {-0.5, view.width - 0.5})
    for (const double v : {-0.5, view.height - 0.5})
      for (const double d : {nearest, reach}) box.extend(T_world_camera * (d * camera.ray(u, v)));
  Eigen::Vector3i lowest, cells;
  size_t count = 1;
  for (int c = 0; c < 3; ++c) {
    // Voxel i belongs to [i - 1/2, i + 1/2) in index units, so block b begins half a voxel before 8 b.
    lowest[c] = int(std::floor((box.min()[c] / voxel_size_m + 0.5) / kBlockDim));
    cells[c] = int(std::floor((box.max()[c] / voxel_size_m + 0.5) / kBlockDim)) - lowest[c] + 1;
    count *= size_t(cells[c]);
    view.cells[c] = cells[c];
  }
  scratch.cells.assign(count, 0);

  const double samples = std::ceil(2 * truncation_m / (0.5 * block_m)) + 1;
  scratch.offsets_m.resize(size_t(samples));
  for (size_t s = 0; s < scratch.offsets_m.size(); ++s)
    scratch.offsets_m[s] = float(truncation_m * (2.0 * double(s) / (samples - 1) - 1));
  view.offsets_m = scratch.offsets_m.data();
  view.samples = int(samples);
  const Eigen::Vector3d ray0 = T_world_camera.linear() * camera.ray(0, 0) / block_m;
  const Eigen::Vector3d ray_u = T_world_camera.linear().col(0) / camera.fx / block_m;
  const Eigen::Vector3d ray_v = T_world_camera.linear().col(1) / camera.fy / block_m;
  for (int c = 0; c < 3; ++c) {
    view.ray0[c] = float(ray0[c]), view.ray_u[c] = float(ray_u[c]), view.ray_v[c] = float(ray_v[c]);
    view.origin[c] = float((T_world_camera.translation()[c] / voxel_size_m + 0.5) / kBlockDim - lowest[c]);
  }
  const int rows = (view.height + view.stride - 1) / view.stride;
  tbb::parallel_for(tbb::blocked_range<int>(0, rows, 16), [&](const tbb::blocked_range<int>& range) {
    for (int row = range.begin(); row < range.end(); ++row)
      mark_cells_in_row(view, row * view.stride, scratch.cells.data());
  });

  std::vector<BlockCoord> blocks;
  for (size_t cell = 0; cell < count;) {
    uint64_t eight = 0;
    if (cell + 8 <= count) std::memcpy(&eight, &scratch.cells[cell], 8);
    if (cell + 8 <= count && eight == 0) {
      cell += 8;
      continue;
    }
    const size_t end = std::min(count, cell + 8);
    for (; cell < end; ++cell) {
      if (scratch.cells[cell] == 0) continue;
      const auto plane = int(cell / size_t(cells[2]));
      blocks.push_back(
          {lowest[0] + plane / cells[1], lowest[1] + plane % cells[1], lowest[2] + int(cell % size_t(cells[2]))});
    }
  }
  return blocks;
}

}  // namespace felt
