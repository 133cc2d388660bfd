#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "inference/mixture.h"
#include "mapping/touch/touch_mixture.h"
#include "mapping/touch/touch_update.h"
#include "mapping/touch/touch_view.h"
#include "tests/support/labelled_map.h"
#include "tests/support/material_floors.h"

using namespace felt;
using namespace felt::test;

namespace {

/// Vision counts that a later frame would add.
void another_frame(Map& map, int slot) {
  for (Block& block : map.store.blocks())
    for (int i = 0; i < kBlockVoxels; ++i)
      if (std::abs(block.geometry->tsdf[i]) <= float(kFloorVoxel_m) && block.geometry->weight[i] > 0) {
        const Index3 f = first_voxel(block.coord), v = voxel_of_offset(i);
        add_evidence(map, {f.x + v.x, f.y + v.y, f.z + v.z}, slot, 1);
      }
}

/// By voxel of the region, in canonical order, one voxel at a time.
std::vector<int> strongest_classes(const Map& map, const Region& region) {
  Beliefs beliefs(map);
  std::vector<int> strongest;
  for (size_t b = 0; b < region.blocks(); ++b)
    for_each_bit(region.mask[b], [&](int i) {
      const Index3 f = first_voxel(region.coord[b]), v = voxel_of_offset(i);
      strongest.push_back(most_probable_class(beliefs.at({f.x + v.x, f.y + v.y, f.z + v.z}).class_probability));
    });
  return strongest;
}

double expected_friction(Beliefs& beliefs, const Index3& voxel) { return *mean(beliefs.at(voxel).next_reading[0]); }

}  // namespace

TEST_CASE(
    "ice that vision calls snow or concrete is crossed with care after one slippery touch, not after a rough one") {
  for (const int seen_as : {snow, concrete})
    for (const auto& [value, careful] : {std::pair(0.139, true), {0.156, true}, {0.628, false}}) {
      INFO("seen as " << kMaterials[size_t(seen_as)] << ", reading " << value);
      Map map = two_floors(seen_as, seen_as, 50);
      touch(map, reading(0.1, 0.1, value));
      Beliefs beliefs(map);
      CHECK((expected_friction(beliefs, {3, 3, 0}) <= 0.25) == careful);
      CHECK((most_probable_class(beliefs.at({-15, 9, 0}).class_probability) == ice) == careful);
    }
}

TEST_CASE("a touched region has the scalar material posterior of its pooled belief, and untouched voxels their prior") {
  Map map = two_floors(snow, wood, 7);
  touch(map, reading(-0.2, 0, 0.3));
  touch(map, reading(-0.1, 0.1, 0.27, 1));
  const Region region = map.touches.touches[0].region;
  REQUIRE(region == map.touches.touches[1].region);
  const std::vector<double> pooled = pooled_belief(map, region);
  CHECK(pooled[snow] == Approx(8.0 / 15).epsilon(1e-12));
  const MaterialPosterior expected = material_posterior(pooled, nig_priors(map.properties[0], map.classes),
                                                        statistics_of(std::vector{0.3, 0.27}), 0.5);
  Beliefs beliefs(map);
  const Belief inside = beliefs.at({-10, 0, 0}), outside = beliefs.at({10, 0, 0});
  for (size_t c = 0; c < 8; ++c) {
    CHECK(inside.class_probability[c] == Approx(expected.belief.p[c]).epsilon(1e-12));
    CHECK(inside.next_reading[0].component[c].location ==
          Approx(expected.classes[c].next_here.location).epsilon(1e-12));
    CHECK(outside.class_probability[c] == Approx((c == wood ? 8 : 1) / 15.0).epsilon(1e-12));
    CHECK(outside.nig[0][c] == nig_priors(map.properties[0], map.classes)[c]);
  }
  CHECK(inside.log_evidence[0] == Approx(expected.belief.log_evidence).epsilon(1e-12));
}

