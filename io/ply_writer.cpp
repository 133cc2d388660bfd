#include <bit>
#include <cstring>

#include "io/atomic_file.h"
#include "io/mesh_io.h"

namespace felt {
namespace {
static_assert(std::endian::native == std::endian::little, "records are written as they lie in memory");

/// Collects records and hands them to the file in pieces of about a megabyte.
class RecordWriter {
public:
  explicit RecordWriter(AtomicFile& file) : file_(file) { buffer_.reserve(kPiece + 4096); }
  template <typename T>
  void put(const T& value) {
    buffer_.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  void end_record() {
    if (buffer_.size() >= kPiece) flush();
  }
  void flush() {
    file_.write(buffer_);
    buffer_.clear();
  }

private:
  static constexpr size_t kPiece = 1 << 20;
  AtomicFile& file_;
  std::string buffer_;
};

std::string header(const TriangleMesh& mesh, const std::vector<std::string>& comments) {
  std::string text = "ply\nformat binary_little_endian 1.0\n";
  for (const std::string& comment : comments) text += "comment " + comment + "\n";
  text += "element vertex " + std::to_string(mesh.positions.size()) + "\n";
  text += "property float x\nproperty float y\nproperty float z\n";
  if (!mesh.normals.empty()) text += "property float nx\nproperty float ny\nproperty float nz\n";
  if (!mesh.colors.empty()) text += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  if (!mesh.labels.empty()) text += "property ushort label\n";
  for (const MeshScalars& s : mesh.scalars) text += "property float " + s.name + "\n";
  if (!mesh.triangles.empty()) {
    text += "element face " + std::to_string(mesh.triangles.size()) + "\nproperty list uchar int vertex_indices\n";
    for (const MeshScalars& s : mesh.triangle_scalars) text += "property float " + s.name + "\n";
  }
  return text + "end_header\n";
}

}  // namespace

void write_ply(const std::filesystem::path& path, const TriangleMesh& mesh, const std::vector<std::string>& comments) {
  AtomicFile file(path);
  file.write(header(mesh, comments));
  RecordWriter out(file);
  for (size_t i = 0; i < mesh.positions.size(); ++i) {
    out.put(mesh.positions[i]);
    if (!mesh.normals.empty()) out.put(mesh.normals[i]);
    if (!mesh.colors.empty()) {
      out.put(mesh.colors[i].r);
      out.put(mesh.colors[i].g);
      out.put(mesh.colors[i].b);
    }
    if (!mesh.labels.empty()) out.put(mesh.labels[i]);
    for (const MeshScalars& s : mesh.scalars) out.put(s.values[i]);
    out.end_record();
  }
  for (size_t i = 0; i < mesh.triangles.size(); ++i) {
    out.put(uint8_t(3));
    out.put(mesh.triangles[i]);
    for (const MeshScalars& s : mesh.triangle_scalars) out.put(s.values[i]);
    out.end_record();
  }
  out.flush();
  file.commit();
}

}  // namespace felt
