#include <algorithm>
#include <cmath>

#include "mapping/label_kernels.h"

namespace felt {
namespace {

bool test(const LaneBits& lanes, int i) { return (lanes.row[i >> 3] >> (i & 7) & 1) != 0; }

}  // namespace

bool select_band_scalar(const BlockObservation& observation, float band_m, LaneBits& band) noexcept {
  bool any = false;
  for (int row = 0; row < kBlockVoxels / 8; ++row) {
    unsigned bits = 0;
    for (int z = 0; z < 8; ++z) bits |= unsigned(std::fabs(observation.sdf_m[row * 8 + z]) < band_m) << z;
    band.row[row] = uint8_t(bits & observation.valid[row]);
    any |= band.row[row] != 0;
  }
  return any;
}

void fetch_ids(const BlockObservation& observation, const LaneBits& lanes, const uint16_t* image,
               int32_t ids[kBlockVoxels]) noexcept {
  for (int row = 0; row < kBlockVoxels / 8; ++row)
    if (lanes.row[row] != 0)
      for (int i = row * 8; i < row * 8 + 8; ++i) ids[i] = image[uint32_t(observation.pixel[i])];
}

int take_equal_scalar(const int32_t ids[kBlockVoxels], int32_t id, LaneBits& rest, LaneBits& taken) noexcept {
  int count = 0;
  for (int row = 0; row < kBlockVoxels / 8; ++row) {
    unsigned bits = 0;
    if (rest.row[row] != 0)
      for (int z = 0; z < 8; ++z) bits |= unsigned(ids[row * 8 + z] == id) << z;
    taken.row[row] = uint8_t(bits & rest.row[row]);
    rest.row[row] = uint8_t(rest.row[row] & ~taken.row[row]);
    count += __builtin_popcount(taken.row[row]);
  }
  return count;
}

void add_evidence_scalar(const LaneBits& lanes, float amount, Plane& plane) noexcept {
  for (int i = 0; i < kBlockVoxels; ++i)
    if (test(lanes, i)) plane.value[i] += amount;
}

void fade_evidence_scalar(const LaneBits& lanes, std::span<Plane* const> planes, float added,
                          float max_evidence) noexcept {
  const float room = std::max(0.0f, max_evidence - added);
  for (int i = 0; i < kBlockVoxels; ++i) {
    if (!test(lanes, i)) continue;
    float total = 0;
    for (const Plane* plane : planes) total += plane->value[i];
    if (!(total > room)) continue;
    const float keep = room / total;
    for (Plane* plane : planes) plane->value[i] *= keep;
  }
}

}  // namespace felt