TEST_CASE("readings with noise of their own have the scalar posterior that knows it, in either model") {
  const std::vector<double> psi{0.3, 0.27}, sigma{0.1, 0.02};
  for (const TouchModel model : {TouchModel::material, TouchModel::mixture}) {
    Map map = two_floors(snow, wood, 7);
    for (size_t n = 0; n < psi.size(); ++n) {
      TouchRequest request = reading(-0.2, 0, psi[n], double(n), model);
      request.sigma = sigma[n];
      touch(map, request);
    }
    const std::vector<Nig> priors = nig_priors(map.properties[0], map.classes);
    Beliefs beliefs(map);
    const Belief found = beliefs.at({-10, 0, 0});
    if (model == TouchModel::material) {
      const std::vector<double> pooled = pooled_belief(map, map.touches.touches[0].region);
      const MaterialPosterior expected = material_posterior(pooled, priors, psi, sigma, 0.5);
      for (size_t c = 0; c < 8; ++c) CHECK(found.class_probability[c] == Approx(expected.belief.p[c]).epsilon(1e-12));
      CHECK(found.log_evidence[0] == Approx(expected.belief.log_evidence).epsilon(1e-12));
      continue;
    }
    std::vector<double> a(8, 1.0);
    a[snow] += 7;
    const MixtureUpdate once = mixture_update(a, priors, psi[0], sigma[0]),
                        twice = mixture_update(once.a, once.nig, psi[1], sigma[1]);
    for (size_t c = 0; c < 8; ++c) {
      CHECK(found.concentration[c] == Approx(twice.a[c]).epsilon(1e-12));
      CHECK(found.nig[0][c].tau == Approx(twice.nig[c].tau).epsilon(1e-12));
    }
  }
}

TEST_CASE("readings of two properties in one region multiply, with the correlation that a touch names") {
  Map map = two_floors(snow, wood, 7);
  Property warmth;
  warmth.name = "warmth";
  for (const std::string& name : kMaterials) warmth.priors[name] = {280, 5, 20};
  warmth.priors["snow"] = {271, 2, 20};
  warmth.priors["ice"] = {273, 2, 20};
  map.properties = PropertyTable({friction()[0], warmth});
  touch(map, reading(-0.2, 0, 0.25));
  const std::vector<double> warm{274, 272};
  for (size_t n = 0; n < warm.size(); ++n) {
    TouchRequest request = reading(-0.2, 0, warm[n], 1 + double(n));
    request.property = "warmth";
    request.rho = 0.2;
    touch(map, request);
  }
  const std::vector<double> pooled = pooled_belief(map, map.touches.touches[0].region);
  const std::vector<Nig> of_friction = nig_priors(map.properties[0], map.classes),
                         of_warmth = nig_priors(map.properties[1], map.classes);
  std::vector<double> log_likelihood;
  for (size_t c = 0; c < 8; ++c)
    log_likelihood.push_back(material_class(of_friction[c], statistics_of(std::vector{0.25}), 0.5).log_evidence +
                             material_class(of_warmth[c], statistics_of(warm), 0.2).log_evidence);
  const ClassPosterior expected = class_posterior(pooled, log_likelihood);
  const std::vector<double> found = Beliefs(map).at({-10, 0, 0}).class_probability;
  for (size_t c = 0; c < 8; ++c) CHECK(found[c] == Approx(expected.p[c]).epsilon(1e-12));
}

TEST_CASE("a class that vision all but rules out is believed after enough readings") {
  Map map = two_floors(snow, wood, 0);
  std::vector<ClassInfo> classes = map.classes.classes();
  for (ClassInfo& c : classes) c.prior = 1e-12;
  map.classes = ClassTable(classes);
  for (int n = 0; n < 50; ++n) another_frame(map, snow);
  for (int n = 0; n < 8; ++n) {
    // Eight readings so little correlated say 4.5e7 times as much for ice; vision says 5e13 times as much for snow.
    TouchRequest request = reading(-0.2, 0, 0.15, n);
    request.rho = 0.2;
    touch(map, request);
  }
  CHECK(most_probable_class(Beliefs(map).at({-10, 0, 0}).class_probability) == ice);
}

TEST_CASE("statistics planes hold the readings that cover a voxel, and only in touched blocks") {
  Map map = two_floors(snow, wood, 7);
  touch(map, reading(-0.2, 0, 0.3));
  touch(map, reading(-0.1, 0.1, 0.5, 1));
  const Block& touched = *map.store.get(block_of_voxel({-10, 0, 0}));
  REQUIRE(touched.touch.size() == 1);
  const int i = offset_in_block({-10, 0, 0});
  CHECK(touched.touch[0].n->value[i] == 2);
  CHECK(touched.touch[0].mean->value[i] == Approx(0.4f));
  CHECK(touched.touch[0].m2->value[i] == Approx(0.02f));
  CHECK(map.store.get(block_of_voxel({10, 0, 0}))->touch.empty());
}

