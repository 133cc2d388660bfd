// Save and load of the map file against OpenVDB's own stream on the same grids, with one thread, in a folder that is in
// memory. Rates are bytes of planes in memory (what the map holds) per second of processor time of the whole call.
//   bench_map_file fast|none|blosc|zip [blocks along a side of the wall] [folder]
//   bench_map_file grids [blocks along a side of the wall] [folder]       memory with 1,000 grids
#include <openvdb/io/Stream.h>
#include <openvdb/openvdb.h>
#include <sys/resource.h>
#include <tbb/global_control.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <functional>
#include <utility>

#include "core/median.h"
#include "io/map_file/map_file.h"
#include "io/map_file/map_grids.h"

namespace {

using namespace felt;
namespace fs = std::filesystem;

/// Processor time: one thread and no disk, so it is the time that the call takes on a machine with nothing else to do.
double seconds(const std::function<void()>& work) {
  const auto now = [] {
    timespec t{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
  };
  const double start = now();
  work();
  return now() - start;
}

double median_of_five_s(const std::function<void()>& work) {
  std::vector<double> spent_s(5);
  for (double& s : spent_s) s = seconds(work);
  return median(std::move(spent_s));
}

/// A coloured wall with sensor-like noise and one to three classes a block: values as in a reconstruction.
Map wall(int side, int classes) {
  Map map(0.02, 0.08);
  std::vector<ClassInfo> table;
  for (int i = 0; i < classes; ++i) table.push_back({uint16_t(i + 1), "class " + std::to_string(i), {}, false});
  map.classes = ClassTable(table);
  uint64_t state = 1;
  const auto random = [&] {
    state = state * 6364136223846793005ull + 1442695040888963407ull;
    return float(state >> 40) * 0x1p-24f;
  };
  for (int bx = 0; bx < side; ++bx)
    for (int by = 0; by < side; ++by) {
      Block& block = map.store[map.store.find_or_create({bx, by, 0})];
      ColorPlanes& color = map.store.add_color(block);
      for (int s = 0; s < std::min(classes, 1 + (bx + by) % 3); ++s)
        block.evidence.push_back({uint16_t((bx * 7 + by + s) % classes), map.store.new_plane()});
      std::sort(block.evidence.begin(), block.evidence.end(), [](auto& a, auto& b) { return a.slot < b.slot; });
      for (int i = 0; i < kBlockVoxels; ++i) {
        block.geometry->tsdf[i] = std::clamp((float(i & 7) - 3.5f + random()) * 0.02f, -0.08f, 0.08f);
        block.geometry->weight[i] = 40 + 10 * random();
        color.r[i] = uint16_t(30000 + 4000 * random());
        color.g[i] = uint16_t(20000 + 4000 * random());
        color.b[i] = uint16_t(40000 + 4000 * random());
        color.count[i] = uint16_t(30 + 10 * random());
        for (EvidencePlane& e : block.evidence) e.counts->value[i] = float(int(20 * random()));
      }
    }
  return map;
}

double plane_bytes(const Map& map) {
  double bytes = 0;
  for (const Block& b : map.store.blocks())
    bytes += sizeof(GeometryPlanes) + (b.color != nullptr ? sizeof(ColorPlanes) : 0) +
             double(b.evidence.size()) * sizeof(Plane);
  return bytes;
}

void require_same(const Map& a, const Map& b) {
  if (map_hash(a) == map_hash(b)) return;
  std::fprintf(stderr, "the loaded map is another one\n");
  std::exit(1);
}

uint32_t stock_flags(MapCompression compression) {
  // OpenVDB compresses with Blosc unless told otherwise.
  if (compression == MapCompression::blosc || compression == MapCompression::fast)
    return openvdb::io::COMPRESS_ACTIVE_MASK | openvdb::io::COMPRESS_BLOSC;
  if (compression == MapCompression::zip) return openvdb::io::COMPRESS_ACTIVE_MASK | openvdb::io::COMPRESS_ZIP;
  return openvdb::io::COMPRESS_ACTIVE_MASK;
}

/// A line for the state alone and one with views; the same grids through OpenVDB's stream beside each.
void measure(const Map& map, MapCompression compression, const char* name, const fs::path& folder) {
  const fs::path path = folder / "map.vdb", stock = folder / "stock.vdb";
  const double bytes = plane_bytes(map), mb = bytes / 1e6;
  for (const bool views : {false, true}) {
    const double save_s = median_of_five_s([&] { save_map(map, path, {.compression = compression, .views = views}); });
    const double load_s = median_of_five_s([&] { (void)load_map(path); });
    require_same(load_map(path), map);
    // OpenVDB alone: the same grids, made beforehand.
    openvdb::GridPtrVec grids;
    for (const LeafGrid& grid : views ? map_grids(map) : state_grids(map)) grids.push_back(stock_grid(grid));
    const double write_s = median_of_five_s([&] {
      std::ofstream os(stock, std::ios::binary);
      openvdb::io::Stream stream(os);
      stream.setCompression(stock_flags(compression));
      stream.write(grids);
    });
    const double read_s = median_of_five_s([&] {
      std::ifstream is(stock, std::ios::binary);
      (void)openvdb::io::Stream(is, /*delayLoad=*/false).getGrids();
    });
    std::printf(
        "%-6s %-10s %zu grids, %.0f MB of planes, file/planes %.2f (OpenVDB's stream %.2f); save %.0f MB/s, load %.0f "
        "MB/s; OpenVDB's stream: write %.0f MB/s, read %.0f MB/s\n",
        name, views ? "with views" : "state", grids.size(), mb, double(fs::file_size(path)) / bytes,
        double(fs::file_size(stock)) / bytes, mb / save_s, mb / load_s, mb / write_s, mb / read_s);
    std::fflush(stdout);
  }
}

double peak_rss_mib() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return double(usage.ru_maxrss) / 1024;
}

void measure_memory(int side, const fs::path& folder) {
  const Map map = wall(side, 1000);
  std::printf("1,000 classes, %zu blocks, %.0f MB of planes: peak %.0f MiB before saving", map.store.size(),
              plane_bytes(map) / 1e6, peak_rss_mib());
  const double save_s = seconds([&] { save_map(map, folder / "map.vdb"); });
  std::printf(", %.0f MiB after saving in %.2f s", peak_rss_mib(), save_s);
  const double load_s = seconds([&] { require_same(load_map(folder / "map.vdb"), map); });
  std::printf(", %.0f MiB with both maps after loading in %.2f s\n", peak_rss_mib(), load_s);
}

}  // namespace

int main(int argc, char** argv) {
  openvdb::initialize();
  const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
  const std::string what = argc > 1 ? argv[1] : "fast";
  const int side = argc > 2 ? std::stoi(argv[2]) : 120;
  const fs::path folder = fs::path(argc > 3 ? argv[3] : "/dev/shm") / ("feltmap-bench-" + std::to_string(getpid()));
  fs::create_directories(folder);
  if (what == "grids") {
    measure_memory(side, folder);
  } else {
    const MapCompression compression = what == "none"    ? MapCompression::none
                                       : what == "zip"   ? MapCompression::zip
                                       : what == "blosc" ? MapCompression::blosc
                                                         : MapCompression::fast;
    measure(wall(side, 20), compression, what.c_str(), folder);
  }
  fs::remove_all(folder);
}
