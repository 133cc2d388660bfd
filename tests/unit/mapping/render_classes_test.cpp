#include "mapping/surface/render_classes.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "mapping/surface/render.h"
#include "tests/support/analytic_map.h"

using namespace felt;

TEST_CASE("class and entropy images show the evidence of the voxels that are seen") {
  Map map(0.1, 0.4);
  map.classes = ClassTable({{0, "none", {}, true}, {7, "wood", {}, false}, {9, "stone", {}, false}});
  test::fill_map(map, {-8, -8, 8}, {8, 8, 12}, [](const Eigen::Vector3d& p) { return 1.02 - p.z(); });
  // Evidence on the right half only: wood in one row, stone elsewhere.
  for (int x = 0; x <= 8; ++x)
    for (int y = -8; y <= 8; ++y) {
      Block& block = map.store[map.store.find(block_of_voxel({x, y, 10}))];
      if (block.evidence.empty()) block.evidence = {{0, map.store.new_plane()}, {1, map.store.new_plane()}};
      block.evidence[y == 0 ? 0 : 1].counts->value[offset_in_block({x, y, 10})] = 8;
    }
  const PinholeCamera camera{20, 20, 10, 10, 21, 21};
  const RenderedView view = RayCaster(map).render(camera, Eigen::Isometry3d::Identity());
  const VoxelBeliefs beliefs(map);
  const LabelImage label = class_image(map, beliefs, view.voxel);
  const Image<float> entropy = entropy_image(beliefs, view.voxel);
  CHECK(label(14, 10) == 7);
  CHECK(label(14, 15) == 9);
  CHECK(label(2, 10) == 0xffff);
  CHECK(entropy(2, 10) == Approx(std::log(2)));
  CHECK(entropy(14, 10) == Approx(-0.9 * std::log(0.9) - 0.1 * std::log(0.1)));
  std::vector<double> p(2);
  beliefs.class_probability(view.voxel(14, 15), p);
  CHECK(p[0] == Approx(0.1));
  CHECK(p[1] == Approx(0.9));
}
