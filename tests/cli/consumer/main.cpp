#include <cstdio>

#include "mapping/map.h"

int main() {
  felt::Map map(0.02, 0.08);
  map.store[map.store.find_or_create({0, 0, 0})].geometry->weight[0] = 1;
  std::printf("%zu voxel, hash %s\n", felt::active_voxel_count(map), felt::map_hash(map).c_str());
  return felt::active_voxel_count(map) == 1 ? 0 : 1;
}
