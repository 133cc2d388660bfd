#include "io/meshes/mesh_io.h"

#include <algorithm>
#include <cctype>
#include <cstdint>

#include "core/error.h"
#include "io/files/text_input.h"

namespace felt {
namespace fs = std::filesystem;
namespace {

std::string lower_extension(const fs::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return char(std::tolower(c)); });
  return extension;
}

}  // namespace

TriangleMesh read_mesh(const fs::path& path) {
  const std::string extension = lower_extension(path);
  if (extension == ".ply") return parse_ply(read_whole_file(path, SIZE_MAX), path.string());
  if (extension == ".obj") return parse_obj(read_whole_file(path, SIZE_MAX), path.string());
  throw FormatError(describe_mismatch(path.string(), "mesh", ".ply or .obj", "'" + extension + "'"));
}

void require_mesh_name(const fs::path& path) {
  const std::string extension = lower_extension(path);
  if (extension != ".ply" && extension != ".obj" && extension != ".glb")
    throw ConfigError(describe_mismatch(path.string(), "mesh", ".ply, .obj or .glb", "'" + extension + "'"));
}

void write_mesh(const fs::path& path, const TriangleMesh& mesh) {
  require_mesh_name(path);
  const std::string extension = lower_extension(path);
  if (extension == ".ply") return write_ply(path, mesh);
  if (extension == ".obj") return write_obj(path, mesh);
  write_glb(path, mesh);
}

}  // namespace felt
