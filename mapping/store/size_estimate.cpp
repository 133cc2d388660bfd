#include "mapping/store/size_estimate.h"

#include <cmath>

#include "mapping/store/block_store.h"

namespace felt {
namespace {

/// A plane of random orientation meets 1.5 area / edge^2 cubes of a grid (the mean over orientations of |n|_1).
constexpr double kCubesPerFace = 1.5;

}  // namespace

void SurfaceEstimate::add(const Frame& frame, double min_depth_m, double max_depth_m) {
  constexpr int kStride = 4;
  for (int v = 0; v < frame.depth_m.height(); v += kStride) {
    for (int u = 0; u < frame.depth_m.width(); u += kStride) {
      const double d = frame.depth_m(u, v);
      if (!(d >= min_depth_m && d <= max_depth_m)) continue;
      const Eigen::Vector3d cell = frame.T_world_camera * (d * frame.camera.ray(u, v)) / cell_m_;
      cells_.insert({int32_t(std::floor(cell.x())), int32_t(std::floor(cell.y())), int32_t(std::floor(cell.z()))});
    }
  }
}

double SurfaceEstimate::area_m2() const { return double(cells_.size()) * cell_m_ * cell_m_ / kCubesPerFace; }

double blocks_near_surface(double area_m2, const MapResolution& resolution) {
  const double block_m = resolution.voxel_size_m * kBlockDim;
  return area_m2 / (block_m * block_m) * (kCubesPerFace + 2 * resolution.truncation_m / block_m);
}

double largest_area_in_view_m2(const PinholeCamera& camera, double max_depth_m) {
  return 2 * max_depth_m * max_depth_m * camera.width * camera.height / (camera.fx * camera.fy);
}

double estimated_bytes(double blocks, const MapResolution& resolution) {
  constexpr double kRecord = sizeof(Block) + 16;                // and its place in the index, at most half full
  constexpr double kMesh = 64 * 28 + 128 * 12;                  // vertices and triangles of a block on the surface
  constexpr double kSaving = 2 * kBlockVoxels * sizeof(float);  // two grids are prepared while one is written
  const double planes = sizeof(GeometryPlanes) + (resolution.color ? sizeof(ColorPlanes) : 0);
  return blocks * (planes + kRecord + kMesh + kSaving);
}

}  // namespace felt
