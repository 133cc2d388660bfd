#include "mapping/surface/marching_cubes_table.h"

#include <cassert>
#include <cstddef>
#include <utility>
#include <vector>

namespace felt {
namespace {

constexpr int kCornerBit[3] = {4, 2, 1};

constexpr int edge_between(int a, int b) {
  const int low = a < b ? a : b, x = low >> 2, y = low >> 1 & 1, z = low & 1;
  switch (a ^ b) {
    case 4:
      return y * 2 + z;
    case 2:
      return 4 + x * 2 + z;
    default:
      return 8 + x * 2 + y;
  }
}

/// Corners of the six faces, counter-clockwise seen from outside the cell.
constexpr std::array<std::array<int, 4>, 6> make_faces() {
  std::array<std::array<int, 4>, 6> faces{};
  for (int axis = 0; axis < 3; ++axis) {
    const int w = kCornerBit[axis], u = kCornerBit[(axis + 1) % 3], v = kCornerBit[(axis + 2) % 3];
    faces[2 * axis] = {0, v, u | v, u};
    faces[2 * axis + 1] = {w, w | u, w | u | v, w | v};
  }
  return faces;
}
constexpr auto kFaces = make_faces();

bool share_a_face(int edge_a, int edge_b) {
  for (const auto& face : kFaces) {
    int found = 0;
    for (int i = 0; i < 4; ++i) {
      const int e = edge_between(face[i], face[(i + 1) % 4]);
      found += (e == edge_a) + (e == edge_b);
    }
    if (found == 2) return true;
  }
  return false;
}

/// Triangulates loop[first .. last] without a diagonal inside a face; false where there is no such way.
bool triangulate(const std::vector<int>& loop, int first, int last, std::vector<std::array<int, 3>>& out) {
  if (last - first < 2) return true;
  const size_t before = out.size();
  for (int apex = first + 1; apex < last; ++apex) {
    if (apex > first + 1 && share_a_face(loop[first], loop[apex])) continue;
    if (apex < last - 1 && share_a_face(loop[apex], loop[last])) continue;
    out.push_back({loop[first], loop[apex], loop[last]});
    if (triangulate(loop, first, apex, out) && triangulate(loop, apex, last, out)) return true;
    out.resize(before);
  }
  return false;
}

CubeCase make_case(int negative) {
  // Walking round a face, the surface enters where positive turns negative and leaves where that run ends. An edge is
  // walked in opposite directions by its two faces: it is entered once and left once, and the segments make loops.
  std::array<int, 12> next;
  next.fill(-1);
  for (const auto& face : kFaces) {
    const auto is_negative = [&](int i) { return (negative >> face[i & 3] & 1) != 0; };
    for (int i = 0; i < 4; ++i) {
      if (is_negative(i + 3) || !is_negative(i)) continue;
      int end = i;
      while (is_negative(end + 1)) ++end;
      next[edge_between(face[(i + 3) & 3], face[i])] = edge_between(face[end & 3], face[(end + 1) & 3]);
    }
  }
  CubeCase result;
  for (int start = 0; start < 12; ++start) {
    std::vector<int> loop;
    for (int e = start; next[e] >= 0;) {
      loop.push_back(e);
      e = std::exchange(next[e], -1);
    }
    std::vector<std::array<int, 3>> triangles;
    [[maybe_unused]] const bool done = triangulate(loop, 0, int(loop.size()) - 1, triangles);
    assert(done && result.triangles + triangles.size() <= 5);
    for (const auto& triangle : triangles) {
      for (int i = 0; i < 3; ++i) result.edge[3 * result.triangles + i] = uint8_t(triangle[i]);
      ++result.triangles;
    }
  }
  return result;
}

std::array<CubeEdge, 12> make_edges() {
  std::array<CubeEdge, 12> edges{};
  for (int corner = 0; corner < 8; ++corner)
    for (int axis = 0; axis < 3; ++axis)
      if (!(corner & kCornerBit[axis]))
        edges[edge_between(corner, corner | kCornerBit[axis])] = {uint8_t(axis), uint8_t(corner)};
  return edges;
}

}  // namespace

const std::array<CubeEdge, 12> kCubeEdges = make_edges();

const std::array<CubeCase, 256>& cube_cases() {
  static const std::array<CubeCase, 256> cases = [] {
    std::array<CubeCase, 256> all;
    for (int negative = 0; negative < 256; ++negative) all[negative] = make_case(negative);
    return all;
  }();
  return cases;
}

}  // namespace felt
