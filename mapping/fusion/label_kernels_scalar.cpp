#include <algorithm>
#include <cmath>

#include "mapping/fusion/label_kernels.h"

namespace felt {
namespace {

bool test(const uint8_t* rows, int i) { return (rows[i >> 3] >> (i & 7) & 1) != 0; }

}  // namespace

void select_band_scalar(const BlockObservation& observation, float band_m, BandVoxels& band) noexcept {
  band.count = 0, band.groups = 0, band.bits = {};
  for (int i = 0; i < kBlockVoxels; ++i) {
    if (!test(observation.valid, i) || !(std::fabs(observation.sdf_m[i]) < band_m)) continue;
    band.lane[band.count] = i;
    band.pixel[band.count++] = observation.pixel[i];
    band.bits.set(i);
    band.groups |= 1u << (i / kGroupVoxels);
  }
}

void fade_evidence_scalar(const LaneBits& lanes, std::span<Plane* const> planes, const float added[kBlockVoxels],
                          float max_evidence) noexcept {
  for (int i = 0; i < kBlockVoxels; ++i) {
    if (!test(lanes.row, i)) continue;
    const float room = std::max(0.0f, max_evidence - added[i]);
    float total = 0;
    for (const Plane* plane : planes) total += plane->value[i];
    if (!(total > room)) continue;
    const float keep = room / total;
    for (Plane* plane : planes) plane->value[i] *= keep;
  }
}

void weigh_probabilities_scalar(SoftPixels& pixels) noexcept {
  pixels.taken = pixels.invalid = 0;
  pixels.any_left = pixels.count > 0;
  std::fill_n(pixels.verdict, pixels.count, int32_t(SoftPixels::kLeft));
  for (SoftRank& rank : pixels.ranks) std::fill_n(rank.slot, pixels.count, pixels.classes);
}

}  // namespace felt
