#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "core/mesh.h"

namespace felt {

/// The triangles of a mesh in a tree of boxes, for exact nearest-point and ray queries. Holds its own copy of the
/// corners. Queries may run in parallel. Triangles with a vertex number out of range or a coordinate that is not
/// finite are left out.
class TriangleTree {
public:
  static constexpr uint32_t kNone = 0xffffffff;

  struct Nearest {
    double distance_m = std::numeric_limits<double>::infinity();
    Eigen::Vector3d point = Eigen::Vector3d::Zero();  ///< on the mesh
    uint32_t triangle = kNone;                        ///< number in the mesh; of equally near ones any
  };
  struct Hit {
    double distance = std::numeric_limits<double>::infinity();  ///< in lengths of the direction
    uint32_t triangle = kNone;
  };

  explicit TriangleTree(const TriangleMesh& mesh);

  /// Nearest point of the mesh, exact to rounding in double. Nothing (kNone, infinity) where the tree is empty or
  /// nothing is nearer than `limit_m`.
  Nearest nearest(const Eigen::Vector3d& point, double limit_m = std::numeric_limits<double>::infinity()) const;
  /// First triangle, seen from either side, that a ray meets at a distance in (0, limit] (Möller and Trumbore 1997).
  Hit first_hit(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                double limit = std::numeric_limits<double>::infinity()) const;
  bool empty() const { return corners_.empty(); }

private:
  struct Node {
    Eigen::Vector3f low, high;
    uint32_t first = 0;  ///< leaf: first triangle; else: number of the second child (the first one follows its parent)
    uint32_t count = 0;  ///< triangles of a leaf, 0 of an inner node
  };
  struct Corners {
    Eigen::Vector3f a, b, c;
    uint32_t triangle;
  };
  void build(uint32_t first, uint32_t count);

  std::vector<Corners> corners_;
  std::vector<Node> nodes_;
};

/// Nearest point of a triangle (Ericson, Real-Time Collision Detection, 2005, section 5.1.5).
Eigen::Vector3d nearest_on_triangle(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                                    const Eigen::Vector3d& c);

/// Exact distance of every point to the mesh, metres, in parallel; infinity where the mesh has no triangles, NaN for a
/// point that is not finite.
std::vector<float> distances_to_mesh(std::span<const Eigen::Vector3f> points, const TriangleTree& tree);

/// Points spread evenly over the area of a mesh.
struct SurfaceSamples {
  std::vector<Eigen::Vector3f> positions;
  std::vector<Eigen::Vector3f> normals;  ///< of the triangle, unit
  std::vector<uint32_t> triangles;
};

/// `count` points, uniform in area, the same for the same mesh and seed: stratified along the cumulated area (one point
/// in each of `count` equal shares), uniform within the triangle. Empty for a mesh without area.
SurfaceSamples sample_surface(const TriangleMesh& mesh, size_t count, uint64_t seed = 1);

}  // namespace felt
