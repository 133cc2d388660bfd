#include "mapping/touch/touch_update.h"

#include <tbb/parallel_for.h>
#include <limits>
#include <string>
#include <utility>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/text.h"
#include "mapping/touch/touch_view.h"

namespace felt {
namespace {

/// Statistics of one property over the touches of one block, voxel by voxel in canonical order (Welford). `planes` hold
/// zeros.
void accumulate(const Map& map, uint16_t property, const BlockCoord& coord, const TouchPlanes& planes) {
  bool first = true;
  for (const Touch& touch : map.touches.touches) {
    if (touch.undone || touch.request.property != map.properties[property].name) continue;
    const BlockMask* mask = touch.region.find(coord);
    if (mask == nullptr) continue;
    const double psi = touch.request.value;
    if (first) {
      for_each_bit(*mask, [&](int i) {
        planes.n->value[i] = 1;
        planes.mean->value[i] = float(psi);
      });
      first = false;
      continue;
    }
    for_each_bit(*mask, [&](int i) {
      float &n = planes.n->value[i], &mean = planes.mean->value[i], &m2 = planes.m2->value[i];
      const double step = n > 0 ? psi - double(mean) : psi;
      n += 1;
      mean = float(n > 1 ? double(mean) + step / double(n) : psi);
      if (n > 1) m2 = float(double(m2) + step * (psi - double(mean)));
    });
  }
}

void update_block(Map& map, Block& block) {
  std::vector<bool> touched(size_t(map.properties.size()), false);
  for (const Touch& touch : map.touches.touches)
    if (!touch.undone && touch.region.find(block.coord) != nullptr)
      touched[size_t(*map.properties.index_of(touch.request.property))] = true;
  // Planes whose last touch is undone stay, with zeros: a redo finds them, and undoing again and again takes no memory.
  for (const TouchPlanes& planes : block.touch)
    for (Plane* plane : {planes.n, planes.mean, planes.m2}) std::memset(plane, 0, sizeof(Plane));
  for (size_t p = 0; p < touched.size(); ++p) {
    if (!touched[p]) continue;
    auto at = std::lower_bound(block.touch.begin(), block.touch.end(), p,
                               [](const TouchPlanes& planes, size_t property) { return planes.property < property; });
    if (at == block.touch.end() || at->property != p)
      at = block.touch.insert(at, {uint16_t(p), map.store.new_plane(), map.store.new_plane(), map.store.new_plane()});
    accumulate(map, uint16_t(p), block.coord, *at);
  }
}

void update_blocks(Map& map, const Region& region) {
  tbb::parallel_for(size_t(0), region.blocks(), [&](size_t b) {
    if (const uint32_t n = map.store.find(region.coord[b]); n != BlockStore::kNone) update_block(map, map.store[n]);
  });
}

Touch& touch_of(Map& map, uint64_t id) {
  Touch* touch = map.touches.find(id);
  if (touch == nullptr)
    throw TouchError(describe_mismatch("touch " + id_text(id), "journal",
                                       "one of " + std::to_string(map.touches.touches.size()) + " recorded touches",
                                       "no such id"));
  return *touch;
}

void set_undone(Map& map, uint64_t id, bool undone) {
  Touch& touch = touch_of(map, id);
  if (touch.undone == undone)
    throw TouchError(describe_mismatch("touch " + id_text(id), "state", undone ? "one that counts" : "an undone touch",
                                       undone ? "it undone already" : "one that counts already"));
  touch.undone = undone;
  update_blocks(map, touch.region);
}

BeliefSummary summary_of(const Belief& belief, size_t property) {
  BeliefSummary out;
  out.class_probability = belief.class_probability;
  out.class_entropy = class_entropy(belief.class_probability);
  const double none = std::numeric_limits<double>::quiet_NaN();
  const StudentTMixture& next = belief.next_reading[property];
  out.mean = next.weight.empty() ? none : mean(next).value_or(none);
  out.sd = next.weight.empty() ? none : std::sqrt(variance(next).value_or(none));
  return out;
}

}  // namespace

void check_reading(const PropertyTable& properties, const ClassTable& classes, const TouchRequest& request) {
  const std::string where = "touch of '" + request.property + "'";
  const auto property = properties.index_of(request.property);
  if (!property) {
    const std::string known = listed(properties.properties(), &Property::name);
    throw TouchError(describe_mismatch("touch", "property", known.empty() ? "a map with properties" : known,
                                       "'" + request.property + "'"));
  }
  const Property& p = properties[*property];
  if (!std::isfinite(request.value) || request.value < p.support_lo || request.value > p.support_hi)
    throw TouchError(describe_mismatch(
        where, "value", "a number in [" + number_text(p.support_lo) + ", " + number_text(p.support_hi) + "]",
        number_text(request.value)));
  // Squares of what is kept must fit a float.
  constexpr double kLargest = 1e15;
  if (std::abs(request.value) > kLargest)
    throw TouchError(describe_mismatch(where, "value", "a number of size up to 1e15", number_text(request.value)));
  if (!(request.sigma >= 0 && request.sigma <= kLargest))
    throw TouchError(describe_mismatch(where, "sigma", "a number from 0 to 1e15", number_text(request.sigma)));
  if (!std::isfinite(request.stamp_s))
    throw TouchError(describe_mismatch(where, "stamp", "a finite time", number_text(request.stamp_s)));
  if (!std::isnan(request.rho) && !(request.rho >= 0 && request.rho < 1))
    throw TouchError(describe_mismatch(where, "rho", "0 <= rho < 1", number_text(request.rho)));
  if (!class_priors(p, classes).any())
    throw TouchError(describe_mismatch(where, "priors", "one of the map's classes with a prior", "none"));
  validate(request.region);
}

Touch resolve_touch(const Map& map, const TouchRequest& request, const ViewMask* view) {
  const std::string where = "touch of '" + request.property + "'";
  check_reading(map.properties, map.classes, request);
  if (request.region.rule == RegionRule::mask && view == nullptr)
    throw TouchError(describe_mismatch(where, "region", "a mask image with its camera", "none"));
  const Contact contact = find_contact(map, request.point_m, request.region);
  Touch touch;
  touch.request = request;
  if (request.region.rule == RegionRule::mask) touch.request.view = digest(*view);
  touch.voxel = contact.voxel;
  touch.surface_m = contact.surface_m;
  touch.region = request.region.rule == RegionRule::mask ? find_region(map, *view, request.region, &contact)
                                                         : find_region(map, contact, request.region);
  return touch;
}

uint64_t add_touch(Map& map, Touch touch) {
  const uint64_t id = insert(map.touches, std::move(touch));
  update_blocks(map, map.touches.find(id)->region);
  return id;
}

TouchEffect TouchBatch::apply(Touch touch) {
  const double psi = touch.request.value, noise_sd = touch.request.sigma;
  const size_t property = size_t(*map_.properties.index_of(touch.request.property));
  TouchEffect effect;
  effect.before = Beliefs(map_).of(touch.region, covering_touches(map_, touch.region));
  if (!labels_) labels_.emplace(map_);
  const TouchedLabels::Answer before = labels_->of(touch.region);
  const StudentTMixture& expected = effect.before.next_reading[property];
  if (!expected.weight.empty()) {
    effect.flags = region_flags(expected, psi, noise_sd);
    effect.tail_probability = tail_probability(expected, psi, noise_sd);
  }
  effect.id = insert(map_.touches, std::move(touch));
  Touch& recorded = *map_.touches.find(effect.id);
  try {
    const auto own = uint32_t(&recorded - map_.touches.touches.data());
    effect.after = Beliefs(map_).of(recorded.region, covering_touches(map_, recorded.region));
    labels_->insert(own);
    const TouchedLabels::Answer after = labels_->of(recorded.region);
    for (size_t i = 0; i < after.label.size(); ++i) effect.relabelled += before.label[i] != after.label[i];
    effect.refused = after.refused[own];
  } catch (...) {
    std::erase_if(map_.touches.touches, [&](const Touch& t) { return t.id == effect.id; });
    labels_.reset();
    throw;
  }
  effect.modes = modes(effect.after.next_reading[property]);
  recorded.before = summary_of(effect.before, property);
  recorded.after = summary_of(effect.after, property);
  recorded.refused_voxels = effect.refused;
  touched_ = united(touched_, recorded.region);
  return effect;
}

void TouchBatch::finish() {
  update_blocks(map_, touched_);
  touched_ = {};
}

TouchEffect apply_touch(Map& map, Touch touch) {
  TouchBatch batch(map);
  TouchEffect effect = batch.apply(std::move(touch));
  batch.finish();
  return effect;
}

void undo_touch(Map& map, uint64_t id) { set_undone(map, id, true); }

void redo_touch(Map& map, uint64_t id) { set_undone(map, id, false); }

void rebuild_touch_planes(Map& map) {
  tbb::parallel_for(size_t(0), map.store.size(), [&](size_t n) { update_block(map, map.store[uint32_t(n)]); });
}

size_t touch_plane_bytes(const Map& map) {
  size_t planes = 0;
  for (const Block& block : map.store.blocks()) planes += 3 * block.touch.size();
  return planes * sizeof(Plane);
}

size_t journal_bytes(const TouchJournal& journal) {
  size_t bytes = journal.touches.size() * sizeof(Touch);
  for (const Touch& touch : journal.touches) bytes += touch.region.blocks() * (sizeof(BlockCoord) + sizeof(BlockMask));
  return bytes;
}

}  // namespace felt
