#pragma once

#include "core/mesh.h"
#include "mapping/map.h"
#include "mapping/store/region.h"

namespace felt {

/// The part of the map's surface that belongs to a region: triangles with at least two vertices nearest to a voxel of
/// it. Normals and colours as of `extract_mesh`, labels and scalars as of `attach_beliefs`.
TriangleMesh region_mesh(const Map& map, const Region& region);

}  // namespace felt
