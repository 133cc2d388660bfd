#include <array>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "io/files/atomic_file.h"
#include "io/meshes/mesh_io.h"

namespace felt {
namespace {
using nlohmann::json;

// Numbers of the glTF 2.0 specification (Khronos, sections 3.6.2 and 5).
constexpr int kFloat = 5126, kUnsignedShort = 5123, kUnsignedInt = 5125;
constexpr int kArrayBuffer = 34962, kElementArrayBuffer = 34963;
constexpr int kPoints = 0, kTriangles = 4;

/// sRGB levels to linear 16-bit ones: glTF's COLOR_0 is linear.
std::array<uint16_t, 256> linear_levels() {
  std::array<uint16_t, 256> table;
  for (int i = 0; i < 256; ++i) {
    const double s = i / 255.0, linear = s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
    table[i] = uint16_t(std::lround(linear * 65535));
  }
  return table;
}

/// The binary chunk and the tables of the JSON chunk that point into it.
struct Buffers {
  std::string bytes;
  json views = json::array(), accessors = json::array();

  int add(const void* data, size_t size, size_t count, int component, const char* type, int target) {
    views.push_back({{"buffer", 0}, {"byteOffset", bytes.size()}, {"byteLength", size}, {"target", target}});
    bytes.append(static_cast<const char*>(data), size);
    bytes.resize((bytes.size() + 3) & ~size_t(3));
    accessors.push_back(
        {{"bufferView", views.size() - 1}, {"componentType", component}, {"count", count}, {"type", type}});
    return int(accessors.size()) - 1;
  }
};

/// "friction_mean" as glTF wants names of its own: "_FRICTION_MEAN".
std::string attribute_name(const std::string& scalar) {
  std::string name = "_";
  for (const char c : scalar) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
    name += !plain ? '_' : c >= 'a' && c <= 'z' ? char(c - 'a' + 'A') : c;
  }
  return name;
}

/// One number per vertex. glTF allows only finite ones: others are written as 0, and an attribute more says where.
/// Two names that glTF's letters make one are numbered: the later one gets "_2" behind it.
void add_scalars(const std::string& wanted, std::vector<float> values, Buffers& buffers, json& attributes) {
  std::string name = wanted;
  for (int number = 2; attributes.contains(name); ++number) name = wanted + "_" + std::to_string(number);
  std::vector<float> known(values.size(), 1.0f);
  bool all_known = true;
  for (size_t i = 0; i < values.size(); ++i)
    if (!std::isfinite(values[i])) values[i] = known[i] = 0, all_known = false;
  const auto add = [&](const std::vector<float>& v) {
    return buffers.add(v.data(), v.size() * 4, v.size(), kFloat, "SCALAR", kArrayBuffer);
  };
  attributes[name] = add(values);
  if (!all_known) attributes[name + "_KNOWN"] = add(known);
}

json primitive_of(const TriangleMesh& mesh, Buffers& buffers) {
  const size_t n = mesh.positions.size();
  json attributes;
  Eigen::Vector3f low = mesh.positions[0], high = low;
  for (const Eigen::Vector3f& p : mesh.positions) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  const int positions = buffers.add(mesh.positions.data(), n * 12, n, kFloat, "VEC3", kArrayBuffer);
  buffers.accessors[positions]["min"] = {low.x(), low.y(), low.z()};
  buffers.accessors[positions]["max"] = {high.x(), high.y(), high.z()};
  attributes["POSITION"] = positions;
  if (!mesh.normals.empty())
    attributes["NORMAL"] = buffers.add(mesh.normals.data(), n * 12, n, kFloat, "VEC3", kArrayBuffer);
  if (!mesh.colors.empty()) {
    const auto linear = linear_levels();
    std::vector<std::array<uint16_t, 4>> colors(n);
    for (size_t i = 0; i < n; ++i) {
      const Rgba8 c = mesh.colors[i];
      colors[i] = {linear[c.r], linear[c.g], linear[c.b], 65535};
    }
    const int accessor = buffers.add(colors.data(), n * 8, n, kUnsignedShort, "VEC4", kArrayBuffer);
    buffers.accessors[accessor]["normalized"] = true;
    attributes["COLOR_0"] = accessor;
  }
  if (!mesh.labels.empty())
    add_scalars("_LABEL", std::vector<float>(mesh.labels.begin(), mesh.labels.end()), buffers, attributes);
  for (const MeshScalars& s : mesh.scalars) add_scalars(attribute_name(s.name), s.values, buffers, attributes);
  json primitive = {
      {"attributes", attributes}, {"mode", mesh.triangles.empty() ? kPoints : kTriangles}, {"material", 0}};
  if (!mesh.triangles.empty())
    primitive["indices"] = buffers.add(mesh.triangles.data(), mesh.triangles.size() * 12, mesh.triangles.size() * 3,
                                       kUnsignedInt, "SCALAR", kElementArrayBuffer);
  return primitive;
}

void put_u32(std::string& out, size_t value) {
  const auto v = uint32_t(value);
  out.append(reinterpret_cast<const char*>(&v), 4);
}

}  // namespace

void write_glb(const std::filesystem::path& path, const TriangleMesh& mesh) {
  static_assert(sizeof(Eigen::Vector3f) == 12 && sizeof(Triangle) == 12);
  json document = {{"asset", {{"version", "2.0"}, {"generator", "feltmap"}}}, {"scene", 0}};
  Buffers buffers;
  if (mesh.positions.empty()) {
    // An accessor must not be empty: an empty mesh is an empty scene.
    document["scenes"] = {{{"name", "map"}}};
  } else {
    document["meshes"] = {{{"name", "map"}, {"primitives", {primitive_of(mesh, buffers)}}}};
    document["scenes"] = {{{"nodes", {0}}}};
    document["nodes"] = {{{"mesh", 0}, {"name", "map"}}};
    document["materials"] = {
        {{"doubleSided", true}, {"pbrMetallicRoughness", {{"metallicFactor", 0.0}, {"roughnessFactor", 1.0}}}}};
    if (!mesh.colors.empty()) {
      document["materials"][0]["extensions"] = {{"KHR_materials_unlit", json::object()}};
      document["extensionsUsed"] = {"KHR_materials_unlit"};
    }
    document["bufferViews"] = buffers.views;
    document["accessors"] = buffers.accessors;
    document["buffers"] = {{{"byteLength", buffers.bytes.size()}}};
  }
  std::string text = document.dump();
  text.resize((text.size() + 3) & ~size_t(3), ' ');
  const size_t total = 12 + 8 + text.size() + (buffers.bytes.empty() ? 0 : 8 + buffers.bytes.size());
  if (total > 0xffffffffu)
    throw IoError(describe_mismatch(path.string(), "GLB", "less than 4 GiB", std::to_string(total) + " bytes"));
  std::string head;
  head += "glTF";
  put_u32(head, 2);
  put_u32(head, total);
  put_u32(head, text.size());
  head += "JSON";
  head += text;
  if (!buffers.bytes.empty()) {
    put_u32(head, buffers.bytes.size());
    head.append("BIN\0", 4);
  }
  AtomicFile file(path);
  file.write(head);
  file.write(buffers.bytes);
  file.commit();
}

}  // namespace felt
