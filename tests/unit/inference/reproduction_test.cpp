// Published situations that the models must get right (docs/inference.md, "Reproductions").
#include <catch2/catch.hpp>
#include <cmath>

#include "bench/paper/friction_table.h"
#include "inference/dirichlet.h"
#include "inference/material.h"
#include "inference/mixture.h"
#include "inference/priors.h"
#include "inference/student_t.h"

namespace felt {
namespace {

using paper::kMaterials;
constexpr size_t kConcrete = 0, kSnow = 6;

// E of friction, over classes, in a region that vision saw `frames` times as `seen`, after one touch.
double expected_friction(size_t seen, double frames, double reading) {
  std::vector<double> alpha(kMaterials.size(), 1);
  alpha[seen] += frames;
  std::vector<Nig> prior;
  for (const auto& m : kMaterials) prior.push_back(calibrated_prior(m.mean, m.sd));
  const MaterialPosterior p =
      material_posterior(alpha, prior, statistics_of(std::vector<double>{reading}), kDefaultRho);
  std::vector<Nig> posterior;
  for (const MaterialClass& c : p.classes) posterior.push_back(c.posterior);
  return *mean(predictive_mixture(p.belief.p, posterior));
}

struct Door {
  std::vector<double> a{10, 10};
  std::vector<Nig> nig{{-20, 1, 3, 30}, {20, 1, 3, 30}};
};

}  // namespace

TEST_CASE("ice crossing: one slippery reading on what looks like snow or concrete brings friction to a static gait's") {
  for (size_t seen : {kSnow, kConcrete}) {
    for (double frames : {0.0, 1.0, 5.0, 20.0, 50.0}) {
      INFO(kMaterials[seen].name << " seen " << frames << " times");
      CHECK(expected_friction(seen, frames, 0.139) <= 0.25);
      CHECK(expected_friction(seen, frames, 0.156) <= 0.25);
      CHECK(expected_friction(seen, frames, 0.628) > 0.25);
    }
  }
}

TEST_CASE("ice crossing: vision without a cap outvotes the touch from some fifty frames on") {
  CHECK(expected_friction(kSnow, 50, 0.156) <= 0.25);
  CHECK(expected_friction(kSnow, 60, 0.156) > 0.25);
}

TEST_CASE("a door that was pushed: the touch goes to the push direction alone") {
  Door door;
  const MixtureUpdate u = mixture_update(door.a, door.nig, 57);
  const double total = total_concentration(u.a);
  CHECK(u.a[0] / total == Approx(0.477).margin(0.001));
  CHECK(u.a[1] / total == Approx(0.523).margin(0.001));
  CHECK(plug_in_variance(u.nig[1]) == Approx(99).margin(1));
  CHECK(plug_in_variance(u.nig[0]) == Approx(10).epsilon(0.02));
  CHECK(u.nig[0].tau == Approx(-20).epsilon(0.02));
}

TEST_CASE("doors of one class, touched in sequence, are learned in both directions") {
  Door door;
  for (double force : {57.0, -38.0, 44.0, -51.0, 31.0, -29.0}) {
    const MixtureUpdate u = mixture_update(door.a, door.nig, force);
    door.a = u.a;
    door.nig = u.nig;
  }
  CHECK(plug_in_variance(door.nig[0]) == Approx(72).margin(1));
  CHECK(plug_in_variance(door.nig[1]) == Approx(85).margin(1));
  CHECK(door.nig[0].tau == Approx(-35).margin(0.5));
  CHECK(door.nig[1].tau == Approx(37).margin(0.5));
}

TEST_CASE("the published moments turn the first door into no prior at all") {
  const Door door;
  const MixtureUpdate u = mixture_update(door.a, door.nig, 57, 0, Projection::published);
  CHECK_FALSE(u.valid);
  CHECK(std::min(u.nig[0].kappa, u.nig[1].kappa) == Approx(-5.4).margin(0.05));
}

TEST_CASE("the projected concentrations cannot change a label after one touch") {
  // a^_i/A^ would need r_i > 1 + r_j to overtake a label that leads by one count.
  std::vector<Nig> prior;
  for (const auto& m : kMaterials) prior.push_back(calibrated_prior(m.mean, m.sd));
  for (size_t label = 0; label < kMaterials.size(); ++label) {
    std::vector<double> a(kMaterials.size(), 1);
    a[label] += 1;
    for (double psi = -0.2; psi < 1.2; psi += 0.05) {
      for (Projection projection : {Projection::kl, Projection::published}) {
        const MixtureUpdate u = mixture_update(a, prior, psi, 0, projection);
        for (double x : u.a) CHECK(x <= u.a[label]);
      }
    }
  }
}

}  // namespace felt
