#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <functional>
#include <optional>

#include "core/error.h"
#include "io/meshes/mesh_io.h"

namespace felt {
namespace {

enum class Encoding { ascii, little, big };
enum class Type { i8, u8, i16, u16, i32, u32, f32, f64 };

size_t size_of(Type type) {
  constexpr size_t sizes[] = {1, 1, 2, 2, 4, 4, 4, 8};
  return sizes[int(type)];
}

std::optional<Type> type_named(std::string_view name) {
  constexpr std::array<std::pair<std::string_view, Type>, 16> names = {{{"char", Type::i8},
                                                                        {"uchar", Type::u8},
                                                                        {"short", Type::i16},
                                                                        {"ushort", Type::u16},
                                                                        {"int", Type::i32},
                                                                        {"uint", Type::u32},
                                                                        {"float", Type::f32},
                                                                        {"double", Type::f64},
                                                                        {"int8", Type::i8},
                                                                        {"uint8", Type::u8},
                                                                        {"int16", Type::i16},
                                                                        {"uint16", Type::u16},
                                                                        {"int32", Type::i32},
                                                                        {"uint32", Type::u32},
                                                                        {"float32", Type::f32},
                                                                        {"float64", Type::f64}}};
  for (const auto& [known, type] : names)
    if (known == name) return type;
  return std::nullopt;
}

struct Property {
  std::string name;
  Type type = Type::f32;
  std::optional<Type> count_type;  ///< of a list
};

struct Element {
  std::string name;
  uint64_t count = 0;
  std::vector<Property> properties;
};

/// The start of what was found, in quotes.
std::string quoted(std::string_view text) {
  std::string shown(1, '\'');
  shown.append(text.substr(0, 60));
  shown += '\'';
  return shown;
}

/// The bytes not read yet, with the position for messages.
class Cursor {
public:
  Cursor(std::string_view bytes, const std::string& where) : bytes_(bytes), where_(where) {}

  [[noreturn]] void fail(const std::string& what, const std::string& expected, const std::string& found) const {
    throw FormatError(describe_mismatch(where_ + ": byte " + std::to_string(at_), what, expected, found));
  }
  size_t left() const { return bytes_.size() - at_; }

  std::string_view line() {
    const size_t end = bytes_.find('\n', at_);
    if (end == std::string_view::npos) fail("PLY header", "end_header", "the end of the file");
    std::string_view text = bytes_.substr(at_, end - at_);
    at_ = end + 1;
    if (!text.empty() && text.back() == '\r') text.remove_suffix(1);
    return text;
  }

  double value(Type type, Encoding encoding) {
    if (encoding == Encoding::ascii) return ascii_value();
    std::array<char, 8> raw;
    const size_t size = size_of(type);
    if (left() < size) fail("data", std::to_string(size) + " more bytes", std::to_string(left()));
    std::memcpy(raw.data(), bytes_.data() + at_, size);
    at_ += size;
    if ((encoding == Encoding::big) != (std::endian::native == std::endian::big))
      std::reverse(raw.begin(), raw.begin() + size);
    switch (type) {
      case Type::i8:
        return as<int8_t>(raw);
      case Type::u8:
        return as<uint8_t>(raw);
      case Type::i16:
        return as<int16_t>(raw);
      case Type::u16:
        return as<uint16_t>(raw);
      case Type::i32:
        return as<int32_t>(raw);
      case Type::u32:
        return as<uint32_t>(raw);
      case Type::f32:
        return as<float>(raw);
      case Type::f64:
        return as<double>(raw);
    }
    return 0;
  }

private:
  template <typename T>
  static double as(const std::array<char, 8>& raw) {
    T value;
    std::memcpy(&value, raw.data(), sizeof value);
    return double(value);
  }
  static bool space(char c) { return c == ' ' || c == '\n' || c == '\r' || c == '\t'; }

  double ascii_value() {
    while (at_ < bytes_.size() && space(bytes_[at_])) ++at_;
    size_t end = at_;
    while (end < bytes_.size() && !space(bytes_[end])) ++end;
    const char* from = bytes_.data() + at_;
    if (end > at_ && *from == '+') ++from;
    double number = 0;
    const auto [stop, error] = std::from_chars(from, bytes_.data() + end, number);
    if (error != std::errc() || stop != bytes_.data() + end)
      fail("data", "a number", end == at_ ? "the end of the file" : quoted(bytes_.substr(at_, end - at_)));
    at_ = end;
    return number;
  }

