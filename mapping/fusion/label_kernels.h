#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mapping/fusion/tsdf_kernels.h"
#include "mapping/store/block_store.h"

namespace felt {

/// Voxels of a block as bits: bit z of byte x * 8 + y, as BlockObservation::valid.
struct alignas(64) LaneBits {
  uint8_t row[kBlockVoxels / 8] = {};
  void set(int i) { row[i >> 3] |= uint8_t(1u << (i & 7)); }
  void clear(int i) { row[i >> 3] &= uint8_t(~(1u << (i & 7))); }
};

/// What vectors may write behind the last entry of a list.
inline constexpr int kListPadding = 16;

/// The voxels of a block that lie in a band around the surface, as a list: what comes after costs by the voxel and not
/// by the block.
struct BandVoxels {
  int count = 0;
  uint32_t groups = 0;                                     ///< bit g: some voxel of [16 g, 16 g + 16) is in the list
  LaneBits bits;                                           ///< the same voxels
  alignas(64) int32_t lane[kBlockVoxels + kListPadding];   ///< voxel in the block, ascending
  alignas(64) int32_t pixel[kBlockVoxels + kListPadding];  ///< v * width + u
};

// Every target gives the scalar version's bits: additions, multiplications and divisions, each rounded once.

/// The observed voxels with |sdf| < band_m.
void select_band(const BlockObservation& observation, float band_m, BandVoxels& band) noexcept;
void select_band_scalar(const BlockObservation& observation, float band_m, BandVoxels& band) noexcept;

/// Makes room for `added` (by voxel of the block) below `max_evidence`: where the sum over `planes` (in their order)
/// passes max_evidence - added, all of them are scaled down to it.
void fade_evidence(const LaneBits& lanes, std::span<Plane* const> planes, const float added[kBlockVoxels],
                   float max_evidence) noexcept;
void fade_evidence_scalar(const LaneBits& lanes, std::span<Plane* const> planes, const float added[kBlockVoxels],
                          float max_evidence) noexcept;

/// For each pixel of a list, the class that comes at one rank among its most probable ones.
struct alignas(64) SoftRank {
  int32_t slot[kBlockVoxels + kListPadding];              ///< `classes` where it takes no evidence
  alignas(64) float amount[kBlockVoxels + kListPadding];  ///< probability, then evidence
};

/// The probabilities of a list of pixels, and what they add.
struct SoftPixels {
  int count = 0;
  int classes = 0;     ///< k, the number of classes that take evidence
  float evidence = 1;  ///< what one pixel adds
  bool spread = true;  ///< mass that was not kept goes to the other classes evenly
  std::vector<SoftRank> ranks;

  int taken = 0, invalid = 0;                            ///< pixels that add evidence, and that are no distribution
  bool any_left = false;                                 ///< whether some verdict is `kLeft`
  alignas(64) float even[kBlockVoxels + kListPadding];   ///< evidence for all classes together, evenly
  alignas(64) float added[kBlockVoxels + kListPadding];  ///< all evidence of the pixel
  /// kNothing: the pixel adds nothing; kLeft: nothing was worked out for it.
  enum Verdict : int32_t { kNothing, kAdds, kLeft };
  alignas(64) int32_t verdict[kBlockVoxels + kListPadding];
};

/// Largest sum of one pixel's probabilities that rounding explains.
inline constexpr float kMostProbability = 1.001f;
/// Rounded to 16 bits, a whole distribution may lack this much; nothing was dropped from it.
inline float rounded_mass(int top) { return float(top) / 65535.0f; }

/// Turns probabilities into what each pixel adds by the rule of LabelFusion, where that is plain: no class is named
/// twice, and none that is named is less probable than those that are not. Where nothing is to be added the slot
/// becomes `classes`. Other pixels are left to the caller, whose rule is the specification; the scalar version leaves
/// all of them. Padding is overwritten.
void weigh_probabilities(SoftPixels& pixels) noexcept;
void weigh_probabilities_scalar(SoftPixels& pixels) noexcept;

}  // namespace felt
