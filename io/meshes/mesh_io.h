#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "core/mesh.h"

namespace felt {

/// Reads a mesh or point cloud by the name's extension: .ply or .obj. Throws IoError where the file cannot be read and
/// FormatError, with the line or byte, where it does not hold what its header says.
TriangleMesh read_mesh(const std::filesystem::path& path);

/// Throws ConfigError for a name that `write_mesh` cannot write by.
void require_mesh_name(const std::filesystem::path& path);

/// Writes a mesh by the name's extension: .ply, .obj or .glb. Whole or not at all (io/files/atomic_file.h); throws
/// IoError, and ConfigError for another extension.
void write_mesh(const std::filesystem::path& path, const TriangleMesh& mesh);

/// PLY, ASCII or binary of either byte order. Vertex properties x y z, nx ny nz, red green blue, label; every other
/// one becomes a scalar, of vertices and of faces; polygons become fans; other elements are skipped. `where` names the
/// source in messages. Memory is bounded by the size of `bytes`.
TriangleMesh parse_ply(std::string_view bytes, const std::string& where);

/// Binary little-endian PLY: float x y z [nx ny nz] [uchar red green blue] [ushort label] [float <scalar>]...; faces
/// (none for a point cloud) as uchar int lists with their scalars. `comments` go into the header, one a line.
void write_ply(const std::filesystem::path& path, const TriangleMesh& mesh,
               const std::vector<std::string>& comments = {});

/// Wavefront OBJ: vertices (with colours where given after the position), polygons as fans, negative indices. Normals
/// and materials are not read.
TriangleMesh parse_obj(std::string_view bytes, const std::string& where);

/// Wavefront OBJ with colours behind the positions, as MeshLab and Blender read them.
void write_obj(const std::filesystem::path& path, const TriangleMesh& mesh);

/// glTF 2.0 in its binary container, colours as linear COLOR_0 on an unlit material: recorded colours hold the light
/// already. Labels become the attribute _LABEL and each scalar of the vertices one of its own ("friction_mean":
/// _FRICTION_MEAN), float; where a number is not finite it is written as 0, and _FRICTION_MEAN_KNOWN is 0 there,
/// else 1. Axes are the map's, which glTF viewers take for y up.
void write_glb(const std::filesystem::path& path, const TriangleMesh& mesh);

/// One page that shows the mesh in any browser with WebGL 2, without a network: turn, move, come nearer, shading by
/// colour, shape or normals. Positions are kept to 1/65535 of the mesh's box. `up` is the axis that points up at first:
/// +x, -x, +y, -y, +z or -z.
void write_html(const std::filesystem::path& path, const TriangleMesh& mesh, const std::string& title,
                const std::string& up = "+z");

}  // namespace felt
