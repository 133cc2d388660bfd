#pragma once

#include <cstdint>

namespace felt {

/// Counter-based random numbers: a pure function of the counters, so the same for any order and number of threads.
/// The mixing function is SplitMix64's finaliser (Steele, Lea, Flood 2014), applied once a counter.
inline constexpr uint64_t mix64(uint64_t x) {
  x += 0x9e3779b97f4a7c15ull;
  x = (x ^ x >> 30) * 0xbf58476d1ce4e5b9ull;
  x = (x ^ x >> 27) * 0x94d049bb133111ebull;
  return x ^ x >> 31;
}

/// One 64-bit word for (seed, stream, frame, counter); streams keep the uses of one seed independent.
inline constexpr uint64_t random_bits(uint64_t seed, uint64_t stream, uint64_t frame, uint64_t counter) {
  return mix64(mix64(mix64(mix64(seed) ^ stream) ^ frame) ^ counter);
}

/// In the open interval (0, 1).
inline constexpr double uniform01(uint64_t bits) { return (double(bits >> 12) + 0.5) * 0x1p-52; }

/// Standard normal deviate from one word (Box and Muller 1958, on its two halves).
double standard_normal(uint64_t bits);

}  // namespace felt
