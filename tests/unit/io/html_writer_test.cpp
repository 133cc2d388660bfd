#include <catch2/catch.hpp>
#include <cstring>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "io/meshes/mesh_io.h"
#include "tests/support/data.h"

using namespace felt;

namespace {

std::string element(const std::string& page, const std::string& id) {
  const size_t begin = page.find('>', page.find("<script id=\"" + id + "\"")) + 1;
  return page.substr(begin, page.find("</script>", begin) - begin);
}

/// Decodes base64 by table search: slow and plain.
template <typename T>
std::vector<T> decoded(const std::string& text) {
  const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string bytes;
  REQUIRE(text.size() % 4 == 0);
  for (size_t i = 0; i < text.size(); i += 4) {
    uint32_t three = 0;
    int padding = 0;
    for (size_t j = i; j < i + 4; ++j) {
      padding += text[j] == '=';
      const size_t digit = text[j] == '=' ? 0 : digits.find(text[j]);
      REQUIRE(digit != std::string::npos);
      three = three << 6 | uint32_t(digit);
    }
    for (int b = 0; b < 3 - padding; ++b) bytes += char(three >> (16 - 8 * b) & 0xff);
  }
  REQUIRE(bytes.size() % sizeof(T) == 0);
  std::vector<T> values(bytes.size() / sizeof(T));
  std::memcpy(values.data(), bytes.data(), bytes.size());
  return values;
}

std::string written(const TriangleMesh& mesh, const std::string& title) {
  const test::TemporaryDirectory directory;
  write_html(directory.path() / "page.html", mesh, title, "+y");
  std::ifstream in(directory.path() / "page.html", std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

}  // namespace

TEST_CASE("a page gives back the mesh it was made of") {
  TriangleMesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0.5f}, {0, -1.25f, 2}, {10, 1, 3e-7f}, {4.5f, 0.25f, 1}};
  mesh.normals = {{0, 0, 1}, {0, -1, 0}, {1, 0, 0}, {0.6f, 0.8f, 0}, {-1, 0, 0}};
  mesh.colors = {{1, 2, 3, 255}, {4, 5, 6, 255}, {255, 0, 128, 255}, {9, 9, 9, 255}, {0, 0, 0, 0}};
  mesh.triangles = {{0, 1, 2}, {2, 1, 3}, {3, 4, 70000}};
  const std::string page = written(mesh, "kitchen & <hall>");
  CHECK(page.find("<title>kitchen &amp; &lt;hall></title>") != std::string::npos);
  const auto scene = nlohmann::json::parse(element(page, "scene"));
  CHECK(scene["title"] == "kitchen & <hall>");
  CHECK(scene["vertices"] == 5);
  CHECK(scene["triangles"] == 3);
  CHECK(scene["colored"] == true);
  const auto positions = decoded<uint16_t>(element(page, "positions"));
  const auto normals = decoded<int8_t>(element(page, "normals"));
  const auto colors = decoded<uint8_t>(element(page, "colors"));
  REQUIRE(positions.size() == 4 * 5);
  REQUIRE(normals.size() == 4 * 5);
  REQUIRE(colors.size() == 4 * 5);
  for (size_t i = 0; i < 5; ++i)
    for (size_t c = 0; c < 3; ++c) {
      const double low = scene["low"][c], extent = scene["high"][c].get<double>() - low;
      CHECK(low + positions[4 * i + c] / 65535.0 * extent ==
            Approx(mesh.positions[i][int(c)]).margin(0.51 * extent / 65535 + 1e-6));
      CHECK(normals[4 * i + c] / 127.0 == Approx(mesh.normals[i][int(c)]).margin(0.51 / 127));
      const Rgba8 color = mesh.colors[i];
      CHECK(colors[4 * i + c] == (c == 0 ? color.r : c == 1 ? color.g : color.b));
    }
  CHECK(decoded<uint32_t>(element(page, "triangles")) == std::vector<uint32_t>{0, 1, 2, 2, 1, 3, 3, 4, 70000});
}

TEST_CASE("a page of an empty or flat mesh, or with a title that would end its element, is whole") {
  TriangleMesh flat;
  flat.positions = {{1, 2, 3}, {1, 5, 3}};
  for (const TriangleMesh& mesh : {TriangleMesh(), flat}) {
    const std::string page = written(mesh, "</script><b>");
    const auto scene = nlohmann::json::parse(element(page, "scene"));
    CHECK(scene["title"] == "</script><b>");
    CHECK(scene["vertices"] == mesh.positions.size());
    CHECK(decoded<uint16_t>(element(page, "positions")).size() == 4 * mesh.positions.size());
    CHECK(page.ends_with("</html>\n"));
  }
}
