#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "io/simulation/scene.h"

namespace felt {

/// Triangles of a scene's surface with the truth about each of them. World frame, metres; counter-clockwise from
/// outside.
struct SceneMesh {
  std::vector<Eigen::Vector3f> vertices;
  std::vector<std::array<uint32_t, 3>> triangles;
  std::vector<uint16_t> semantic, material, instance;  ///< per triangle
};

struct SceneMeshOptions {
  double chord_error_m = 2e-4;   ///< curved surfaces: largest distance of a triangle from them
  double border_size_m = 0.005;  ///< faces are cut up to this size where another solid or the scene's bounds cut them
};

/// The surface of the scene's union within its bounds: faces and parts of faces inside another solid, or outside of the
/// bounds, are left out. Flat faces are exact but for a border of `border_size_m` where another solid cuts them.
SceneMesh scene_mesh(const Scene& scene, const SceneMeshOptions& options = {});

/// Binary little-endian PLY; faces carry `uchar semantic`, `uchar material`, `ushort instance`. Throws IoError.
void write_scene_mesh(const SceneMesh& mesh, const std::filesystem::path& file);

}  // namespace felt
