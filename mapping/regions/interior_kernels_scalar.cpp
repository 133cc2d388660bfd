#include <algorithm>
#include <cmath>
#include <limits>

#include "mapping/regions/interior_kernels.h"

namespace felt {
namespace {

constexpr int kSteps[3] = {SurfaceTile::kStepX, SurfaceTile::kStepY, 1};

SurfaceNormal normalized(float x, float y, float z) {
  const float length = std::sqrt((x * x + y * y) + z * z);
  if (!(length > 0)) return {};
  const float scale = 1 / length;
  return {x * scale, y * scale, z * scale};
}

/// Half the central difference where both ends are observed, else the one-sided difference, NaN where there is neither.
float slope(const float* t, int step) {
  const float minus = t[-step], plus = t[step];
  if (!std::isnan(minus) && !std::isnan(plus)) return 0.5f * (plus - minus);
  return std::isnan(minus) ? plus - *t : *t - minus;
}

/// Mean over the nine lines along an axis that pass within a voxel.
float mean_slope(const float* t, int axis) {
  const int aside = kSteps[(axis + 1) % 3], other = kSteps[(axis + 2) % 3];
  float sum = 0;
  int count = 0;
  for (int i = -1; i <= 1; ++i)
    for (int j = -1; j <= 1; ++j) {
      const float s = slope(t + i * aside + j * other, kSteps[axis]);
      if (std::isnan(s)) continue;
      sum += s;
      ++count;
    }
  return count > 0 ? sum / float(count) : 0.0f;
}

/// Sums that 18 times the slopes of the fitted plane are (27 times its value); not a number where any of the 26
/// neighbours is.
SurfacePlane slope_sums(const float* t) {
  constexpr int kX = SurfaceTile::kStepX, kY = SurfaceTile::kStepY;
  const auto sum_z = [&](int row) { return (t[row - 1] + t[row]) + t[row + 1]; };
  const auto plate = [&](int centre, int aside) {
    return (sum_z(centre - aside) + sum_z(centre)) + sum_z(centre + aside);
  };
  const auto slopes_z = [&](int row) {
    const auto rise = [&](int r) { return t[r + 1] - t[r - 1]; };
    return (rise(row - kY) + rise(row)) + rise(row + kY);
  };
  const float low = plate(-kX, kY), high = plate(kX, kY);
  return {(low + plate(0, kY)) + high, high - low, plate(kY, kX) - plate(-kY, kX),
          (slopes_z(-kX) + slopes_z(0)) + slopes_z(kX)};
}

}  // namespace

std::array<uint16_t, SurfaceTile::kSide> rows_near(const std::array<uint64_t, 8>& words, int reach) {
  constexpr int kHalo = SurfaceTile::kHalo;
  std::array<uint16_t, SurfaceTile::kSide> rows{};
  for (int x = 0; x < 8; ++x) {
    uint64_t word = words[size_t(x)];
    if (word == 0) continue;
    unsigned here = 0;
    for (int y = 0; y < 8; ++y, word >>= 8) here |= unsigned((word & 0xff) != 0) << (y + kHalo);
    unsigned near = 0;
    for (int d = -reach; d <= reach; ++d) near |= d < 0 ? here >> -d : here << d;
    for (int d = -reach; d <= reach; ++d) rows[size_t(x + kHalo + d)] |= uint16_t(near);
  }
  return rows;
}

SurfacePlane fitted_plane(const SurfaceTile& tile, int at) noexcept {
  const SurfacePlane sums = slope_sums(tile.tsdf + at);
  return {sums.value / 27, sums.x / 18, sums.y / 18, sums.z / 18};
}

bool lies_on(const SurfacePlane& plane, int dx, int dy, int dz, float tsdf_m, float voxel_m, float share) noexcept {
  const float off = tsdf_m - (plane.value + ((plane.x * float(dx) + plane.y * float(dy)) + plane.z * float(dz)));
  const float slope2 = (plane.x * plane.x + plane.y * plane.y) + plane.z * plane.z;
  const float voxel2 = voxel_m * voxel_m;
  return slope2 >= 0.25f * voxel2 && off * off <= share * share * std::max(voxel2, slope2);
}

SurfaceNormal smoothed_normal(const SurfaceTile& tile, int at) noexcept {
  const float* t = tile.tsdf + at;
  const SurfacePlane sums = slope_sums(t);
  if (!std::isnan((sums.x + sums.y) + sums.z)) return normalized(sums.x, sums.y, sums.z);
  return normalized(mean_slope(t, 0), mean_slope(t, 1), mean_slope(t, 2));
}

BlockMask interior_voxels_scalar(const SurfaceTile& tile, const BlockMask& candidate, float band_m,
                                 float cos_limit) noexcept {
  const auto in_band = [&](int at) { return std::abs(tile.tsdf[at]) <= band_m; };
  BlockMask interior;
  for_each_bit(candidate, [&](int offset) {
    const Index3 v = voxel_of_offset(offset);
    const SurfaceNormal own = smoothed_normal(tile, SurfaceTile::index(v.x, v.y, v.z));
    for (int n = 0; n < 27; ++n) {
      const int other = SurfaceTile::index(v.x + n / 9 - 1, v.y + n / 3 % 3 - 1, v.z + n % 3 - 1);
      if (n == 13 || !in_band(other)) continue;
      const SurfaceNormal its = smoothed_normal(tile, other);
      if (!((own.x * its.x + own.y * its.y) + own.z * its.z >= cos_limit)) return;
    }
    interior.set(offset);
  });
  return interior;
}

}  // namespace felt