TEST_CASE("touches in any order, before, between and after frames, give the same map") {
  std::vector<TouchRequest> requests{reading(-0.2, 0, 0.15, 3), reading(-0.1, 0.1, 0.17, 1), reading(0.2, 0, 0.4, 2),
                                     reading(0.2, 0.1, 0.38, 2, TouchModel::mixture), reading(-0.2, 0, 0.15, 3)};
  requests[1].region.rule = RegionRule::sphere;
  requests[1].region.radius_m = 0.15;
  std::mt19937 rng(7);
  std::string expected;
  std::vector<double> belief;
  for (int trial = 0; trial < 8; ++trial) {
    Map map = two_floors(snow, wood, 7);
    std::vector<Touch> touches;
    for (const TouchRequest& request : requests) touches.push_back(resolve_touch(map, request));
    std::shuffle(touches.begin(), touches.end(), rng);
    // Frames come after the first `frame` touches.
    const size_t frame = size_t(trial) % (touches.size() + 1);
    for (size_t t = 0; t <= touches.size(); ++t) {
      if (t == frame) another_frame(map, snow), another_frame(map, concrete);
      if (t < touches.size()) add_touch(map, touches[t]);
    }
    const std::vector<double> p = Beliefs(map).at({-10, 0, 0}).class_probability;
    if (trial == 0) expected = map_hash(map), belief = p;
    CHECK(map_hash(map) == expected);
    CHECK(p == belief);
  }
}

TEST_CASE("each voxel of a mixture region has the scalar update of its own state") {
  Map map = two_floors(snow, wood, 3);
  std::mt19937 rng(3);
  for (const Index3 v : {Index3{-10, 0, 0}, {-9, 3, 1}, {-1, 7, -1}, {-17, -8, 0}})
    for (int slot = 0; slot < 8; ++slot) add_evidence(map, v, slot, float(rng() % 3));
  touch(map, reading(-0.2, 0.05, 0.25, 0, TouchModel::mixture));
  touch(map, reading(-0.2, 0.05, 0.41, 1, TouchModel::mixture));
  const std::vector<Nig> priors = nig_priors(map.properties[0], map.classes);
  const MixtureState state = mixture_state(map, map.touches.touches[0].region);
  size_t voxels = 0;
  for (const MixtureBlock& block : state.blocks) {
    const size_t m = block.voxels;
    voxels += m;
    size_t i = 0;
    for_each_bit(block.mask, [&](int offset) {
      std::vector<double> a(8, 1.0);
      for (const EvidencePlane& e : map.store.get(block.coord)->evidence) a[e.slot] += double(e.counts->value[offset]);
      const MixtureUpdate once = mixture_update(a, priors, 0.25), twice = mixture_update(once.a, once.nig, 0.41);
      for (size_t c = 0; c < 8; ++c) {
        // The kernel's own bounds (inference/batch/mixture.h) for two readings; the log evidences stay below 20.
        const Nig nig = state.nig(block, block.properties[0], c, i), &exact = twice.nig[c];
        REQUIRE(block.a[c * m + i] == Approx(twice.a[c]).epsilon(4e-5));
        REQUIRE(std::abs(nig.tau - exact.tau) < 6e-5 * std::sqrt(plug_in_variance(exact)));
        REQUIRE(nig.kappa == Approx(exact.kappa).epsilon(6e-5));
        REQUIRE(nig.beta == Approx(exact.beta).epsilon(6e-5));
        REQUIRE(nig.gamma == Approx(exact.gamma).epsilon(6e-5));
      }
      ++i;
    });
  }
  CHECK(voxels == map.touches.touches[0].region.voxels());
}

