#pragma once

#include <cstring>

#include "bench/support/bench.h"
#include "core/frame.h"
#include "mapping/store/block_store.h"

namespace felt::bench {

/// What the machine can do at most, one thread.
struct MachineLimits {
  double copied_bytes_per_s = 0;     ///< read and written, arrays beyond the caches
  double scattered_reads_per_s = 0;  ///< of depth, in the pattern of blocks that are projected one after another
};

inline MachineLimits machine_limits(const DepthImage& depth) {
  std::vector<float> stream(64 << 20 >> 2, 1.0f), target(stream.size());
  double copy = 1e9, gather = 1e9;
  for (int repetition = 0; repetition < 5; ++repetition)
    copy = std::min(copy, seconds([&] { std::memcpy(target.data(), stream.data(), stream.size() * 4); }));
  std::vector<uint32_t> pixel(1 << 16);
  for (size_t i = 0; i < pixel.size(); ++i)  // the pattern of one block after another: 64 rows of nearby pixels
    pixel[i] = uint32_t(((i / 64 % 440) * size_t(depth.width()) + i % 8 * 5 + i / 8 % 8 * 5 * size_t(depth.width())) %
                        depth.size());
  volatile float sum = 0;  // or nothing need be read
  for (int repetition = 0; repetition < 20; ++repetition)
    gather = std::min(gather, seconds([&] {
                        float s[4] = {};
                        for (size_t i = 0; i < pixel.size(); i += 4)
                          for (size_t j = 0; j < 4; ++j) s[j] += depth.data()[pixel[i + j]];
                        sum = s[0] + s[1] + s[2] + s[3];
                      }));
  return {2.0 * double(stream.size()) * 4 / copy, double(pixel.size()) / gather};
}

/// Least time for one frame: every depth pixel once, tsdf and weight of each block in view read and written once, one
/// scattered read of depth a voxel.
inline double bound_ms(const MachineLimits& limits, const DepthImage& depth, double blocks_per_frame) {
  const double voxels = blocks_per_frame * kBlockVoxels;
  const double bytes = double(depth.size()) * 4 + voxels * 2 * 4 * 2;
  return 1e3 * std::max(bytes / limits.copied_bytes_per_s, voxels / limits.scattered_reads_per_s);
}

}  // namespace felt::bench
