#include "mapping/render_classes.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

namespace felt {
namespace {

constexpr uint16_t kNoClass = 0xffff;
constexpr double kPriorCount = 1;

/// Calls `value(voxel)` for every pixel with a surface, in parallel over rows.
template <typename T, typename Value>
Image<T> per_pixel(const Image<VoxelRef>& voxels, T absent, Value value) {
  Image<T> image(voxels.width(), voxels.height(), absent);
  tbb::parallel_for(0, voxels.height(), [&](int v) {
    for (int u = 0; u < voxels.width(); ++u)
      if (voxels(u, v).block != BlockStore::kNone) image(u, v) = value(voxels(u, v));
  });
  return image;
}

}  // namespace

std::vector<double> class_probability(const Map& map, const VoxelRef& voxel) {
  std::vector<double> p(size_t(map.classes.size()), kPriorCount);
  double sum = kPriorCount * double(p.size());
  for (const EvidencePlane& plane : map.store[voxel.block].evidence) {
    const double count = plane.counts->value[voxel.offset];
    p[plane.slot] += count;
    sum += count;
  }
  for (double& x : p) x /= sum;
  return p;
}

LabelImage class_image(const Map& map, const Image<VoxelRef>& voxels) {
  return per_pixel<uint16_t>(voxels, kNoClass, [&](const VoxelRef& voxel) {
    const EvidencePlane* best = nullptr;
    for (const EvidencePlane& plane : map.store[voxel.block].evidence) {
      const float count = plane.counts->value[voxel.offset];
      if (count > (best == nullptr ? 0 : best->counts->value[voxel.offset])) best = &plane;
    }
    return best == nullptr ? kNoClass : map.classes.at_slot(best->slot).id;
  });
}

Image<float> entropy_image(const Map& map, const Image<VoxelRef>& voxels) {
  return per_pixel<float>(voxels, 0, [&](const VoxelRef& voxel) {
    double entropy = 0;
    for (const double p : class_probability(map, voxel)) entropy -= p > 0 ? p * std::log(p) : 0;
    return float(entropy);
  });
}

}  // namespace felt
