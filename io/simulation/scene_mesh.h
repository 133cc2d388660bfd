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

/// The surface of the scene's union within its bounds: faces and parts of faces inside another solid, or outside of the
/// bounds, are left out. Where solids share a part of a face, the first of them keeps it. Flat surfaces are exact;
/// spheres and cylinders are polyhedra with their corners on the surface, no point farther from it than
/// `chord_error_m`.
SceneMesh scene_mesh(const Scene& scene, double chord_error_m = 2e-4);

/// Binary little-endian PLY; faces carry `uchar semantic`, `uchar material`, `ushort instance`. Throws IoError.
void write_scene_mesh(const SceneMesh& mesh, const std::filesystem::path& file);

}  // namespace felt
