#include "mapping/surface/render_classes.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <cmath>
#include <limits>

#include "inference/decision.h"

namespace felt {
namespace {

/// Calls `visit(u, v, voxel, p)` for every pixel with a surface, in parallel over rows; `p`: room for its class
/// probabilities.
template <typename Visit>
void for_each_surface_pixel(const VoxelBeliefs& beliefs, const Image<VoxelRef>& voxels, Visit visit) {
  tbb::parallel_for(tbb::blocked_range<int>(0, voxels.height(), 8), [&](const auto& rows) {
    std::vector<double> p(size_t(beliefs.classes()));
    for (int v = rows.begin(); v < rows.end(); ++v)
      for (int u = 0; u < voxels.width(); ++u)
        if (voxels(u, v).block != BlockStore::kNone) visit(u, v, voxels(u, v), p);
  });
}

}  // namespace

LabelImage class_image(const Map& map, const VoxelBeliefs& beliefs, const Image<VoxelRef>& voxels) {
  LabelImage image(voxels.width(), voxels.height(), kNoLabel);
  for_each_surface_pixel(beliefs, voxels, [&](int u, int v, const VoxelRef& voxel, auto&) {
    if (const int slot = beliefs.strongest_class(voxel); slot >= 0) image(u, v) = map.classes.at_slot(slot).id;
  });
  return image;
}

Image<float> entropy_image(const VoxelBeliefs& beliefs, const Image<VoxelRef>& voxels) {
  Image<float> image(voxels.width(), voxels.height(), std::numeric_limits<float>::quiet_NaN());
  for_each_surface_pixel(beliefs, voxels, [&](int u, int v, const VoxelRef& voxel, auto& p) {
    beliefs.class_probability(voxel, p);
    image(u, v) = float(class_entropy(p));
  });
  return image;
}

PropertyImages property_images(const VoxelBeliefs& beliefs, const Image<VoxelRef>& voxels, int property) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  PropertyImages images{Image<float>(voxels.width(), voxels.height(), float(kNone)),
                        Image<float>(voxels.width(), voxels.height(), float(kNone))};
  for_each_surface_pixel(beliefs, voxels, [&](int u, int v, const VoxelRef& voxel, auto&) {
    const StudentTMixture next = beliefs.next_reading(voxel, property);
    if (next.weight.empty()) return;
    images.mean(u, v) = float(mean(next).value_or(kNone));
    images.sd(u, v) = float(std::sqrt(variance(next).value_or(kNone)));
  });
  return images;
}

}  // namespace felt
