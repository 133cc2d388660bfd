#include "mapping/surface/mesh_raster.h"

#include <catch2/catch.hpp>

#include "mapping/surface/marching_cubes.h"
#include "tests/support/analytic_map.h"

using namespace felt;
using Eigen::Vector3d;

namespace {

/// A square of side 2 in the plane z, red, facing up or down.
void add_square(TriangleMesh& mesh, float z, bool up, Rgba8 color) {
  const auto n = uint32_t(mesh.positions.size());
  for (const auto& [x, y] : {std::pair{-1.f, -1.f}, {1.f, -1.f}, {1.f, 1.f}, {-1.f, 1.f}}) {
    mesh.positions.emplace_back(x, y, z);
    mesh.normals.emplace_back(0, 0, up ? 1 : -1);
    mesh.colors.push_back(color);
  }
  mesh.triangles.push_back(up ? Triangle(n, n + 1, n + 2) : Triangle(n, n + 2, n + 1));
  mesh.triangles.push_back(up ? Triangle(n, n + 2, n + 3) : Triangle(n, n + 3, n + 2));
}

constexpr Rgba8 kRed{200, 0, 0, 255}, kGreen{0, 200, 0, 255}, kWhite{255, 255, 255, 255};

}  // namespace

TEST_CASE("a square seen from above fills its place and nothing else, without a seam along its diagonal") {
  TriangleMesh mesh;
  add_square(mesh, 0, true, kRed);
  RasterView view = overview(mesh, Vector3d::UnitZ(), 0, 90, 100, 80);
  view.metres_per_pixel = 0.05;  // 40 x 40 pixels
  const ColorImage image = draw_mesh(mesh, view, Shading::color);
  int drawn = 0;
  for (int v = 0; v < 80; ++v)
    for (int u = 0; u < 100; ++u) {
      const bool inside = std::abs(u + 0.5 - 50) < 20 && std::abs(v + 0.5 - 40) < 20;
      drawn += inside;
      REQUIRE((image(u, v) == kWhite) != inside);
      if (inside) REQUIRE((image(u, v).r > 100 && image(u, v).g == 0));
    }
  CHECK(drawn == 1600);
}

TEST_CASE("what faces away is not drawn, and of what faces the viewer the nearer is") {
  TriangleMesh mesh;
  add_square(mesh, 0, true, kRed);
  add_square(mesh, 1, false, kGreen);  // a ceiling, seen from above
  const RasterView above = overview(mesh, Vector3d::UnitZ(), 0, 90, 40, 40);
  CHECK(draw_mesh(mesh, above, Shading::color)(20, 20).r > 100);
  const RasterView below = overview(mesh, -Vector3d::UnitZ(), 0, 90, 40, 40);
  CHECK(draw_mesh(mesh, below, Shading::color)(20, 20).g > 100);
  add_square(mesh, 2, true, kGreen);
  CHECK(draw_mesh(mesh, above, Shading::color)(20, 20).g > 100);
}

TEST_CASE("an overview at an angle has `up` upwards in the image") {
  TriangleMesh mesh;
  for (const Vector3d& up : {Vector3d(0, 0, 1), Vector3d(0, -1, 0), Vector3d(0.3, 0.2, -0.9)}) {
    const RasterView view = overview(mesh, up, 35, 40, 64, 48);
    const Vector3d shown = view.T_camera_world.linear() * up.normalized();
    CHECK(shown.x() == Approx(0).margin(1e-12));
    CHECK(shown.y() == Approx(-std::cos(40 * M_PI / 180)));
    CHECK(shown.z() == Approx(-std::sin(40 * M_PI / 180)));
    CHECK(view.T_camera_world.linear().determinant() == Approx(1));
  }
}

TEST_CASE("normals are shown by their direction") {
  Map map(0.05, 0.2);
  test::fill_map(map, {-10, -10, -4}, {10, 10, 4}, [](const Vector3d& p) { return p.z() - 0.01; });
  const TriangleMesh mesh = extract_mesh(map);
  const ColorImage image = draw_mesh(mesh, overview(mesh, Vector3d::UnitZ(), 0, 90, 32, 32), Shading::normal);
  CHECK(image(16, 16) == Rgba8{128, 128, 255, 255});
}

TEST_CASE("a mesh of nothing gives the background") {
  const TriangleMesh mesh;
  const ColorImage image = draw_mesh(mesh, overview(mesh, Vector3d::UnitZ(), 0, 30, 16, 16), Shading::clay);
  for (const Rgba8& pixel : image) REQUIRE(pixel == kWhite);
}
