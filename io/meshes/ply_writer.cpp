#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cstring>

#include "io/files/atomic_file.h"
#include "io/meshes/mesh_io.h"

namespace felt {
namespace {
static_assert(std::endian::native == std::endian::little, "records are written as they lie in memory");

/// Makes `count` records of `record_bytes` each, in parallel, and hands them to the file in pieces of some megabytes.
/// `fill(i, to)` writes record i.
template <typename Fill>
void write_records(AtomicFile& file, size_t count, size_t record_bytes, Fill fill) {
  constexpr size_t kPieceBytes = 4 << 20;
  const size_t at_once = std::max<size_t>(1, kPieceBytes / record_bytes);
  std::vector<char> piece(std::min(count, at_once) * record_bytes);
  for (size_t first = 0; first < count; first += at_once) {
    const size_t end = std::min(count, first + at_once);
    constexpr size_t kTask = 16384;
    tbb::parallel_for(tbb::blocked_range<size_t>(first, end, kTask), [&](const tbb::blocked_range<size_t>& range) {
      for (size_t i = range.begin(); i < range.end(); ++i) fill(i, piece.data() + (i - first) * record_bytes);
    });
    file.write(piece.data(), (end - first) * record_bytes);
  }
}

/// Appends the bytes of a value to a record.
template <typename T>
void put(char*& to, const T& value) {
  std::memcpy(to, &value, sizeof value);
  to += sizeof value;
}

/// A name as PLY's header can hold it: without white space.
std::string one_word(std::string name) {
  std::replace_if(
      name.begin(), name.end(), [](char c) { return static_cast<unsigned char>(c) <= ' '; }, '_');
  return name;
}

std::string header(const TriangleMesh& mesh, const std::vector<std::string>& comments) {
  std::string text = "ply\nformat binary_little_endian 1.0\n";
  for (const std::string& comment : comments) text += "comment " + comment + "\n";
  text += "element vertex " + std::to_string(mesh.positions.size()) + "\n";
  text += "property float x\nproperty float y\nproperty float z\n";
  if (!mesh.normals.empty()) text += "property float nx\nproperty float ny\nproperty float nz\n";
  if (!mesh.colors.empty()) text += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  if (!mesh.labels.empty()) text += "property ushort label\n";
  for (const MeshScalars& s : mesh.scalars) text += "property float " + one_word(s.name) + "\n";
  if (!mesh.triangles.empty()) {
    text += "element face " + std::to_string(mesh.triangles.size()) + "\nproperty list uchar int vertex_indices\n";
    for (const MeshScalars& s : mesh.triangle_scalars) text += "property float " + one_word(s.name) + "\n";
  }
  return text + "end_header\n";
}

}  // namespace

void write_ply(const std::filesystem::path& path, const TriangleMesh& mesh, const std::vector<std::string>& comments) {
  AtomicFile file(path);
  file.write(header(mesh, comments));
  const size_t vertex_bytes = 12 + (mesh.normals.empty() ? 0 : 12) + (mesh.colors.empty() ? 0 : 3) +
                              (mesh.labels.empty() ? 0 : 2) + 4 * mesh.scalars.size();
  write_records(file, mesh.positions.size(), vertex_bytes, [&](size_t i, char* to) {
    put(to, mesh.positions[i]);
    if (!mesh.normals.empty()) put(to, mesh.normals[i]);
    if (!mesh.colors.empty()) {
      put(to, mesh.colors[i].r);
      put(to, mesh.colors[i].g);
      put(to, mesh.colors[i].b);
    }
    if (!mesh.labels.empty()) put(to, mesh.labels[i]);
    for (const MeshScalars& s : mesh.scalars) put(to, s.values[i]);
  });
  write_records(file, mesh.triangles.size(), 13 + 4 * mesh.triangle_scalars.size(), [&](size_t i, char* to) {
    put(to, uint8_t(3));
    put(to, mesh.triangles[i]);
    for (const MeshScalars& s : mesh.triangle_scalars) put(to, s.values[i]);
  });
  file.commit();
}

}  // namespace felt
