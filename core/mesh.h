#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "core/image.h"

namespace felt {

/// Three vertex numbers, counter-clockwise seen from free space.
using Triangle = Eigen::Matrix<uint32_t, 3, 1>;

/// One number per vertex (or per triangle), saved under its name.
struct MeshScalars {
  std::string name;
  std::vector<float> values;
};

/// Triangle mesh, world frame, metres. Every per-vertex array is empty or as long as `positions`, every per-triangle
/// array empty or as long as `triangles`. Without triangles it is a point cloud.
struct TriangleMesh {
  std::vector<Eigen::Vector3f> positions;
  std::vector<Eigen::Vector3f> normals;  ///< unit, towards free space
  std::vector<Rgba8> colors;             ///< a = 0 where no colour was observed
  std::vector<uint16_t> labels;          ///< class ids of the class table
  std::vector<MeshScalars> scalars;
  std::vector<Triangle> triangles;
  std::vector<MeshScalars> triangle_scalars;

  /// The values called `name`, or nothing.
  static const std::vector<float>* find(const std::vector<MeshScalars>& all, const std::string& name) {
    for (const MeshScalars& s : all)
      if (s.name == name) return &s.values;
    return nullptr;
  }
};

}  // namespace felt