TEST_CASE("mixture readings go on from material ones, also where classes have no prior or were ruled out") {
  std::vector<std::string> names = kMaterials;
  names.push_back("paper");  // whose friction nobody measured
  Map map = labelled_map(
      kFloorVoxel_m, {-0.2, -0.2, -0.1}, {0.2, 0.2, 0.1}, [](const Eigen::Vector3d& p) { return p.z(); },
      class_table(names), [](const Eigen::Vector3d& p) { return p.x() < 0 ? int(snow) : 8; }, 5);
  map.properties = friction();
  TouchRequest first = reading(-0.1, 0.05, 0.19);
  first.region.rule = RegionRule::sphere;
  first.region.radius_m = 0.25;
  touch(map, first);
  for (int n = 1; n <= 6; ++n) {
    TouchRequest next = first;
    next.stamp_s = n, next.value = 0.2 + 0.01 * n, next.model = TouchModel::mixture;
    touch(map, next);
  }
  const Region& region = map.touches.touches[0].region;
  REQUIRE(region.voxels() > 100);
  const MixtureState state = mixture_state(map, region);
  for (const size_t refused : state.refused) CHECK(refused == 0);
  // The batch over blocks is the scalar rule of each voxel.
  Beliefs beliefs(map);
  for (const MixtureBlock& block : state.blocks) {
    size_t i = 0;
    for_each_bit(block.mask, [&](int offset) {
      const Index3 f = first_voxel(block.coord), v = voxel_of_offset(offset);
      const Belief belief = beliefs.at({f.x + v.x, f.y + v.y, f.z + v.z});
      REQUIRE(belief.refused == 0);
      REQUIRE(block.a[ice * block.voxels + i] == Approx(belief.concentration[ice]).epsilon(2e-4));
      ++i;
    });
  }
}

TEST_CASE("a voxel that the published projection cannot serve keeps its state and is counted") {
  Map map = two_floors(snow, wood, 1);
  Property door;
  door.name = "door";
  door.priors = {{"snow", {-20, 3.2, 1}}, {"wood", {20, 3.2, 1}}};
  map.properties = PropertyTable({door});
  TouchRequest request = reading(0.2, 0, 57, 0, TouchModel::mixture);
  request.property = "door";
  request.projection = Projection::published;
  const TouchEffect effect = apply_touch(map, resolve_touch(map, request));
  const Touch& recorded = *map.touches.find(effect.id);
  CHECK(effect.refused == recorded.region.voxels());
  CHECK(recorded.refused_voxels == effect.refused);
  const Belief belief = Beliefs(map).at({10, 0, 0});
  CHECK(belief.nig[0][snow] == nig_priors(door, map.classes)[snow]);
  CHECK(belief.concentration[wood] == 2);
}

TEST_CASE("a touch says what it changed, and flags a reading that no class explains") {
  Map map = two_floors(snow, wood, 20);
  const TouchEffect effect = apply_touch(map, resolve_touch(map, reading(-0.2, 0, 0.15)));
  const Region& region = map.touches.find(effect.id)->region;
  CHECK(most_probable_class(effect.before.class_probability) == snow);
  CHECK(most_probable_class(effect.after.class_probability) == ice);
  CHECK(effect.relabelled == region.voxels());
  CHECK_FALSE(effect.flags.surprising);
  const TouchEffect strange = apply_touch(map, resolve_touch(map, reading(-0.2, 0, 3.0, 1)));
  CHECK(strange.flags.surprising);
  CHECK(strange.tail_probability < 1e-3);
}

TEST_CASE("a reading surprises by as much as its own noise leaves it") {
  for (const TouchModel model : {TouchModel::material, TouchModel::mixture}) {
    Map map = two_floors(snow, wood, 20);
    TouchRequest vague = reading(-0.2, 0, 1.5, 0, model), precise = reading(-0.2, 0, 1.5, 1, model);
    vague.sigma = 3;
    const TouchEffect first = apply_touch(map, resolve_touch(map, vague));
    CHECK_FALSE(first.flags.surprising);
    CHECK_FALSE(first.flags.not_one_material);
    CHECK(first.tail_probability > 0.5);
    CHECK(first.after.class_probability[snow] == Approx(first.before.class_probability[snow]).epsilon(0.01));
    // The noise of an earlier reading excuses no later one.
    const TouchEffect second = apply_touch(map, resolve_touch(map, precise));
    CHECK(second.flags.surprising);
    CHECK(second.tail_probability < 1e-3);
  }
}

TEST_CASE("views hold the label and the property of touched voxels") {
  Map map = two_floors(snow, wood, 20);
  touch(map, reading(-0.2, 0, 0.15));
  touch(map, reading(0.2, 0, 0.37, 0, TouchModel::mixture));
  Beliefs beliefs(map);
  size_t voxels = 0;
  for (const TouchView& view : touch_views(map))
    for_each_bit(view.mask, [&](int i) {
      ++voxels;
      const Index3 f = first_voxel(view.coord), v = voxel_of_offset(i);
      const Belief belief = beliefs.at({f.x + v.x, f.y + v.y, f.z + v.z});
      REQUIRE(view.label[size_t(i)] == most_probable_class(belief.class_probability));
      REQUIRE(view.mean[0][size_t(i)] == Approx(*mean(belief.next_reading[0])).epsilon(1e-5));
      REQUIRE(view.sd[0][size_t(i)] == Approx(std::sqrt(*variance(belief.next_reading[0]))).epsilon(1e-4));
    });
  CHECK(voxels == map.touches.touches[0].region.voxels() + map.touches.touches[1].region.voxels());
}

