#include "mapping/label_fusion.h"

#include <algorithm>
#include <cmath>

namespace felt {
namespace {

/// The plane of a class, made and put in its place where the block has none.
Plane& plane_of(uint16_t slot, Block& block, BlockStore& store) {
  const auto at = std::lower_bound(block.evidence.begin(), block.evidence.end(), slot,
                                   [](const EvidencePlane& e, uint16_t s) { return e.slot < s; });
  if (at != block.evidence.end() && at->slot == slot) return *at->counts;
  return *block.evidence.insert(at, {slot, store.new_plane()})->counts;
}

/// Makes room for `added` below the cap.
void forget(Block& block, int offset, float added, float max_evidence) {
  const float total = total_evidence(block, offset);
  if (!(total + added > max_evidence)) return;
  const float keep = std::max(0.0f, max_evidence - added) / total;
  for (EvidencePlane& e : block.evidence) e.counts->value[offset] *= keep;
}

/// Evidence of a pixel's kept probabilities; returns whether there was any.
bool add_probabilities(const ProbabilityImage& image, int32_t pixel, int offset, const LabelView& view, Block& block,
                       BlockStore& store) {
  const uint16_t* ids = &image.class_id[size_t(pixel) * image.top];
  const float* p = &image.probability[size_t(pixel) * image.top];
  const int k = view.classes->size();
  float named = 0;
  int named_classes = 0;
  for (int i = 0; i < image.top; ++i) {
    if (view.classes->slot_of_id(ids[i]) == ClassTable::kNoSlot || !(p[i] > 0)) continue;
    named += p[i];
    ++named_classes;
  }
  if (named_classes == 0) return false;
  const float dropped = std::max(0.0f, 1.0f - named);
  const bool spread = view.config.spread_dropped && dropped > 0 && named_classes < k;
  const float added = view.config.evidence * (spread ? named + dropped : named);
  if (view.config.max_evidence > 0) forget(block, offset, added, view.config.max_evidence);
  for (int i = 0; i < image.top; ++i) {
    const uint16_t slot = view.classes->slot_of_id(ids[i]);
    if (slot != ClassTable::kNoSlot && p[i] > 0)
      plane_of(slot, block, store).value[offset] += view.config.evidence * p[i];
  }
  if (!spread) return true;
  const float share = view.config.evidence * dropped / float(k - named_classes);
  for (int slot = 0; slot < k; ++slot) {
    bool is_named = false;
    for (int i = 0; i < image.top; ++i) is_named = is_named || (p[i] > 0 && view.classes->slot_of_id(ids[i]) == slot);
    if (!is_named) plane_of(uint16_t(slot), block, store).value[offset] += share;
  }
  return true;
}

}  // namespace

float total_evidence(const Block& block, int offset) {
  float total = 0;
  for (const EvidencePlane& e : block.evidence) total += e.counts->value[offset];
  return total;
}

LabelStats fuse_labels(const BlockObservation& observation, const LabelView& view, Block& block, BlockStore& store) {
  LabelStats stats;
  // Neighbouring voxels mostly see one class: remember the last plane instead of searching for it.
  uint32_t last_id = 0x10000;
  Plane* last_plane = nullptr;
  const bool soft = view.probabilities != nullptr && !view.probabilities->empty();
  for (int row = 0; row < kBlockVoxels / 8; ++row) {
    for (unsigned bits = observation.valid[row]; bits != 0; bits &= bits - 1) {
      const int offset = row * 8 + __builtin_ctz(bits);
      if (!(std::fabs(observation.sdf_m[offset]) < view.band_m)) continue;
      const int32_t pixel = observation.pixel[offset];
      if (soft) {
        stats.voxels += add_probabilities(*view.probabilities, pixel, offset, view, block, store);
        continue;
      }
      const uint16_t id = view.labels->data()[pixel];
      if (id != last_id) {
        last_id = id;
        const uint16_t slot = view.classes->slot_of_id(id);
        last_plane = slot == ClassTable::kNoSlot ? nullptr : &plane_of(slot, block, store);
      }
      if (last_plane == nullptr) {
        stats.unknown += id != kNoLabel && !view.classes->known(id);
        continue;
      }
      if (view.config.max_evidence > 0) forget(block, offset, view.config.evidence, view.config.max_evidence);
      last_plane->value[offset] += view.config.evidence;
      ++stats.voxels;
    }
  }
  return stats;
}

}  // namespace felt
