#include "mapping/evaluation/mesh_distance.h"

#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace felt {
namespace {
using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr uint32_t kLeafTriangles = 4;
/// Halving 2^32 triangles down to leaves is 31 levels deep; a visit stacks one node a level.
constexpr int kMaxDepth = 40;

double squared_distance_to_box(const Vector3d& p, const Vector3f& low, const Vector3f& high) {
  return (low.cast<double>() - p).cwiseMax(p - high.cast<double>()).cwiseMax(0.0).squaredNorm();
}

/// Where a ray enters a box, or infinity. An inverse direction of infinity is an axis the ray is parallel to.
double box_entry(const Vector3d& origin, const Vector3d& inverse, const Vector3f& low, const Vector3f& high,
                 double limit) {
  double enter = 0, leave = limit;
  for (int i = 0; i < 3; ++i) {
    const double a = (low[i] - origin[i]) * inverse[i], b = (high[i] - origin[i]) * inverse[i];
    // 0 * infinity: the ray runs within the slab's border; NaN must not shrink the interval.
    if (std::isnan(a) || std::isnan(b)) continue;
    enter = std::max(enter, std::min(a, b));
    leave = std::min(leave, std::max(a, b));
  }
  // The box is of floats that bound the triangles exactly; the products above round.
  return enter <= leave * (1 + 1e-12) ? enter : std::numeric_limits<double>::infinity();
}

/// Counter-based random numbers (SplitMix64, Steele et al. 2014): sample i does not depend on the others.
double uniform(uint64_t seed, uint64_t counter) {
  uint64_t z = seed * 0xd1342543de82ef95ull + (counter + 1) * 0x9e3779b97f4a7c15ull;
  z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9ull;
  z = (z ^ z >> 27) * 0x94d049bb133111ebull;
  return double((z ^ z >> 31) >> 11) * 0x1p-53;
}

bool usable(const TriangleMesh& mesh, const Triangle& t) {
  for (int i = 0; i < 3; ++i)
    if (t[i] >= mesh.positions.size() || !mesh.positions[t[i]].allFinite()) return false;
  return true;
}

}  // namespace

Vector3d nearest_on_triangle(const Vector3d& p, const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const Vector3d ab = b - a, ac = c - a, ap = p - a;
  const double d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) return a;
  const Vector3d bp = p - b;
  const double d3 = ab.dot(bp), d4 = ac.dot(bp);
  if (d3 >= 0 && d4 <= d3) return b;
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0 && d1 > d3) return a + d1 / (d1 - d3) * ab;
  const Vector3d cp = p - c;
  const double d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d6 >= 0 && d5 <= d6) return c;
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0 && d2 > d6) return a + d2 / (d2 - d6) * ac;
  const double va = d3 * d6 - d5 * d4, along = d4 - d3, back = d5 - d6;
  if (va <= 0 && along >= 0 && back >= 0 && along + back > 0) return b + along / (along + back) * (c - b);
  const double sum = va + vb + vc;
  // Only a triangle without area gets here with a sum of zero: its corners were tried above to rounding.
  return sum > 0 ? Vector3d(a + vb / sum * ab + vc / sum * ac) : a;
}

TriangleTree::TriangleTree(const TriangleMesh& mesh) {
  corners_.reserve(mesh.triangles.size());
  for (uint32_t i = 0; i < mesh.triangles.size(); ++i) {
    const Triangle& t = mesh.triangles[i];
    if (usable(mesh, t)) corners_.push_back({mesh.positions[t[0]], mesh.positions[t[1]], mesh.positions[t[2]], i});
  }
  nodes_.reserve(corners_.size());
  if (!corners_.empty()) build(0, uint32_t(corners_.size()));
}

void TriangleTree::build(uint32_t first, uint32_t count) {
  Node node;
  node.low = Vector3f::Constant(std::numeric_limits<float>::infinity());
  node.high = -node.low;
  Vector3f low = node.low, high = node.high;  // of the centroids
  const auto centroid = [](const Corners& t) -> Vector3f { return t.a + t.b + t.c; };
  for (uint32_t i = first; i < first + count; ++i) {
    const Corners& t = corners_[i];
    node.low = node.low.cwiseMin(t.a).cwiseMin(t.b).cwiseMin(t.c);
    node.high = node.high.cwiseMax(t.a).cwiseMax(t.b).cwiseMax(t.c);
    const Vector3f m = centroid(t);
    low = low.cwiseMin(m);
    high = high.cwiseMax(m);
  }
  const auto number = uint32_t(nodes_.size());
  node.first = first;
  node.count = count <= kLeafTriangles ? count : 0;
  nodes_.push_back(node);
  if (node.count > 0) return;
  int axis;
  (high - low).maxCoeff(&axis);
  const uint32_t half = count / 2;
  std::nth_element(corners_.begin() + first, corners_.begin() + first + half, corners_.begin() + first + count,
                   [&](const Corners& l, const Corners& r) { return centroid(l)[axis] < centroid(r)[axis]; });
  build(first, half);
  nodes_[number].first = uint32_t(nodes_.size());
  build(first + half, count - half);
}