TEST_CASE("untouched segments keep every bit") {
  Map map = two_floors(snow, wood, 20);
  const Block before = *map.store.get(block_of_voxel({10, 0, 0}));
  const Belief belief = Beliefs(map).at({10, 0, 0});
  touch(map, reading(-0.2, 0, 0.15));
  const Block& after = *map.store.get(block_of_voxel({10, 0, 0}));
  CHECK(std::equal(std::begin(before.geometry->tsdf), std::end(before.geometry->tsdf), after.geometry->tsdf));
  CHECK(after.touch.empty());
  CHECK(Beliefs(map).at({10, 0, 0}).class_probability == belief.class_probability);
}

TEST_CASE("a reading that cannot be true is refused with the reason and leaves the map as it was") {
  Map map = two_floors(snow, wood, 4);
  const std::string before = map_hash(map);
  const auto refused = [&](const TouchRequest& request, const std::string& reason) {
    CHECK_THROWS_WITH(touch(map, request), Catch::Contains(reason));
    CHECK(map_hash(map) == before);
    CHECK(map.touches.touches.empty());
  };
  TouchRequest request = reading(0, 0, 0.3);
  request.property = "stiffness";
  refused(request, "property: expected friction, found 'stiffness'");
  refused(reading(0, 0, -0.3), "a number in [0, inf]");
  refused(reading(0, 0, NAN), "value");
  refused(reading(NAN, 0, 0.3), "finite coordinates");
  refused(reading(0, 9, 0.3), "outside the map");
  request = reading(0, 0, 0.3);
  request.sigma = -1;
  refused(request, "sigma");
  request.sigma = 0;
  request.rho = 1;
  refused(request, "rho");
  request.rho = NAN;
  request.region.rule = RegionRule::mask;
  refused(request, "mask image");
  map.classes = class_table({"carpet", "tiles"});
  refused(reading(0.1, 0, 0.3), "with a prior");
}

TEST_CASE("a batch of touches says and leaves what they say and leave one by one") {
  for (const bool mixed : {false, true}) {
    Map one_by_one = two_floors(snow, wood, 3), together = two_floors(snow, wood, 3);
    std::mt19937 rng(mixed ? 2 : 1);
    std::uniform_real_distribution<double> place(-0.2, 0.2), value(0.1, 0.6);
    TouchBatch batch(together);
    uint64_t relabelled = 0;
    for (int n = 0; n < 12; ++n) {
      // Spheres that overlap in all ways, stamps in no order.
      TouchRequest request = reading(place(rng), place(rng), value(rng), double(n * 7 % 12),
                                     mixed && n % 3 == 1 ? TouchModel::mixture : TouchModel::material);
      request.region.rule = RegionRule::sphere;
      request.region.radius_m = 0.06 + 0.02 * (n % 4);
      request.sigma = n % 2 == 0 ? 0 : 0.05;
      const Touch touch = resolve_touch(one_by_one, request);
      const std::vector<int> before = strongest_classes(one_by_one, touch.region);
      const TouchEffect alone = apply_touch(one_by_one, touch), in_batch = batch.apply(touch);
      const std::vector<int> after = strongest_classes(one_by_one, touch.region);
      uint64_t changed = 0;
      for (size_t i = 0; i < before.size(); ++i) changed += before[i] != after[i];
      INFO("touch " << n);
      CHECK(alone.relabelled == changed);
      CHECK(in_batch.relabelled == changed);
      CHECK(in_batch.id == alone.id);
      CHECK(in_batch.refused == alone.refused);
      CHECK(in_batch.before.class_probability == alone.before.class_probability);
      CHECK(in_batch.after.class_probability == alone.after.class_probability);
      relabelled += changed;
    }
    batch.finish();
    CHECK(relabelled > 100);
    CHECK(map_hash(together) == map_hash(one_by_one));
  }
}
