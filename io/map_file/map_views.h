#pragma once

#include <cstddef>
#include <vector>

#include "io/map_file/vdb_reader.h"
#include "mapping/maps/map_verify.h"

namespace felt {

/// What a file's views say that does not follow from its map: for each grid the voxels that are active where they
/// should not be, or the other way round, or hold another value. Floats may differ by their rounding: another processor
/// adds in another order. A file may lack any view. Also grids of classes, touches and properties that the map has not.
/// `compared`: the number of views there are. Throws FormatError for a view that cannot be read or is of another type.
std::vector<MapFault> view_faults(const VdbReader& file, const Map& map, size_t& compared);

}  // namespace felt
