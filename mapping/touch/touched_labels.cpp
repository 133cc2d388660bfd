#include "mapping/touch/touched_labels.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <utility>

#include "inference/decision.h"
#include "mapping/touch/touch_mixture.h"

namespace felt {
namespace {

int16_t vision_label(const Block* block, int offset) {
  float best = 0;
  int16_t label = -1;
  if (block != nullptr)
    for (const EvidencePlane& e : block->evidence)
      if (e.counts->value[offset] > best) best = e.counts->value[offset], label = int16_t(e.slot);
  return label;
}

}  // namespace

TouchedLabels::TouchedLabels(const Map& map) : map_(map), beliefs_(map), groups_(touch_groups(map)) {
  for (const TouchGroup& group : groups_) known_.push_back(known_of(group));
}

void TouchedLabels::insert(uint32_t place) {
  for (TouchGroup& group : groups_)
    for (uint32_t& t : group.touches) t += t >= place;
  const Touch& touch = map_.touches.touches[place];
  const size_t before = groups_.size();
  for (auto& [from, shared] : taken_out(groups_, touch.region)) {
    std::vector<uint32_t> touches = from < before ? groups_[from].touches : std::vector<uint32_t>();
    touches.insert(std::lower_bound(touches.begin(), touches.end(), place), place);
    groups_.push_back({std::move(touches), std::move(shared)});
    if (from == before) {
      known_.push_back(known_of(groups_.back()));
      continue;
    }
    Known known = known_[from];
    known.label.reset();
    if (touch.request.model == TouchModel::material && !subtracted(touch.region, known.reach).empty()) {
      known.reach = united(known.reach, touch.region);
      known.pooled.clear();
    }
    known_.push_back(std::move(known));
  }
  size_t kept = 0;
  for (size_t g = 0; g < groups_.size(); ++g) {
    if (groups_[g].region.empty()) continue;
    if (kept != g) {
      groups_[kept] = std::move(groups_[g]);
      known_[kept] = std::move(known_[g]);
    }
    ++kept;
  }
  groups_.resize(kept);
  known_.resize(kept);
}

TouchedLabels::Answer TouchedLabels::of(const Region& region) {
  Answer out;
  std::vector<size_t> first(region.blocks() + 1, 0);
  for (size_t b = 0; b < region.blocks(); ++b) first[b + 1] = first[b] + size_t(region.mask[b].count());
  out.label.assign(first.back(), -1);
  const auto visit = [&](size_t b, const auto& label_at) {
    size_t n = first[b];
    for_each_bit(region.mask[b], [&](int i) { label_at(out.label[n++], i); });
  };
  tbb::parallel_for(size_t(0), region.blocks(), [&](size_t b) {
    const Block* block = map_.store.get(region.coord[b]);
    visit(b, [&](int16_t& label, int i) { label = vision_label(block, i); });
  });

  std::vector<std::pair<size_t, Region>> here;
  for (size_t g = 0; g < groups_.size(); ++g)
    if (Region shared = intersected(groups_[g].region, region);
        !shared.empty() && !any_mixture(map_, groups_[g].touches))
      here.emplace_back(g, std::move(shared));
  tbb::parallel_for(size_t(0), here.size(), [&](size_t h) {
    const TouchGroup& group = groups_[here[h].first];
    Known& known = known_[here[h].first];
    if (known.label) return;
    if (known.pooled.empty()) known.pooled = pooled_belief(map_, known.reach);
    known.label = int16_t(most_probable_class(beliefs_.evaluate(known.pooled, group.touches).classes.p));
  });
  for (const auto& part : here) {
    const Region& shared = part.second;
    const int16_t label = *known_[part.first].label;
    for (size_t s = 0; s < shared.blocks(); ++s) {
      const size_t b = size_t(region.find(shared.coord[s]) - region.mask.data());
      visit(b, [&](int16_t& at, int i) {
        if (shared.mask[s].test(i)) at = label;
      });
    }
  }

  const MixtureState mixed = mixture_state(map_, region);
  out.refused = mixed.refused;
  for (const MixtureBlock& block : mixed.blocks) {
    const size_t b = size_t(region.find(block.coord) - region.mask.data()), m = block.voxels;
    size_t i = 0;
    visit(b, [&](int16_t& at, int offset) {
      if (!block.mask.test(offset)) return;
      size_t best = 0;
      for (size_t c = 1; c < block.a.size() / m; ++c)
        if (block.a[c * m + i] > block.a[best * m + i]) best = c;
      at = int16_t(best);
      ++i;
    });
  }
  return out;
}

}  // namespace felt