  std::string_view bytes_;
  const std::string& where_;
  size_t at_ = 0;
};

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  for (size_t at = 0; at < line.size();) {
    const size_t start = line.find_first_not_of(" \t", at);
    if (start == std::string_view::npos) break;
    const size_t end = std::min(line.find_first_of(" \t", start), line.size());
    words.push_back(line.substr(start, end - start));
    at = end;
  }
  return words;
}

struct Header {
  Encoding encoding = Encoding::ascii;
  std::vector<Element> elements;
};

Header parse_header(Cursor& in) {
  if (in.left() < 4 || in.line() != "ply") in.fail("first line", "ply", "something else");
  Header header;
  bool has_format = false;
  while (true) {
    const std::string_view line = in.line();
    const std::vector<std::string_view> words = words_of(line);
    const auto bad = [&](const char* expected) { in.fail("PLY header", expected, quoted(line)); };
    if (words.empty() || words[0] == "comment" || words[0] == "obj_info") continue;
    if (words[0] == "end_header") break;
    if (words[0] == "format") {
      if (words.size() < 2) bad("format <encoding> 1.0");
      if (words[1] == "ascii")
        header.encoding = Encoding::ascii;
      else if (words[1] == "binary_little_endian")
        header.encoding = Encoding::little;
      else if (words[1] == "binary_big_endian")
        header.encoding = Encoding::big;
      else
        bad("ascii, binary_little_endian or binary_big_endian");
      has_format = true;
    } else if (words[0] == "element") {
      Element element;
      if (words.size() != 3) bad("element <name> <count>");
      element.name = words[1];
      const auto [stop, error] = std::from_chars(words[2].data(), words[2].data() + words[2].size(), element.count);
      if (error != std::errc() || stop != words[2].data() + words[2].size()) bad("element <name> <count>");
      header.elements.push_back(std::move(element));
    } else if (words[0] == "property") {
      const bool list = words.size() == 5 && words[1] == "list";
      if (header.elements.empty() || (!list && words.size() != 3)) bad("property <type> <name> after an element");
      const auto type = type_named(words[list ? 3 : 1]), count = type_named(words[list ? 2 : 1]);
      if (!type || !count) bad("a PLY type");
      if (list && (*count == Type::f32 || *count == Type::f64)) bad("an integer type for a list's length");
      header.elements.back().properties.push_back(
          {std::string(words.back()), *type, list ? count : std::optional<Type>()});
    } else {
      bad("format, comment, element, property or end_header");
    }
  }
  if (!has_format) in.fail("PLY header", "a format line", "none");
  return header;
}

/// Refuses a count of records that the bytes left cannot hold, before anything is allocated for it.
void check_count(const Cursor& in, const Element& element, Encoding encoding) {
  uint64_t least = 0;  // bytes of the shortest record
  for (const Property& p : element.properties)
    least += encoding == Encoding::ascii ? 1 : p.count_type ? size_of(*p.count_type) : size_of(p.type);
  if (element.count > 0 && (least == 0 || element.count > in.left() / least))
    in.fail("element " + element.name, std::to_string(element.count) + " records",
            std::to_string(in.left()) + " bytes left");
}

using SetVertex = std::function<void(TriangleMesh&, double)>;

/// What to do with each scalar property of a vertex.
SetVertex vertex_setter(TriangleMesh& mesh, const Property& p) {
  for (int i = 0; i < 3; ++i) {
    constexpr const char* kPosition[] = {"x", "y", "z"};
    constexpr const char* kNormal[] = {"nx", "ny", "nz"};
    constexpr const char* kColor[] = {"red", "green", "blue"};
    if (p.name == kPosition[i]) return [i](TriangleMesh& m, double v) { m.positions.back()[i] = float(v); };
    if (p.name == kNormal[i]) {
      return [i](TriangleMesh& m, double v) {
        m.normals.resize(m.positions.size(), Eigen::Vector3f::Zero());
        m.normals.back()[i] = float(v);
      };
    }
    if (p.name == kColor[i]) {
      // Floating-point colours run from 0 to 1.
      const double scale = p.type == Type::f32 || p.type == Type::f64 ? 255 : p.type == Type::u16 ? 1 / 257.0 : 1;
      return [i, scale](TriangleMesh& m, double v) {
        m.colors.resize(m.positions.size());
        const auto level = uint8_t(std::isfinite(v) ? std::clamp(std::round(v * scale), 0.0, 255.0) : 0);
        (i == 0 ? m.colors.back().r : i == 1 ? m.colors.back().g : m.colors.back().b) = level;
      };
    }
  }
  if (p.name == "alpha") return [](TriangleMesh&, double) {};
  if (p.name == "label" && p.type != Type::f32 && p.type != Type::f64) {
    return [](TriangleMesh& m, double v) {
      m.labels.resize(m.positions.size());
      m.labels.back() = uint16_t(std::clamp(v, 0.0, 65535.0));
    };
  }
  const size_t n = mesh.scalars.size();
  mesh.scalars.push_back({p.name, {}});
  return [n](TriangleMesh& m, double v) { m.scalars[n].values.push_back(float(v)); };
}

void read_vertices(Cursor& in, const Element& element, Encoding encoding, TriangleMesh& mesh) {
  for (const char* name : {"x", "y", "z"})
    if (std::none_of(element.properties.begin(), element.properties.end(),
                     [&](const Property& p) { return p.name == name && !p.count_type; }))
      in.fail("element vertex", std::string("property ") + name, "none");
  std::vector<SetVertex> setters;
  for (const Property& p : element.properties)
    setters.push_back(p.count_type ? SetVertex([](TriangleMesh&, double) {}) : vertex_setter(mesh, p));
  mesh.positions.reserve(element.count);
  for (uint64_t i = 0; i < element.count; ++i) {
    mesh.positions.emplace_back(Eigen::Vector3f::Zero());
    for (size_t j = 0; j < setters.size(); ++j) {
      const Property& p = element.properties[j];
      double n = p.count_type ? in.value(*p.count_type, encoding) : 1;
      for (; n > 0; --n) setters[j](mesh, in.value(p.type, encoding));
    }
  }
}

void read_faces(Cursor& in, const Element& element, Encoding encoding, TriangleMesh& mesh) {
  for (const Property& p : element.properties)
    if (!p.count_type) mesh.triangle_scalars.push_back({p.name, {}});
  std::vector<double> polygon, scalars;
  for (uint64_t i = 0; i < element.count; ++i) {
    polygon.clear();
    scalars.clear();
    for (const Property& p : element.properties) {
      if (!p.count_type) {
        scalars.push_back(in.value(p.type, encoding));
        continue;
      }
      const bool corners = p.name == "vertex_indices" || p.name == "vertex_index";
      for (double n = in.value(*p.count_type, encoding); n > 0; --n) {
        const double v = in.value(p.type, encoding);
        if (corners) polygon.push_back(v);
      }
    }
    for (const double v : polygon)
      if (!(v >= 0 && v < double(mesh.positions.size()) && v == std::floor(v)))
        in.fail("face " + std::to_string(i), "vertex numbers below " + std::to_string(mesh.positions.size()),
                std::to_string(v));
    for (size_t k = 2; k < polygon.size(); ++k) {
      mesh.triangles.push_back({uint32_t(polygon[0]), uint32_t(polygon[k - 1]), uint32_t(polygon[k])});
      for (size_t s = 0; s < scalars.size(); ++s) mesh.triangle_scalars[s].values.push_back(float(scalars[s]));
    }
  }
}

void skip_element(Cursor& in, const Element& element, Encoding encoding) {
  for (uint64_t i = 0; i < element.count; ++i)
    for (const Property& p : element.properties) {
      double n = p.count_type ? in.value(*p.count_type, encoding) : 1;
      for (; n > 0; --n) in.value(p.type, encoding);
    }
}

}  // namespace

TriangleMesh parse_ply(std::string_view bytes, const std::string& where) {
  Cursor in(bytes, where);
  const Header header = parse_header(in);
  TriangleMesh mesh;
  bool has_vertices = false, has_faces = false;
  for (const Element& element : header.elements) {
    check_count(in, element, header.encoding);
    if (element.name == "vertex" && !std::exchange(has_vertices, true)) {
      read_vertices(in, element, header.encoding, mesh);
    } else if (element.name == "face" && !std::exchange(has_faces, true)) {
      read_faces(in, element, header.encoding, mesh);
    } else {
      skip_element(in, element, header.encoding);
    }
  }
  if (!has_vertices) in.fail("PLY", "an element vertex", "none");
  return mesh;
}

}  // namespace felt