TriangleTree::Nearest TriangleTree::nearest(const Vector3d& point, double limit_m) const {
  Nearest best;
  if (nodes_.empty() || !point.allFinite()) return best;
  double best_squared = limit_m * limit_m;
  std::array<std::pair<double, uint32_t>, kMaxDepth> stack;
  int size = 0;
  stack[size++] = {squared_distance_to_box(point, nodes_[0].low, nodes_[0].high), 0};
  while (size > 0) {
    const auto [box_squared, number] = stack[--size];
    if (box_squared > best_squared) continue;
    const Node& node = nodes_[number];
    if (node.count == 0) {
      const uint32_t children[2] = {number + 1, node.first};
      const double d0 = squared_distance_to_box(point, nodes_[children[0]].low, nodes_[children[0]].high);
      const double d1 = squared_distance_to_box(point, nodes_[children[1]].low, nodes_[children[1]].high);
      const int near = d1 < d0;
      stack[size++] = {near ? d0 : d1, children[1 - near]};
      stack[size++] = {near ? d1 : d0, children[near]};
      continue;
    }
    for (uint32_t i = node.first; i < node.first + node.count; ++i) {
      const Corners& t = corners_[i];
      const Vector3d q = nearest_on_triangle(point, t.a.cast<double>(), t.b.cast<double>(), t.c.cast<double>());
      const double squared = (q - point).squaredNorm();
      if (squared > best_squared || (squared == best_squared && best.triangle != kNone)) continue;
      best_squared = squared;
      best = {0, q, t.triangle};
    }
  }
  if (best.triangle != kNone) best.distance_m = std::sqrt(best_squared);
  return best;
}

TriangleTree::Hit TriangleTree::first_hit(const Vector3d& origin, const Vector3d& direction, double limit) const {
  Hit best;
  if (nodes_.empty() || !origin.allFinite() || !direction.allFinite()) return best;
  const Vector3d inverse = direction.cwiseInverse();
  double nearest = limit;
  std::array<std::pair<double, uint32_t>, kMaxDepth> stack;
  int size = 0;
  stack[size++] = {box_entry(origin, inverse, nodes_[0].low, nodes_[0].high, nearest), 0};
  while (size > 0) {
    const auto [entry, number] = stack[--size];
    if (!(entry <= nearest) || std::isinf(entry)) continue;
    const Node& node = nodes_[number];
    if (node.count == 0) {
      const uint32_t children[2] = {number + 1, node.first};
      const double e0 = box_entry(origin, inverse, nodes_[children[0]].low, nodes_[children[0]].high, nearest);
      const double e1 = box_entry(origin, inverse, nodes_[children[1]].low, nodes_[children[1]].high, nearest);
      const int near = e1 < e0;
      stack[size++] = {near ? e0 : e1, children[1 - near]};
      stack[size++] = {near ? e1 : e0, children[near]};
      continue;
    }
    for (uint32_t i = node.first; i < node.first + node.count; ++i) {
      const Corners& t = corners_[i];
      const Vector3d a = t.a.cast<double>(), e1 = t.b.cast<double>() - a, e2 = t.c.cast<double>() - a;
      const Vector3d h = direction.cross(e2);
      const double determinant = e1.dot(h);
      if (determinant == 0) continue;
      const Vector3d s = origin - a;
      const double u = s.dot(h) / determinant;
      if (!(u >= 0 && u <= 1)) continue;
      const Vector3d q = s.cross(e1);
      const double v = direction.dot(q) / determinant, distance = e2.dot(q) / determinant;
      if (!(v >= 0 && u + v <= 1 && distance > 0 && distance <= nearest)) continue;
      nearest = distance;
      best = {distance, t.triangle};
    }
  }
  return best;
}

std::vector<float> distances_to_mesh(std::span<const Vector3f> points, const TriangleTree& tree) {
  std::vector<float> distances(points.size());
  tbb::parallel_for(size_t(0), points.size(), [&](size_t i) {
    distances[i] = points[i].allFinite() ? float(tree.nearest(points[i].cast<double>()).distance_m)
                                         : std::numeric_limits<float>::quiet_NaN();
  });
  return distances;
}

SurfaceSamples sample_surface(const TriangleMesh& mesh, size_t count, uint64_t seed) {
  std::vector<double> cumulated(mesh.triangles.size());
  double area = 0;
  for (size_t i = 0; i < mesh.triangles.size(); ++i) {
    const Triangle& t = mesh.triangles[i];
    if (usable(mesh, t)) {
      const Vector3d a = mesh.positions[t[0]].cast<double>();
      area += 0.5 * (mesh.positions[t[1]].cast<double>() - a).cross(mesh.positions[t[2]].cast<double>() - a).norm();
    }
    cumulated[i] = area;
  }
  SurfaceSamples samples;
  if (!(area > 0)) return samples;
  samples.positions.resize(count);
  samples.normals.resize(count);
  samples.triangles.resize(count);
  tbb::parallel_for(size_t(0), count, [&](size_t i) {
    const double at = (double(i) + uniform(seed, 3 * i)) / double(count) * area;
    const auto found = std::upper_bound(cumulated.begin(), cumulated.end(), at) - cumulated.begin();
    const auto number = uint32_t(std::min<size_t>(size_t(found), cumulated.size() - 1));
    const Triangle& t = mesh.triangles[number];
    const Vector3d a = mesh.positions[t[0]].cast<double>();
    const Vector3d ab = mesh.positions[t[1]].cast<double>() - a, ac = mesh.positions[t[2]].cast<double>() - a;
    double u = uniform(seed, 3 * i + 1), v = uniform(seed, 3 * i + 2);
    if (u + v > 1) u = 1 - u, v = 1 - v;
    samples.positions[i] = (a + u * ab + v * ac).cast<float>();
    samples.normals[i] = ab.cross(ac).normalized().cast<float>();
    samples.triangles[i] = number;
  });
  return samples;
}

}  // namespace felt
