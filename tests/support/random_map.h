#pragma once

#include <cstdint>

#include "mapping/map.h"

namespace felt::test {

struct RandomMapOptions {
  uint64_t seed = 1;
  int blocks = 10;
  int classes = 0;  ///< named "class 0", "class 1", ...
  bool color = true;
  bool shared_evidence = false, instances = false;  ///< do not change what else is there
};

/// A map with every kind of state in random blocks around the origin: unobserved voxels in observed blocks, blocks
/// without colour, blocks with some classes, a frame journal and texts. Same options, same map.
Map random_map(const RandomMapOptions& options);

}  // namespace felt::test
