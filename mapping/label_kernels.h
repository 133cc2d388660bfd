#pragma once

#include <cstdint>
#include <span>

#include "mapping/block_store.h"
#include "mapping/tsdf_kernels.h"

namespace felt {

/// Voxels of a block as bits: bit z of byte x * 8 + y, as BlockObservation::valid.
struct alignas(64) LaneBits {
  uint8_t row[kBlockVoxels / 8] = {};
};

// Every target gives the scalar version's bits: additions and multiplications, each rounded once.

/// The observed voxels with |sdf| < band_m. Returns whether there is any.
bool select_band(const BlockObservation& observation, float band_m, LaneBits& band) noexcept;
bool select_band_scalar(const BlockObservation& observation, float band_m, LaneBits& band) noexcept;

/// ids[i] = image[pixel[i]] for every row of eight voxels that has one in `lanes`; other entries are left alone.
void fetch_ids(const BlockObservation& observation, const LaneBits& lanes, const uint16_t* image,
               int32_t ids[kBlockVoxels]) noexcept;

/// Moves the lanes of `rest` whose id is `id` to `taken` (which is overwritten); returns their number.
int take_equal(const int32_t ids[kBlockVoxels], int32_t id, LaneBits& rest, LaneBits& taken) noexcept;
int take_equal_scalar(const int32_t ids[kBlockVoxels], int32_t id, LaneBits& rest, LaneBits& taken) noexcept;

/// plane += amount in `lanes`.
void add_evidence(const LaneBits& lanes, float amount, Plane& plane) noexcept;
void add_evidence_scalar(const LaneBits& lanes, float amount, Plane& plane) noexcept;

/// Makes room for `added` below `max_evidence`: where the sum over `planes` (in their order) passes max_evidence -
/// added, all of them are scaled down to it.
void fade_evidence(const LaneBits& lanes, std::span<Plane* const> planes, float added, float max_evidence) noexcept;
void fade_evidence_scalar(const LaneBits& lanes, std::span<Plane* const> planes, float added,
                          float max_evidence) noexcept;

}  // namespace felt
