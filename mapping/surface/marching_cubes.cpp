#include "mapping/surface/marching_cubes.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "mapping/surface/marching_cubes_table.h"

namespace felt {
namespace {

constexpr float kNearestToVoxel = 1.0f / 1024;

/// One bit per voxel of a block: slice x, bit 8 y + z.
using BlockBits = std::array<uint64_t, kBlockDim>;

/// What the first pass keeps of a block.
struct BlockSigns {
  BlockBits negative{};  ///< observed and tsdf < 0
  BlockBits observed{};
  bool any_negative = false, any_positive = false;
};
constexpr BlockSigns kNothing{};

/// What the second pass keeps of a block that owns vertices or triangles.
struct BlockSurface {
  std::array<BlockBits, 3> edges{};  ///< [axis]: a vertex lies between this voxel and the next along the axis
  BlockBits cells{};                 ///< cells that give triangles
  std::array<std::array<uint16_t, kBlockDim>, 3> first{};  ///< rank of the first vertex of each axis and slice
  uint32_t vertex_count = 0, triangle_count = 0;
  uint32_t vertex_base = 0, triangle_base = 0;

  uint32_t vertex_number(int axis, int x, int bit) const {
    const uint64_t before = edges[axis][x] & ((uint64_t(1) << bit) - 1);
    return vertex_base + first[axis][x] + uint32_t(std::popcount(before));
  }
};

/// The eight lowest bits of eight bytes that are 0 or 1, byte i to bit i.
uint64_t pack_bits(const uint8_t flags[8]) {
  uint64_t bytes = 0;
  for (int i = 0; i < 8; ++i) bytes |= uint64_t(flags[i]) << (8 * i);
  return bytes * 0x0102040810204080ull >> 56;
}

/// Asks for planes ahead of their use: the step from one block's to the next's is one that no processor foresees.
template <typename Planes>
void prefetch(const Planes& planes) {
  const auto* bytes = reinterpret_cast<const char*>(&planes);
  for (size_t i = 0; i < sizeof planes; i += 64) __builtin_prefetch(bytes + i);
}

BlockSigns signs_of(const GeometryPlanes& planes, float min_weight) {
  BlockSigns signs;
  uint64_t any_negative = 0, any_positive = 0;
  for (int x = 0; x < kBlockDim; ++x) {
    uint8_t observed[64], negative[64];
    const float* weight = planes.weight + 64 * x;
    const float* tsdf = planes.tsdf + 64 * x;
    for (int i = 0; i < 64; ++i) observed[i] = weight[i] >= min_weight;
    for (int i = 0; i < 64; ++i) negative[i] = tsdf[i] < 0;
    for (int y = 0; y < kBlockDim; ++y) {
      signs.observed[x] |= pack_bits(observed + 8 * y) << (8 * y);
      signs.negative[x] |= pack_bits(negative + 8 * y) << (8 * y);
    }
    signs.negative[x] &= signs.observed[x];
    any_negative |= signs.negative[x];
    any_positive |= signs.observed[x] & ~signs.negative[x];
  }
  signs.any_negative = any_negative != 0;
  signs.any_positive = any_positive != 0;
  return signs;
}

/// Rows of ten bits, z = -1 .. 8, for x and y = -1 .. 8 around a block.
using Rows = std::array<std::array<uint16_t, 10>, 10>;

/// T around one block: entry 9 (dx + 1) + 3 (dy + 1) + dz + 1.
template <typename T>
using Neighbors = std::array<const T*, 27>;
constexpr int neighbor(int dx, int dy, int dz) { return 9 * (dx + 1) + 3 * (dy + 1) + dz + 1; }
constexpr int kSelf = neighbor(0, 0, 0);

void gather_rows(const Neighbors<BlockSigns>& around, BlockBits BlockSigns::*bits, Rows& rows) {
  for (int x = -1; x <= 8; ++x)
    for (int y = -1; y <= 8; ++y) {
      const BlockSigns* const* along_z = &around[neighbor(x >> 3, y >> 3, -1)];
      const int shift = 8 * (y & 7);
      const uint32_t below = (along_z[0]->*bits)[x & 7] >> shift >> 7 & 1;
      const uint32_t here = (along_z[1]->*bits)[x & 7] >> shift & 0xff;
      const uint32_t above = (along_z[2]->*bits)[x & 7] >> shift & 1;
      rows[x + 1][y + 1] = uint16_t(below | here << 1 | above << 9);
    }
}

/// The case of the cell at row indices (x, y, z): bit c set where corner c is negative.
int corner_pattern(const Rows& negative, int x, int y, int z) {
  return (negative[x][y] >> z & 3) * 1 |       //
         (negative[x][y + 1] >> z & 3) << 2 |  //
         (negative[x + 1][y] >> z & 3) << 4 |  //
         (negative[x + 1][y + 1] >> z & 3) << 6;
}

BlockSurface surface_of(const Neighbors<BlockSigns>& around) {
  Rows negative, observed;
  gather_rows(around, &BlockSigns::negative, negative);
  gather_rows(around, &BlockSigns::observed, observed);

  // Bit z + 1 of valid[x + 1][y + 1]: the cell above voxel (x, y, z) has eight observed corners, x, y, z = -1 .. 7.
  Rows valid;
  for (int x = 0; x < 9; ++x)
    for (int y = 0; y < 9; ++y) {
      const uint32_t four = observed[x][y] & observed[x][y + 1] & observed[x + 1][y] & observed[x + 1][y + 1];
      valid[x][y] = uint16_t(four & four >> 1 & 0x1ff);
    }

  BlockSurface surface;
  const auto& cases = cube_cases();
  for (int x = 1; x <= 8; ++x)
    for (int y = 1; y <= 8; ++y) {
      const uint32_t n = negative[x][y];
      const uint32_t around_x = valid[x][y] | valid[x][y - 1], around_y = valid[x][y] | valid[x - 1][y];
      const uint32_t around_z = around_x | valid[x - 1][y] | valid[x - 1][y - 1];
      const uint32_t crossing[3] = {(n ^ negative[x + 1][y]) & (around_x | around_x << 1),
                                    (n ^ negative[x][y + 1]) & (around_y | around_y << 1), (n ^ n >> 1) & around_z};
      const int shift = 8 * (y - 1);
      for (int axis = 0; axis < 3; ++axis) surface.edges[axis][x - 1] |= uint64_t(crossing[axis] >> 1 & 0xff) << shift;

      const uint32_t n10 = negative[x + 1][y], n01 = negative[x][y + 1], n11 = negative[x + 1][y + 1];
      const uint32_t any = n | n10 | n01 | n11, all = n & n10 & n01 & n11;
      uint32_t mixed = (any | any >> 1) & ~(all & all >> 1) & valid[x][y] & 0x1fe;
      surface.cells[x - 1] |= uint64_t(mixed >> 1) << shift;
      for (; mixed != 0; mixed &= mixed - 1)
        surface.triangle_count += cases[corner_pattern(negative, x, y, std::countr_zero(mixed))].triangles;
    }
  for (int axis = 0; axis < 3; ++axis)
    for (int x = 0; x < kBlockDim; ++x) {
      surface.first[axis][x] = uint16_t(surface.vertex_count);
      surface.vertex_count += uint32_t(std::popcount(surface.edges[axis][x]));
    }
  return surface;
}

/// Bit y of the rows of a slice that hold any bit.
uint32_t rows_of(uint64_t slice) {
  slice |= slice >> 4;
  slice |= slice >> 2;
  slice |= slice >> 1;
  return uint32_t((slice & 0x0101010101010101ull) * 0x0102040810204080ull >> 56);
}

/// By x + 1: bit y + 1 of the rows (x, y), x and y in -1 .. 9, that gradients at both ends of the block's vertices
/// read.
std::array<uint16_t, 11> rows_read(const BlockSurface& surface) {
  std::array<uint16_t, 11> rows{};
  for (int x = 0; x < kBlockDim; ++x) {
    const uint32_t along_x = rows_of(surface.edges[0][x]), along_y = rows_of(surface.edges[1][x]),
                   along_z = rows_of(surface.edges[2][x]);
    // Ends of the edges: (x, y) and the next along their axis. Gradients reach one row further in x and in y.
    const uint32_t ends = along_x | along_z | along_y | along_y << 1;
    rows[x] |= uint16_t(ends << 1);
    rows[x + 1] |= uint16_t(ends | ends << 1 | ends << 2 | along_x << 1);
    rows[x + 2] |= uint16_t(ends << 1 | along_x | along_x << 1 | along_x << 2);
    rows[x + 3] |= uint16_t(along_x << 1);
  }
  return rows;
}

/// Signed distances of a block and its surroundings, voxels -1 .. 9 along each axis: what the gradient at both ends of
/// the block's own edges needs. NaN where not observed.
class DistanceWindow {
public:
  static constexpr int kSide = 11;
  static constexpr int kStep[3] = {kSide * kSide, kSide, 1};
  static constexpr int at(int x, int y, int z) { return ((x + 1) * kSide + y + 1) * kSide + z + 1; }

