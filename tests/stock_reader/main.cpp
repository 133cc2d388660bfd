// Reads a VDB file with nothing but OpenVDB and prints what any other program would find in it, one grid a line:
// name, value type, class, active voxels, edge of a voxel, least and greatest active value.
// usage: stock_vdb_reader FILE
#include <openvdb/openvdb.h>
#include <openvdb/tools/Count.h>

#include <algorithm>
#include <cstdio>
#include <string>

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  try {
    openvdb::initialize();
    openvdb::io::File file(argv[1]);
    file.open();
    const openvdb::GridPtrVecPtr grids = file.getGrids();
    for (const openvdb::GridBase::Ptr& grid : *grids) {
      std::string grid_class = openvdb::GridBase::gridClassToString(grid->getGridClass());
      std::replace(grid_class.begin(), grid_class.end(), ' ', '_');
      std::printf("%s %s %s %llu %g", grid->getName().c_str(), grid->valueType().c_str(), grid_class.c_str(),
                  static_cast<unsigned long long>(grid->activeVoxelCount()), grid->voxelSize().x());
      if (const auto values = openvdb::gridPtrCast<openvdb::FloatGrid>(grid)) {
        const auto range = openvdb::tools::minMax(values->tree());
        std::printf(" %g %g", double(range.min()), double(range.max()));
      }
      std::printf("\n");
    }
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s\n", e.what());
    return 1;
  }
  return 0;
}
