#pragma once

#include <string>
#include <vector>

#include "mapping/map.h"

namespace felt {

/// One invariant that a map breaks.
struct MapFault {
  std::string grid;    ///< where, by the name it has in a file: "tsdf", "evidence/<class>", ...
  std::string broken;  ///< the invariant, for example "weight is finite and >= 0"
  size_t voxels = 0;   ///< how many voxels break it; 0 where it is not about voxels
  Index3 first;        ///< the first of them in ascending order of blocks
};

/// Checks every invariant of a map in memory: numbers finite, weight >= 0, |tsdf| <= truncation and at the background
/// where nothing was observed, evidence >= 0 and its planes one for each class in ascending order, colour only where
/// it was observed; touched voxels observed, their statistics finite, and what follows for them a belief (alpha, kappa,
/// beta and gamma finite and > 0). Empty where the map is sound.
std::vector<MapFault> verify(const Map& map);

}  // namespace felt
