#include "mapping/grids/vdb_classes.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "core/error.h"
#include "mapping/labels/class_belief.h"
#include "tests/support/random_map.h"

using namespace felt;

namespace {

openvdb::Coord coord_of(const Block& block, int offset) {
  const Index3 f = first_voxel(block.coord), v = voxel_of_offset(offset);
  return {f.x + v.x, f.y + v.y, f.z + v.z};
}

template <typename Grid>
typename Grid::Ptr stock(const LeafGrid& grid) {
  openvdb::initialize();
  return openvdb::gridPtrCast<Grid>(stock_grid(grid));
}

const TouchViews untouched = std::make_shared<const std::vector<TouchView>>();

}  // namespace

TEST_CASE("grids of beliefs hold each voxel's class id, its probability, entropy and evidence, and nothing else") {
  const Map map = test::random_map({.seed = 5, .blocks = 12, .classes = 4});
  const auto label = stock<openvdb::Int32Grid>(label_grid(map, untouched));
  const auto probability = stock<openvdb::FloatGrid>(label_probability_grid(map, untouched));
  const auto entropy = stock<openvdb::FloatGrid>(entropy_grid(map, untouched));
  const auto total = stock<openvdb::FloatGrid>(total_evidence_grid(map));
  size_t labelled = 0;
  for (const Block& block : map.store.blocks())
    for (int i = 0; i < kBlockVoxels; ++i) {
      const ClassBelief belief = class_belief(block, i, map.classes);
      const openvdb::Coord at = coord_of(block, i);
      const bool has_class = belief.slot != ClassTable::kNoSlot;
      labelled += has_class;
      REQUIRE(label->tree().isValueOn(at) == has_class);
      REQUIRE(label->tree().getValue(at) == (has_class ? int(map.classes.at_slot(belief.slot).id) : -1));
      REQUIRE(probability->tree().getValue(at) == Approx(has_class ? belief.probability : 0.25f));
      REQUIRE(entropy->tree().getValue(at) == Approx(has_class ? belief.entropy : std::log(4.0f)));
      REQUIRE(total->tree().getValue(at) == total_evidence(block, i));
    }
  CHECK(labelled > 1000);
  CHECK(label->activeVoxelCount() == labelled);
  CHECK(total->activeVoxelCount() == labelled);
}

TEST_CASE("where a touch reached, the grids show the belief after it") {
  const Map map = test::random_map({.seed = 6, .blocks = 6, .classes = 3});
  const Block& block = map.store[map.store.sorted()[2]];
  TouchView view;
  view.coord = block.coord;
  view.mask.set(77);
  view.label[77] = 2, view.label_probability[77] = 0.875f, view.entropy[77] = 0.125f;
  const auto touched = std::make_shared<const std::vector<TouchView>>(1, view);
  const openvdb::Coord at = coord_of(block, 77);
  CHECK(stock<openvdb::Int32Grid>(label_grid(map, touched))->tree().getValue(at) == int(map.classes.at_slot(2).id));
  CHECK(stock<openvdb::FloatGrid>(label_probability_grid(map, touched))->tree().getValue(at) == 0.875f);
  CHECK(stock<openvdb::FloatGrid>(entropy_grid(map, touched))->tree().getValue(at) == 0.125f);
}