  /// Only the rows that `rows_read` names.
  void load(const Neighbors<GeometryPlanes>& around, float min_weight, const std::array<uint16_t, kSide>& rows) {
    for (int x = -1; x <= 9; ++x)
      for (uint32_t left = rows[size_t(x + 1)]; left != 0; left &= left - 1) {
        const int y = std::countr_zero(left) - 1;
        const GeometryPlanes* const* along_z = &around[neighbor(x >> 3, y >> 3, -1)];
        const int row = voxel_offset(x & 7, y & 7, 0);
        float* to = distance_ + at(x, y, -1);
        copy<1>(along_z[0], row + 7, min_weight, to);
        copy<8>(along_z[1], row, min_weight, to + 1);
        copy<2>(along_z[2], row, min_weight, to + 9);
      }
  }
  float operator[](int i) const { return distance_[i]; }

  /// Metres per voxel along one axis; zero where neither neighbour was observed.
  float slope(int i, int step) const {
    const float low = distance_[i - step], high = distance_[i + step];
    if (low == low) return high == high ? 0.5f * (high - low) : distance_[i] - low;
    return high == high ? high - distance_[i] : 0.0f;
  }
  Eigen::Vector3f gradient(int i) const { return {slope(i, kStep[0]), slope(i, kStep[1]), slope(i, kStep[2])}; }

private:
  template <int n>
  static void copy(const GeometryPlanes* from, int first, float min_weight, float* to) {
    constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();
    if (from == nullptr) {
      std::fill_n(to, n, kUnknown);
      return;
    }
    for (int i = 0; i < n; ++i) to[i] = from->weight[first + i] >= min_weight ? from->tsdf[first + i] : kUnknown;
  }
  float distance_[kSide * kSide * kSide];
};

/// Colour between two voxels; where only one has any, its own.
Rgba8 interpolated_color(const ColorPlanes* low, int low_offset, const ColorPlanes* high, int high_offset, float t) {
  const bool has_low = low != nullptr && low->count[low_offset] > 0;
  const bool has_high = high != nullptr && high->count[high_offset] > 0;
  if (!has_low && !has_high) return {128, 128, 128, 0};
  const float w = !has_low ? 1.0f : !has_high ? 0.0f : t;
  const auto mix = [&](const uint16_t* l, const uint16_t* h) {
    const float a = has_low ? l[low_offset] : 0.0f, b = has_high ? h[high_offset] : 0.0f;
    return uint8_t(std::min(255.0f, ((1 - w) * a + w * b) * (1.0f / 256) + 0.5f));
  };
  const ColorPlanes& l = has_low ? *low : *high;
  const ColorPlanes& h = has_high ? *high : *low;
  return {mix(l.r, h.r), mix(l.g, h.g), mix(l.b, h.b), 255};
}

class MarchingCubes {
public:
  MarchingCubes(const Map& map, const MeshOptions& options) : map_(map), options_(options), order_(map.store.sorted()) {
    // Weight 0 means "never observed" whatever the caller asks for.
    options_.min_weight = std::max(options.min_weight, std::numeric_limits<float>::min());
    rank_.resize(order_.size());
    for (uint32_t n = 0; n < order_.size(); ++n) rank_[order_[n]] = n;
  }

