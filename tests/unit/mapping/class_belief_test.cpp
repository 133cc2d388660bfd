#include "mapping/labels/class_belief.h"

#include <catch2/catch.hpp>
#include <cmath>

namespace felt {
namespace {

ClassTable table(int k, const std::vector<double>& priors = {}) {
  std::vector<ClassInfo> classes;
  for (int i = 0; i < k; ++i)
    classes.push_back(
        {.id = uint16_t(i), .name = std::to_string(i), .color = {}, .prior = priors.empty() ? 1 : priors[size_t(i)]});
  return ClassTable(classes);
}

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
  ClassBelief at(int offset, int classes) const { return class_belief(store[number], offset, table(classes)); }
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

TEST_CASE("every belief follows from the concentrations, for any prior and with shared evidence") {
  Evidence evidence({{1, 2.0f}, {3, 5.0f}});
  for (const bool shared : {false, true}) {
    if (shared) {
      evidence.store[evidence.number].even_evidence = evidence.store.new_plane();
      evidence.store[evidence.number].even_evidence->value[5] = 2;
    }
    const double even = shared ? 0.5 : 0;
    for (const std::vector<double>& priors :
         {std::vector<double>{1, 1, 1, 1}, std::vector<double>{0.25, 0.25, 0.25, 0.25},
          std::vector<double>{9, 1, 2, 1}}) {
      const ClassTable classes = table(4, priors);
      const Block& block = evidence.store[evidence.number];
      std::vector<double> alpha(4);
      class_concentration(&block, 5, classes, alpha);
      const std::vector<double> expected = {priors[0] + even, priors[1] + even + 2, priors[2] + even,
                                            priors[3] + even + 5};
      CHECK(alpha == expected);
      double total = 0, entropy = 0;
      for (const double a : expected) total += a;
      for (const double a : expected) entropy -= a / total * std::log(a / total);
      const ClassBelief belief = class_belief(block, 5, classes);
      CHECK(belief.slot == (priors[0] == 9 ? 0 : 3));
      CHECK(belief.probability == Approx(expected[belief.slot] / total));
      CHECK(belief.entropy == Approx(entropy));
      CHECK(total_evidence(block, 5) == Approx(7 + 4 * even));
    }
  }
}

}  // namespace felt
