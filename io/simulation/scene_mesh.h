#pragma once

#include <filesystem>

#include "core/mesh.h"
#include "io/simulation/scene.h"

namespace felt {

/// The surface of the scene's union within its bounds: faces and parts of faces inside another solid, or outside of the
/// bounds, are left out. Where solids share a part of a face, the first of them keeps it. Flat surfaces are exact;
/// spheres and cylinders are polyhedra with their corners on the surface, no point farther from it than
/// `chord_error_m`. Triangle scalars: "semantic", "material", "instance".
TriangleMesh scene_mesh(const Scene& scene, double chord_error_m = 2e-4);

/// Binary little-endian PLY of a scene's mesh: vertices as float, faces with `uchar semantic`, `uchar material`,
/// `ushort instance`. Throws IoError.
void write_scene_mesh(const TriangleMesh& mesh, const std::filesystem::path& file);

}  // namespace felt
