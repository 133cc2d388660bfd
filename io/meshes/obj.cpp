#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "io/files/atomic_file.h"
#include "io/files/text_input.h"
#include "io/meshes/mesh_io.h"

namespace felt {
namespace {

/// The next word of a line, empty at its end.
std::string_view next_word(std::string_view& line) {
  const size_t start = line.find_first_not_of(" \t\r");
  if (start == std::string_view::npos) return line = {};
  const size_t end = std::min(line.find_first_of(" \t\r", start), line.size());
  const std::string_view word = line.substr(start, end - start);
  line.remove_prefix(end);
  return word;
}

void append(std::string& text, float value) {
  char buffer[32];
  const auto [end, error] = std::to_chars(buffer, buffer + sizeof buffer, value);
  text += ' ';
  text.append(buffer, end);
}

void append(std::string& text, const char* prefix, const Eigen::Vector3f& v) {
  text += prefix;
  for (int i = 0; i < 3; ++i) append(text, v[i]);
}

}  // namespace

TriangleMesh parse_obj(std::string_view bytes, const std::string& where) {
  TriangleMesh mesh;
  size_t line_number = 0;
  const auto fail = [&](const char* what, const std::string& expected, std::string_view found) {
    throw FormatError(describe_mismatch(where + ":" + std::to_string(line_number), what, expected,
                                        std::string(1, '\'').append(found.substr(0, 60)).append(1, '\'')));
  };
  std::vector<uint32_t> polygon;
  while (!bytes.empty()) {
    ++line_number;
    const size_t end = std::min(bytes.find('\n'), bytes.size());
    const std::string_view whole = bytes.substr(0, end);
    std::string_view line = whole.substr(0, whole.find('#'));
    bytes.remove_prefix(std::min(end + 1, bytes.size()));
    const std::string_view keyword = next_word(line);
    if (keyword == "v") {
      float values[6];
      int n = 0;
      for (std::string_view word = next_word(line); !word.empty() && n < 6; word = next_word(line), ++n) {
        const auto value = parse_number(word);
        if (!value || !(std::abs(*value) <= std::numeric_limits<float>::max())) fail("vertex", "a number", word);
        values[n] = float(*value);
      }
      if (n < 3) fail("vertex", "three numbers", whole);
      mesh.positions.emplace_back(values[0], values[1], values[2]);
      if (n == 6) {
        const auto level = [](float v) { return uint8_t(v > 0 ? std::min(255.0f, std::round(v * 255)) : 0); };
        mesh.colors.resize(mesh.positions.size());
        mesh.colors.back() = {level(values[3]), level(values[4]), level(values[5]), 255};
      }
    } else if (keyword == "f") {
      polygon.clear();
      for (std::string_view word = next_word(line); !word.empty(); word = next_word(line)) {
        const auto index = parse_integer(word.substr(0, word.find('/')));
        if (!index) fail("face", "vertex numbers", word);
        const auto count = int64_t(mesh.positions.size());
        const int64_t at = *index < 0 ? count + *index : *index - 1;
        if (at < 0 || at >= count) fail("face", "a vertex number among " + std::to_string(count), word);
        polygon.push_back(uint32_t(at));
      }
      if (polygon.size() < 3) fail("face", "three vertices", whole);
      for (size_t k = 2; k < polygon.size(); ++k) mesh.triangles.push_back({polygon[0], polygon[k - 1], polygon[k]});
    }
  }
  if (!mesh.colors.empty()) mesh.colors.resize(mesh.positions.size(), {128, 128, 128, 0});
  if (mesh.positions.empty()) fail("OBJ", "vertices", "none");
  return mesh;
}

void write_obj(const std::filesystem::path& path, const TriangleMesh& mesh) {
  AtomicFile file(path);
  std::string text;
  const auto flush_above = [&](size_t bytes) {
    if (text.size() <= bytes) return;
    file.write(text);
    text.clear();
  };
  constexpr size_t kPiece = 1 << 20;
  for (size_t i = 0; i < mesh.positions.size(); ++i) {
    append(text, "v", mesh.positions[i]);
    if (!mesh.colors.empty()) {
      const Rgba8 c = mesh.colors[i];
      for (const uint8_t level : {c.r, c.g, c.b}) append(text, float(level) / 255);
    }
    text += '\n';
    flush_above(kPiece);
  }
  for (const Eigen::Vector3f& n : mesh.normals) {
    append(text, "vn", n);
    text += '\n';
    flush_above(kPiece);
  }
  for (const Triangle& t : mesh.triangles) {
    text += 'f';
    for (int i = 0; i < 3; ++i) {
      const std::string v = std::to_string(t[i] + uint64_t(1));
      text += ' ';
      text += v;
      if (!mesh.normals.empty()) text.append("//").append(v);
    }
    text += '\n';
    flush_above(kPiece);
  }
  file.write(text);
  file.commit();
}

}  // namespace felt