  TriangleMesh run(std::vector<VertexEdge>* edges) {
    const size_t n = order_.size();
    signs_.resize(n);
    surfaces_.resize(n);
    around_.resize(n);
    tbb::parallel_for(size_t(0), n, [&](size_t i) { signs_[i] = signs_of(*block(i).geometry, options_.min_weight); });
    tbb::parallel_for(size_t(0), n, [&](size_t i) {
      if (!may_cross(i)) return;
      around_[i] = numbers_around(i);
      surfaces_[i] = surface_of(neighbors<BlockSigns>(i, &kNothing, [&](uint32_t j) { return &signs_[j]; }));
    });
    size_t vertices = 0, triangles = 0;
    bool colored = false;
    for (size_t i = 0; i < n; ++i) {
      surfaces_[i].vertex_base = uint32_t(vertices);
      surfaces_[i].triangle_base = uint32_t(triangles);
      vertices += surfaces_[i].vertex_count;
      triangles += surfaces_[i].triangle_count;
      colored |= block(i).color != nullptr;
    }
    if (vertices > std::numeric_limits<uint32_t>::max())
      throw Error(describe_mismatch("mesh", "vertices", "at most 2^32 - 1", std::to_string(vertices)));
    TriangleMesh mesh;
    mesh.positions.resize(vertices);
    mesh.triangles.resize(triangles);
    if (options_.normals) mesh.normals.resize(vertices);
    if (options_.colors && colored) mesh.colors.resize(vertices);
    if (edges != nullptr) edges->resize(vertices);
    tbb::parallel_for(size_t(0), n, [&](size_t i) {
      if (surfaces_[i].vertex_count + surfaces_[i].triangle_count == 0) return;
      if (i + 1 < n && surfaces_[i + 1].vertex_count > 0) {
        prefetch(*block(i + 1).geometry);
        if (!mesh.colors.empty() && block(i + 1).color != nullptr) prefetch(*block(i + 1).color);
      }
      DistanceWindow window;
      window.load(neighbors<GeometryPlanes>(i, nullptr, [&](uint32_t j) { return block(j).geometry; }),
                  options_.min_weight, rows_read(surfaces_[i]));
      emit_vertices(i, window, mesh, edges);
      if (surfaces_[i].triangle_count > 0) emit_triangles(i, mesh);
    });
    return mesh;
  }

private:
  const Block& block(size_t i) const { return map_.store[order_[i]]; }

