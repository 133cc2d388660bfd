#include "io/meshes/mesh_io.h"

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstring>
#include <fstream>

#include "core/error.h"

namespace felt {
namespace fs = std::filesystem;
namespace {

std::string lower_extension(const fs::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return char(std::tolower(c)); });
  return extension;
}

std::string read_bytes(const fs::path& path) {
  std::error_code error;
  const auto status = fs::status(path, error);
  if (error || !fs::is_regular_file(status))
    throw IoError(describe_mismatch(path.string(), "mesh", "a file", fs::exists(status) ? "a folder" : "nothing"));
  std::ifstream in(path, std::ios::binary);
  std::string bytes(size_t(fs::file_size(path, error)), '\0');
  if (!in.read(bytes.data(), std::streamsize(bytes.size())))
    throw IoError(path.string() + ": cannot read: " + std::strerror(errno));
  return bytes;
}

}  // namespace

TriangleMesh read_mesh(const fs::path& path) {
  const std::string extension = lower_extension(path);
  if (extension == ".ply") return parse_ply(read_bytes(path), path.string());
  if (extension == ".obj") return parse_obj(read_bytes(path), path.string());
  throw FormatError(describe_mismatch(path.string(), "mesh", ".ply or .obj", "'" + extension + "'"));
}

void write_mesh(const fs::path& path, const TriangleMesh& mesh) {
  const std::string extension = lower_extension(path);
  if (extension == ".ply") return write_ply(path, mesh);
  if (extension == ".obj") return write_obj(path, mesh);
  if (extension == ".glb") return write_glb(path, mesh);
  throw ConfigError(describe_mismatch(path.string(), "mesh", ".ply, .obj or .glb", "'" + extension + "'"));
}

}  // namespace felt
