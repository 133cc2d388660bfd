#include "mapping/label_fusion.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "mapping/class_belief.h"
#include "mapping/label_evidence.h"
#include "mapping/label_kernels.h"

namespace felt {
namespace {

/// The planes of one block by slot, made where the block has none. Working memory of one thread, reused from block to
/// block: looking a class up costs the same for any number of classes.
class BlockPlanes {
public:
  BlockPlanes(Block& block, BlockStore& store, int classes) : block_(block), store_(store), by_slot_(table()) {
    if (by_slot_.size() < size_t(classes)) by_slot_.resize(size_t(classes), nullptr);
    for (const EvidencePlane& e : block_.evidence) by_slot_[e.slot] = e.counts;
  }
  BlockPlanes(const BlockPlanes&) = delete;
  BlockPlanes& operator=(const BlockPlanes&) = delete;
  ~BlockPlanes() {
    for (const EvidencePlane& e : block_.evidence) by_slot_[e.slot] = nullptr;
  }

  Plane& of(uint16_t slot) {
    if (by_slot_[slot] == nullptr) {
      const auto at = std::lower_bound(block_.evidence.begin(), block_.evidence.end(), slot,
                                       [](const EvidencePlane& e, uint16_t s) { return e.slot < s; });
      by_slot_[slot] = block_.evidence.insert(at, {slot, store_.new_plane()})->counts;
    }
    return *by_slot_[slot];
  }
  Plane& even() {
    if (block_.even_evidence == nullptr) block_.even_evidence = store_.new_plane();
    return *block_.even_evidence;
  }
  /// Every plane, in the order of `total_evidence`.
  std::span<Plane* const> all() {
    static thread_local std::vector<Plane*> planes;
    planes.clear();
    if (block_.even_evidence != nullptr) planes.push_back(block_.even_evidence);
    for (const EvidencePlane& e : block_.evidence) planes.push_back(e.counts);
    return planes;
  }

private:
  static std::vector<Plane*>& table() {
    static thread_local std::vector<Plane*> planes;  // all null between blocks
    return planes;
  }
  Block& block_;
  BlockStore& store_;
  std::vector<Plane*>& by_slot_;
};

int first_lane(const LaneBits& lanes, int& row) {
  while (row < kBlockVoxels / 8 && lanes.row[row] == 0) ++row;
  return row == kBlockVoxels / 8 ? -1 : row * 8 + __builtin_ctz(lanes.row[row]);
}

template <typename Visit>
void for_each_lane(const LaneBits& lanes, Visit visit) {
  for (int row = 0; row < kBlockVoxels / 8; ++row)
    for (unsigned bits = lanes.row[row]; bits != 0; bits &= bits - 1) visit(row * 8 + __builtin_ctz(bits));
}

/// Class by class: neighbouring voxels mostly see one.
LabelStats fuse_hard(const BlockObservation& observation, const LabelView& view, LaneBits rest, Block& block,
                     BlockStore& store) {
  LabelStats stats;
  BlockPlanes planes(block, store, view.classes->size());
  alignas(64) int32_t ids[kBlockVoxels];
  fetch_ids(observation, rest, view.labels->data(), ids);
  int row = 0;
  for (int lane = first_lane(rest, row); lane >= 0; lane = first_lane(rest, row)) {
    LaneBits taken;
    const auto id = uint16_t(ids[lane]);
    const int count = take_equal(ids, id, rest, taken);
    const uint16_t slot = view.classes->slot_of_id(id);
    if (slot == ClassTable::kNoSlot) {
      if (id != kNoLabel && !view.classes->known(id)) stats.unknown += uint64_t(count);
      continue;
    }
    stats.voxels += uint64_t(count);
    if (view.config.max_evidence > 0) fade_evidence(taken, planes.all(), view.evidence, view.config.max_evidence);
    if (view.config.likelihood == nullptr) {
      add_evidence(taken, view.evidence, planes.of(slot));
      continue;
    }
    for (const LabelEvidence::Share& share : view.config.likelihood->shares[slot])
      add_evidence(taken, view.evidence * share.evidence, planes.of(share.slot));
    if (const float even = view.config.likelihood->even[slot]; even > 0)
      add_evidence(taken, view.evidence * even, planes.even());
  }
  return stats;
}

/// What one pixel's probabilities say, by slot and shared.
struct SoftPixel {
  std::vector<LabelEvidence::Share> named;
  float dropped = 0;  ///< mass of classes that were not kept
  bool valid = true, unknown = false;