  /// Canonical number of the block at an offset from block i, or kNone.
  uint32_t find(size_t i, int dx, int dy, int dz) const {
    const BlockCoord& c = block(i).coord;
    const uint32_t found = map_.store.find({c.x + dx, c.y + dy, c.z + dz});
    return found == BlockStore::kNone ? found : rank_[found];
  }

  std::array<uint32_t, 27> numbers_around(size_t i) const {
    std::array<uint32_t, 27> around;
    for (int dx = -1; dx <= 1; ++dx)
      for (int dy = -1; dy <= 1; ++dy)
        for (int dz = -1; dz <= 1; ++dz)
          around[neighbor(dx, dy, dz)] = neighbor(dx, dy, dz) == kSelf ? uint32_t(i) : find(i, dx, dy, dz);
    return around;
  }

  template <typename T, typename Get>
  Neighbors<T> neighbors(size_t i, const T* absent, Get get) const {
    Neighbors<T> around;
    for (size_t at = 0; at < around.size(); ++at)
      around[at] = around_[i][at] == BlockStore::kNone ? absent : get(around_[i][at]);
    return around;
  }

  /// Whether both signs occur in the block and the blocks that its cells reach into.
  bool may_cross(size_t i) const {
    bool negative = signs_[i].any_negative, positive = signs_[i].any_positive;
    if (!negative && !positive) return false;
    for (int d = 1; d < 8 && !(negative && positive); ++d) {
      const uint32_t j = find(i, d >> 2, d >> 1 & 1, d & 1);
      if (j == BlockStore::kNone) continue;
      negative |= signs_[j].any_negative;
      positive |= signs_[j].any_positive;
    }
    return negative && positive;
  }

  void emit_vertices(size_t i, const DistanceWindow& window, TriangleMesh& mesh, std::vector<VertexEdge>* edges) const {
    const BlockSurface& surface = surfaces_[i];
    const Block& here = block(i);
    const Index3 origin = first_voxel(here.coord);
    const auto scale = float(map_.voxel_size_m);
    uint32_t vertex = surface.vertex_base;
    for (int axis = 0; axis < 3; ++axis) {
      const int step = DistanceWindow::kStep[axis];
      const uint32_t after = around_[i][neighbor(axis == 0, axis == 1, axis == 2)];
      const ColorPlanes* color_after = after == BlockStore::kNone ? nullptr : block(after).color;
      for (int x = 0; x < kBlockDim; ++x)
        for (uint64_t bits = surface.edges[axis][x]; bits != 0; bits &= bits - 1, ++vertex) {
          const int bit = std::countr_zero(bits), y = bit >> 3, z = bit & 7, low = DistanceWindow::at(x, y, z);
          const float d0 = window[low], d1 = window[low + step];
          const float t = std::clamp(d0 / (d0 - d1), kNearestToVoxel, 1 - kNearestToVoxel);
          const Index3 voxel{origin.x + x, origin.y + y, origin.z + z};
          // In double: far from the origin a float index would round the position to more than a float can hold.
          Eigen::Vector3d p(voxel.x, voxel.y, voxel.z);
          p[axis] += t;
          mesh.positions[vertex] = (p * map_.voxel_size_m).cast<float>();
          if (!mesh.normals.empty()) {
            const Eigen::Vector3f gradient = (1 - t) * window.gradient(low) + t * window.gradient(low + step);
            const float norm = gradient.norm();
            mesh.normals[vertex] = norm > 1e-6f * scale
                                       ? Eigen::Vector3f(gradient / norm)
                                       : Eigen::Vector3f(Eigen::Vector3f::Unit(axis) * (d1 > d0 ? 1.0f : -1.0f));
          }
          if (!mesh.colors.empty()) {
            const int coordinate = axis == 0 ? x : axis == 1 ? y : z;
            const int offset = 64 * x + bit, plane_step = axis == 0 ? 64 : axis == 1 ? 8 : 1;
            const bool inside = coordinate < kBlockDim - 1;
            mesh.colors[vertex] =
                interpolated_color(here.color, offset, inside ? here.color : color_after,
                                   inside ? offset + plane_step : offset - (kBlockDim - 1) * plane_step, t);
          }
          if (edges != nullptr) (*edges)[vertex] = {voxel, uint8_t(axis), t};
        }
    }
  }

