#include "mapping/class_belief.h"

#include <catch2/catch.hpp>
#include <cmath>

namespace felt {
namespace {

/// A block whose voxel 5 has the given counts above the prior, by slot.
struct Evidence {
  BlockStore store{0.08f};
  uint32_t number = store.find_or_create({0, 0, 0});

  explicit Evidence(const std::vector<std::pair<uint16_t, float>>& counts) {
    for (const auto& [slot, count] : counts) {
      Plane* plane = store.new_plane();
      plane->value[5] = count;
      store[number].evidence.push_back({slot, plane});
    }
  }
  ClassBelief at(int offset, int classes) const { return class_belief(store[number], offset, classes); }
};

}  // namespace

TEST_CASE("class probabilities are counts above one prior count a class") {
  const Evidence evidence({{1, 2.0f}, {3, 5.0f}});
  const ClassBelief belief = evidence.at(5, 4);
  CHECK(belief.slot == 3);
  CHECK(belief.probability == Approx(6.0 / 11));
  double entropy = 0;
  for (const double p : {1.0 / 11, 3.0 / 11, 1.0 / 11, 6.0 / 11}) entropy -= p * std::log(p);
  CHECK(belief.entropy == Approx(entropy));
}

TEST_CASE("a voxel without evidence has no class, and equal counts give the lower slot") {
  const Evidence evidence({{0, 3.0f}, {2, 3.0f}});
  CHECK(evidence.at(6, 4).slot == ClassTable::kNoSlot);
  CHECK(evidence.at(5, 4).slot == 0);
}

}  // namespace felt