  void read(const ProbabilityImage& image, int32_t pixel, const ClassTable& classes) {
    const uint16_t* ids = &image.class_id[size_t(pixel) * size_t(image.top)];
    const float* p = &image.probability[size_t(pixel) * size_t(image.top)];
    named.clear();
    valid = true, unknown = false;
    float sum = 0;
    for (int i = 0; i < image.top; ++i) {
      if (!(p[i] > 0)) {
        valid = valid && p[i] == 0;  // negative or not a number
        continue;
      }
      sum += p[i];
      const uint16_t slot = classes.slot_of_id(ids[i]);
      if (slot != ClassTable::kNoSlot)
        named.push_back({slot, p[i]});
      else
        unknown = unknown || (ids[i] != kNoLabel && !classes.known(ids[i]));
    }
    constexpr float kTooMuch = 1.001f;
    valid = valid && sum <= kTooMuch;
    // Rounded to 16 bits, a whole distribution may lack a little; nothing was dropped from it.
    const float rounding = float(image.top) / 65535.0f;
    dropped = sum < 1 - rounding ? 1 - sum : 0;
  }

  /// Gives the dropped mass to the classes that are not named, evenly: what all share, and less for those named.
  float spread(int k) {
    if (dropped > 0) join_repeated();
    for (;;) {
      const int others = k - int(named.size());
      if (!(dropped > 0) || others <= 0) return dropped;  // nobody is unnamed: all share it
      const float share = dropped / float(others);
      const auto least = std::min_element(named.begin(), named.end(),
                                          [](const auto& a, const auto& b) { return a.evidence < b.evidence; });
      if (least != named.end() && least->evidence < share) {  // no top class: one of the others
        dropped += least->evidence;
        named.erase(least);
        continue;
      }
      for (LabelEvidence::Share& n : named) n.evidence -= share;
      return share * float(k);
    }
  }

private:
  void join_repeated() {
    for (size_t i = 0; i < named.size(); ++i)
      for (size_t j = named.size() - 1; j > i; --j)
        if (named[j].slot == named[i].slot) {
          named[i].evidence += named[j].evidence;
          named.erase(named.begin() + std::ptrdiff_t(j));
        }
  }
};

void fade_lane(Block& block, int offset, float added, float max_evidence) {
  const float room = std::max(0.0f, max_evidence - added), total = total_evidence(block, offset);
  if (!(total > room)) return;
  const float keep = room / total;
  if (block.even_evidence != nullptr) block.even_evidence->value[offset] *= keep;
  for (EvidencePlane& e : block.evidence) e.counts->value[offset] *= keep;
}

LabelStats fuse_soft(const BlockObservation& observation, const LabelView& view, const LaneBits& band, Block& block,
                     BlockStore& store) {
  LabelStats stats;
  const int k = view.classes->size();
  BlockPlanes planes(block, store, k);
  static thread_local SoftPixel pixel;
  const LabelEvidence* likelihood = view.config.likelihood;
  for_each_lane(band, [&](int lane) {
    pixel.read(*view.probabilities, observation.pixel[lane], *view.classes);
    stats.unknown += pixel.unknown;
    stats.invalid += !pixel.valid;
    if (pixel.named.empty() || !pixel.valid) return;
    ++stats.voxels;
    float even = 0;
    if (view.config.spread_dropped && likelihood == nullptr)
      even = pixel.spread(k);
    else if (view.config.spread_dropped)
      even = pixel.dropped;
    float added = even;
    for (const LabelEvidence::Share& named : pixel.named) added += named.evidence;
    if (view.config.max_evidence > 0) fade_lane(block, lane, view.evidence * added, view.config.max_evidence);
    for (const LabelEvidence::Share& named : pixel.named) {
      const float evidence = view.evidence * named.evidence;
      if (likelihood == nullptr) {
        planes.of(named.slot).value[lane] += evidence;
        continue;
      }
      for (const LabelEvidence::Share& share : likelihood->shares[named.slot])
        planes.of(share.slot).value[lane] += evidence * share.evidence;
      even += named.evidence * likelihood->even[named.slot];
    }
    if (even > 0) planes.even().value[lane] += view.evidence * even;
  });
  return stats;
}

void fuse_instances(const BlockObservation& observation, const Image<uint16_t>& instances, const LaneBits& band,
                    Block& block, BlockStore& store) {
  for_each_lane(band, [&](int lane) {
    const uint16_t id = instances.data()[observation.pixel[lane]];
    if (id == 0 || id == kNoLabel) return;
    vote_instance(store.add_instance(block), lane, id);
  });
}

template <typename Pixels>
void require_depth_size(const Frame& frame, const char* what, const Pixels& image, int width, int height) {
  if (image.empty() || (width == frame.depth_m.width() && height == frame.depth_m.height())) return;
  const auto size = [](int w, int h) { return std::to_string(w) + " x " + std::to_string(h); };
  throw FormatError(describe_mismatch("frame " + std::to_string(frame.index), std::string(what) + " image",
                                      size(frame.depth_m.width(), frame.depth_m.height()) + " as its depth",
                                      size(width, height)));
}

}  // namespace

LabelView label_view(const Frame& frame, const ClassTable& classes, const LabelConfig& config, double voxel_size_m,
                     double novelty) {
  const ProbabilityImage& p = frame.probabilities;
  require_depth_size(frame, "label", frame.labels, frame.labels.width(), frame.labels.height());
  require_depth_size(frame, "probability", p, p.width, p.height);
  require_depth_size(frame, "instance", frame.instances, frame.instances.width(), frame.instances.height());
  if (!p.empty())
    if (const size_t n = size_t(p.width) * size_t(p.height) * size_t(std::max(0, p.top));
        p.top < 1 || p.class_id.size() != n || p.probability.size() != n)
      throw FormatError(describe_mismatch(
          "frame " + std::to_string(frame.index), "probability image", std::to_string(n) + " classes and probabilities",
          std::to_string(p.class_id.size()) + " and " + std::to_string(p.probability.size())));
  return {.classes = &classes,
          .labels = &frame.labels,
          .probabilities = &frame.probabilities,
          .instances = config.instances ? &frame.instances : nullptr,
          .config = config,
          .band_m = float(config.band_vox * voxel_size_m),
          .evidence = float(config.evidence * novelty)};
}

void vote_instance(InstancePlanes& planes, int offset, uint16_t id) {
  constexpr uint16_t kMostVotes = 255;  // an old map stays able to change
  uint16_t& votes = planes.votes[offset];
  if (votes == 0) planes.id[offset] = id;
  if (planes.id[offset] == id)
    votes = std::min<uint16_t>(uint16_t(votes + 1), kMostVotes);
  else
    --votes;
}

LabelStats fuse_labels(const BlockObservation& observation, const LabelView& view, Block& block, BlockStore& store) {
  LaneBits band;
  if (!select_band(observation, view.band_m, band)) return {};
  if (view.says_instances()) fuse_instances(observation, *view.instances, band, block, store);
  if (!view.says_classes()) return {};
  return view.probabilities != nullptr && !view.probabilities->empty()
             ? fuse_soft(observation, view, band, block, store)
             : fuse_hard(observation, view, band, block, store);
}

}  // namespace felt