  void emit_triangles(size_t i, TriangleMesh& mesh) const {
    // Vertex number of every edge that the block's cells touch, by axis and voxel 0 .. 8; only crossing edges are
    // written and read.
    constexpr int kSide = kBlockDim + 1;
    uint32_t numbers[3][kSide * kSide * kSide];
    const BlockSurface& surface = surfaces_[i];
    for (int d = 0; d < 8; ++d) {
      const int dx = d >> 2, dy = d >> 1 & 1, dz = d & 1;
      const uint32_t j = around_[i][neighbor(dx, dy, dz)];
      if (j == BlockStore::kNone) continue;
      const BlockSurface& owner = surfaces_[j];
      // Of a neighbour only the voxels of the shared side: the first slice, row or column.
      const uint64_t mask = (dy ? 0xffull : ~0ull) & (dz ? 0x0101010101010101ull : ~0ull);
      for (int axis = 0; axis < 3; ++axis)
        for (int x = 0; x < (dx ? 1 : kBlockDim); ++x)
          for (uint64_t bits = owner.edges[axis][x] & mask; bits != 0; bits &= bits - 1) {
            const int bit = std::countr_zero(bits), y = bit >> 3, z = bit & 7;
            numbers[axis][((x + 8 * dx) * kSide + y + 8 * dy) * kSide + z + 8 * dz] = owner.vertex_number(axis, x, bit);
          }
    }
    Rows negative;
    gather_rows(neighbors<BlockSigns>(i, &kNothing, [&](uint32_t j) { return &signs_[j]; }), &BlockSigns::negative,
                negative);
    const auto& cases = cube_cases();
    Triangle* out = mesh.triangles.data() + surface.triangle_base;
    for (int x = 0; x < kBlockDim; ++x)
      for (uint64_t bits = surface.cells[x]; bits != 0; bits &= bits - 1) {
        const int bit = std::countr_zero(bits), y = bit >> 3, z = bit & 7;
        const CubeCase& cube = cases[corner_pattern(negative, x + 1, y + 1, z + 1)];
        const auto vertex = [&](int e) {
          const CubeEdge& edge = kCubeEdges[cube.edge[e]];
          const int dx = edge.corner >> 2, dy = edge.corner >> 1 & 1, dz = edge.corner & 1;
          return numbers[edge.axis][((x + dx) * kSide + y + dy) * kSide + z + dz];
        };
        for (int t = 0; t < cube.triangles; ++t) *out++ = {vertex(3 * t), vertex(3 * t + 1), vertex(3 * t + 2)};
      }
  }

  const Map& map_;
  MeshOptions options_;
  std::vector<uint32_t> order_;  ///< block numbers, canonical
  std::vector<uint32_t> rank_;   ///< the inverse
  std::vector<BlockSigns> signs_;
  std::vector<BlockSurface> surfaces_;
  std::vector<std::array<uint32_t, 27>> around_;  ///< canonical numbers around blocks that the surface may cross
};

}  // namespace

TriangleMesh extract_mesh(const Map& map, const MeshOptions& options, std::vector<VertexEdge>* edges) {
  return MarchingCubes(map, options).run(edges);
}

}  // namespace felt
