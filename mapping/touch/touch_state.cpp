#include "mapping/touch/touch_state.h"

#include <tbb/parallel_for.h>
#include <limits>
#include <utility>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "inference/decision.h"
#include "inference/mixture.h"
#include "inference/priors.h"
#include "mapping/labels/class_belief.h"

namespace felt {
namespace {

/// No class of a pooled belief is below this.
constexpr double kBeliefFloor = 1e-6;

/// Vision concentrations of one voxel.
std::vector<double> vision_concentration(const Map& map, const Index3& voxel) {
  std::vector<double> alpha(size_t(map.classes.size()));
  class_concentration(map.store.get(block_of_voxel(voxel)), offset_in_block(voxel), map.classes, alpha);
  return alpha;
}

/// Sum of the concentrations of a region by slot, and in total.
std::vector<double> summed_concentration(const Map& map, const Region& region) {
  const size_t k = size_t(map.classes.size());
  std::vector<double> of_block(region.blocks() * k, 0.0);
  tbb::parallel_for(size_t(0), region.blocks(), [&](size_t b) {
    double* sum = &of_block[b * k];
    const Block* block = map.store.get(region.coord[b]);
    if (block == nullptr) return;
    for (const EvidencePlane& e : block->evidence)
      for_each_bit(region.mask[b], [&](int i) { sum[e.slot] += double(e.counts->value[i]); });
    if (block->even_evidence == nullptr) return;
    double even = 0;
    for_each_bit(region.mask[b], [&](int i) { even += double(block->even_evidence->value[i]); });
    for (size_t c = 0; c < k; ++c) sum[c] += even / double(k);
  });
  std::vector<double> total(k);
  for (size_t c = 0; c < k; ++c) total[c] = double(region.voxels()) * map.classes.prior(int(c));
  for (size_t i = 0; i < of_block.size(); ++i) total[i % k] += of_block[i];
  return total;
}

/// Adds the voxels of `other`: in place where they lie in blocks that `sum` has.
void unite(Region& sum, const Region& other) {
  size_t s = 0;
  for (size_t b = 0; b < other.blocks(); ++b) {
    while (s < sum.blocks() && sum.coord[s] < other.coord[b]) ++s;
    if (s == sum.blocks() || !(sum.coord[s] == other.coord[b])) {
      sum = united(sum, other);
      return;
    }
    sum.mask[s] |= other.mask[b];
  }
}

size_t voxels_in_both(const Region& a, const Region& b) {
  size_t n = 0;
  for (size_t i = 0, j = 0; i < a.blocks() && j < b.blocks();) {
    if (a.coord[i] == b.coord[j])
      n += size_t((a.mask[i++] & b.mask[j++]).count());
    else
      ++(a.coord[i] < b.coord[j] ? i : j);
  }
  return n;
}

/// The next reading by slot: of this region where it was touched (`material`), else of the classes. Classes without a
/// prior have weight 0; no weights at all where none is left.
StudentTMixture next_reading(const std::vector<double>& p, const std::vector<Nig>& nig,
                             const MaterialPosterior* material) {
  StudentTMixture next;
  double total = 0;
  for (size_t c = 0; c < p.size(); ++c) total += has_prior(nig[c]) ? p[c] : 0;
  if (!(total > 0)) return next;
  for (size_t c = 0; c < p.size(); ++c) {
    next.weight.push_back(has_prior(nig[c]) ? p[c] / total : 0);
    next.component.push_back(!has_prior(nig[c])    ? StudentT{}
                             : material != nullptr ? material->classes[c].next_here
                                                   : predictive(nig[c]));
  }
  return next;
}

}  // namespace

std::vector<Nig> nig_priors(const Property& property, const ClassTable& classes) {
  const ClassPriors priors = class_priors(property, classes);
  std::vector<Nig> nig(size_t(priors.size()));
  for (size_t c = 0; c < nig.size(); ++c)
    if (priors.has_prior[c]) nig[c] = {priors.tau[c], priors.kappa[c], priors.beta[c], priors.gamma[c]};
  return nig;
}

Region material_reach(const Map& map, const std::vector<uint32_t>& touches, Region region) {
  for (const uint32_t t : touches)
    if (map.touches.touches[t].request.model == TouchModel::material) unite(region, map.touches.touches[t].region);
  return region;
}

std::vector<double> pooled_belief(const Map& map, const Region& region) {
  std::vector<double> belief = summed_concentration(map, region);
  const double total = std::accumulate(belief.begin(), belief.end(), 0.0);
  for (double& p : belief) p /= total;
  apply_belief_floor(belief, kBeliefFloor);
  return belief;
}

void apply_concentration_floor(std::span<double> concentration) {
  const double total = std::accumulate(concentration.begin(), concentration.end(), 0.0);
  for (double& a : concentration) a = std::max(a, kBeliefFloor * total);
}

std::vector<uint32_t> covering_touches(const Map& map, const Index3& voxel) {
  std::vector<uint32_t> touches;
  for (uint32_t t = 0; t < map.touches.touches.size(); ++t)
    if (const Touch& touch = map.touches.touches[t]; !touch.undone && touch.region.contains(voxel))
      touches.push_back(t);
  return touches;
}

std::vector<uint32_t> covering_touches(const Map& map, const Region& region) {
  std::vector<uint32_t> touches;
  const size_t voxels = region.voxels();
  for (uint32_t t = 0; t < map.touches.touches.size(); ++t)
    if (const Touch& touch = map.touches.touches[t]; !touch.undone && 2 * voxels_in_both(touch.region, region) > voxels)
      touches.push_back(t);
  return touches;
}

size_t touches_of_a_part(const Map& map, const Region& region) {
  const size_t voxels = region.voxels();
  return size_t(std::count_if(map.touches.touches.begin(), map.touches.touches.end(), [&](const Touch& touch) {
    const size_t both = touch.undone ? 0 : voxels_in_both(touch.region, region);
    return both > 0 && 2 * both <= voxels;
  }));
}

bool any_mixture(const Map& map, const std::vector<uint32_t>& touches) {
  return std::any_of(touches.begin(), touches.end(),
                     [&](uint32_t t) { return map.touches.touches[t].request.model == TouchModel::mixture; });
}

Beliefs::Beliefs(const Map& map) : map_(map) {
  for (const Property& property : map.properties.properties()) priors_.push_back(nig_priors(property, map.classes));
}

MaterialState Beliefs::evaluate(std::span<const double> pooled, const std::vector<uint32_t>& touches) const {
  MaterialState state;
  state.properties.resize(priors_.size());
  state.readings.assign(priors_.size(), 0);
  std::vector<double> log_likelihood(pooled.size(), 0.0);
  for (size_t p = 0; p < priors_.size(); ++p) {
    const Property& property = map_.properties[int(p)];
    std::vector<double> psi, noise;
    double rho = property.rho;
    for (const uint32_t t : touches) {
      const TouchRequest& r = map_.touches.touches[t].request;
      if (r.model != TouchModel::material || r.property != property.name) continue;
      psi.push_back(r.value);
      noise.push_back(r.sigma);
      if (!std::isnan(r.rho)) rho = r.rho;
    }
    if (psi.empty()) continue;
    const bool exact = std::all_of(noise.begin(), noise.end(), [](double sigma) { return sigma == 0; });
    if (exact) noise.clear();
    state.properties[p] = material_posterior(pooled, priors_[p], psi, noise, rho);
    state.readings[p] = double(psi.size());
    for (size_t c = 0; c < pooled.size(); ++c) log_likelihood[c] += state.properties[p].classes[c].log_evidence;
  }
  state.classes = class_posterior(pooled, log_likelihood);
  return state;
}

const MaterialState& Beliefs::material(const std::vector<uint32_t>& touches) {
  const auto [at, is_new] = cache_.try_emplace(touches);
  if (is_new) at->second = evaluate(pooled_belief(map_, material_reach(map_, touches)), touches);
  return at->second;
}

bool Beliefs::has_material(const std::vector<uint32_t>& touches) const {
  return std::any_of(touches.begin(), touches.end(),
                     [&](uint32_t t) { return map_.touches.touches[t].request.model == TouchModel::material; });
}

Belief Beliefs::assemble(std::vector<double> vision, const MaterialState* material,
                         const std::vector<uint32_t>& touches) const {
  Belief belief;
  const size_t properties = priors_.size();
  double total = std::accumulate(vision.begin(), vision.end(), 0.0);
  belief.nig = priors_;
  belief.readings.assign(properties, 0);
  belief.log_evidence.assign(properties, 0);
  belief.concentration = std::move(vision);
  if (material != nullptr) {
    for (size_t p = 0; p < properties; ++p) {
      if (material->readings[p] == 0) continue;
      MaterialPosterior joint = material->properties[p];
      belief.log_evidence[p] = joint.belief.log_evidence;
      belief.readings[p] = material->readings[p];
      total += material->readings[p];
      joint.belief = material->classes;
      belief.nig[p] = moment_matched_view(joint, priors_[p], total).nig;
    }
    constexpr double kLeast = std::numeric_limits<float>::min();
    for (size_t c = 0; c < belief.concentration.size(); ++c)
      belief.concentration[c] = std::max(kLeast, material->classes.p[c] * total);
  }
  std::vector<bool> mixed(properties, false);
  bool first = true;
  for (const uint32_t t : touches) {
    const TouchRequest& r = map_.touches.touches[t].request;
    if (r.model != TouchModel::mixture) continue;
    if (std::exchange(first, false) && material != nullptr) apply_concentration_floor(belief.concentration);
    const size_t p = size_t(*map_.properties.index_of(r.property));
    const MixtureUpdate update = mixture_update(belief.concentration, belief.nig[p], r.value, r.sigma, r.projection);
    mixed[p] = true;
    belief.readings[p] += 1;
    belief.log_evidence[p] += update.responsibility.log_evidence;
    belief.refused += !update.valid;
    if (!update.valid) continue;
    belief.concentration = update.a;
    belief.nig[p] = update.nig;
  }
  belief.class_probability = belief.concentration;
  const double sum = std::accumulate(belief.concentration.begin(), belief.concentration.end(), 0.0);
  for (double& p : belief.class_probability) p /= sum;
  for (size_t p = 0; p < properties; ++p) {
    const bool here = !mixed[p] && material != nullptr && material->readings[p] > 0;
    belief.next_reading.push_back(
        next_reading(belief.class_probability, belief.nig[p], here ? &material->properties[p] : nullptr));
  }
  return belief;
}

Belief Beliefs::at(const Index3& voxel) {
  const std::vector<uint32_t> touches = covering_touches(map_, voxel);
  return assemble(vision_concentration(map_, voxel), has_material(touches) ? &material(touches) : nullptr, touches);
}

Belief Beliefs::of(const Region& region, const std::vector<uint32_t>& touches) {
  std::vector<double> mean = summed_concentration(map_, region);
  for (double& alpha : mean) alpha /= double(region.voxels());
  if (!has_material(touches)) return assemble(std::move(mean), nullptr, touches);
  const MaterialState state = evaluate(pooled_belief(map_, material_reach(map_, touches, region)), touches);
  return assemble(std::move(mean), &state, touches);
}

std::vector<std::pair<size_t, Region>> taken_out(std::vector<TouchGroup>& groups, const Region& region) {
  std::vector<std::pair<size_t, Region>> taken;
  Region rest = region;
  for (size_t g = 0; g < groups.size() && !rest.empty(); ++g) {
    Region shared = intersected(groups[g].region, rest);
    if (shared.empty()) continue;
    rest = subtracted(rest, shared);
    groups[g].region = subtracted(groups[g].region, shared);
    taken.emplace_back(g, std::move(shared));
  }
  if (!rest.empty()) taken.emplace_back(groups.size(), std::move(rest));
  return taken;
}

std::vector<TouchGroup> touch_groups(const Map& map) {
  std::vector<TouchGroup> groups;
  for (uint32_t t = 0; t < map.touches.touches.size(); ++t) {
    const Touch& touch = map.touches.touches[t];
    if (touch.undone) continue;
    const size_t known = groups.size();
    for (auto& [from, shared] : taken_out(groups, touch.region)) {
      std::vector<uint32_t> touches = from < known ? groups[from].touches : std::vector<uint32_t>();
      touches.push_back(t);
      groups.push_back({std::move(touches), std::move(shared)});
    }
    std::erase_if(groups, [](const TouchGroup& g) { return g.region.empty(); });
  }
  std::sort(groups.begin(), groups.end(),
            [](const TouchGroup& a, const TouchGroup& b) { return a.touches < b.touches; });
  return groups;
}

}  // namespace felt
