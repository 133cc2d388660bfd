#include "mapping/fusion/label_fusion.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/simd.h"
#include "core/text.h"
#include "mapping/fusion/label_evidence.h"
#include "mapping/fusion/label_kernels.h"
#include "mapping/labels/class_belief.h"

namespace felt {
namespace {

/// The planes of one block by slot, made where the block has none. Working memory of one thread, reused from block to
/// block: looking a class up costs the same for any number of classes.
class BlockPlanes {
public:
  BlockPlanes(Block& block, BlockStore& store, int classes)
      : block_(block), store_(store), classes_(classes), by_slot_(table(classes)) {
    for (const EvidencePlane& e : block_.evidence) by_slot_[e.slot] = e.counts;
    static thread_local Plane unused;
    by_slot_[classes_] = &unused;
  }
  BlockPlanes(const BlockPlanes&) = delete;
  BlockPlanes& operator=(const BlockPlanes&) = delete;
  ~BlockPlanes() {
    for (const EvidencePlane& e : block_.evidence) by_slot_[e.slot] = nullptr;
    by_slot_[classes_] = nullptr;
  }

  /// Of a class, or of `nobody`.
  Plane& of(int slot) {
    Plane*& plane = by_slot_[slot];
    if (plane == nullptr) [[unlikely]]
      plane = create(uint16_t(slot));
    return *plane;
  }
  /// A slot whose plane is nobody's: what is added there is lost, without a branch.
  int nobody() const { return classes_; }
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
  Plane* create(uint16_t slot) {
    const auto at = std::lower_bound(block_.evidence.begin(), block_.evidence.end(), slot,
                                     [](const EvidencePlane& e, uint16_t s) { return e.slot < s; });
    return block_.evidence.insert(at, {slot, store_.new_plane()})->counts;
  }
  static Plane** table(int classes) {
    static thread_local std::vector<Plane*> planes;  // all null between blocks
    if (planes.size() <= size_t(classes)) planes.resize(size_t(classes) + 1, nullptr);
    return planes.data();
  }
  Block& block_;
  BlockStore& store_;
  int classes_;
  Plane** by_slot_;
};

LabelStats fuse_hard(const BandVoxels& band, const LabelView& view, Block& block, BlockStore& store) {
  LabelStats stats;
  const ClassTable& classes = *view.classes;
  BlockPlanes planes(block, store, classes.size());
  const uint16_t* ids = view.labels->data();
  LaneBits taken = band.bits;
  alignas(64) int32_t slots[kBlockVoxels];
  int nothing = 0;
  for (int i = 0; i < band.count; ++i) {
    const uint16_t id = ids[uint32_t(band.pixel[i])], slot = classes.slot_of_id(id);
    slots[i] = slot;
    if (slot != ClassTable::kNoSlot) continue;
    slots[i] = planes.nobody();
    taken.clear(band.lane[i]);
    ++nothing;
    stats.unknown += id != kNoLabel && !classes.known(id);
  }
  stats.voxels = uint64_t(band.count - nothing);
  if (view.config.max_evidence > 0) {
    alignas(64) float added[kBlockVoxels];
    std::fill_n(added, kBlockVoxels, view.evidence);
    fade_evidence(taken, planes.all(), added, view.config.max_evidence);
  }
  if (view.config.likelihood == nullptr) {
    for (int i = 0; i < band.count; ++i) planes.of(slots[i]).value[band.lane[i]] += view.evidence;
    return stats;
  }
  for (int i = 0; i < band.count; ++i) {
    if (slots[i] == planes.nobody()) continue;
    const auto slot = size_t(slots[i]);
    for (const LabelEvidence::Share& share : view.config.likelihood->shares[slot])
      planes.of(share.slot).value[band.lane[i]] += view.evidence * share.evidence;
    if (const float even = view.config.likelihood->even[slot]; even > 0)
      planes.even().value[band.lane[i]] += view.evidence * even;
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
    valid = valid && sum <= kMostProbability;
    dropped = sum < 1 - rounded_mass(image.top) ? 1 - sum : 0;
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

/// One voxel, by the rule in plain words.
void fuse_soft_voxel(int lane, int32_t at, const LabelView& view, BlockPlanes& planes, Block& block,
                     LabelStats& stats) {
  static thread_local SoftPixel pixel;
  const LabelEvidence* likelihood = view.config.likelihood;
  pixel.read(*view.probabilities, at, *view.classes);
  stats.unknown += pixel.unknown;
  stats.invalid += !pixel.valid;
  if (pixel.named.empty() || !pixel.valid) return;
  ++stats.voxels;
  float even = 0;
  if (view.config.spread_dropped && likelihood == nullptr)
    even = pixel.spread(view.classes->size());
  else if (view.config.spread_dropped)
    even = pixel.dropped;
  float added = even;
  for (const LabelEvidence::Share& named : pixel.named) added += named.evidence;
  if (view.config.max_evidence > 0) fade_lane(block, lane, view.evidence * added, view.config.max_evidence);
  for (const LabelEvidence::Share& named : pixel.named) {
    if (likelihood == nullptr) {
      planes.of(named.slot).value[lane] += view.evidence * named.evidence;
      continue;
    }
    const float evidence = view.evidence * named.evidence;
    for (const LabelEvidence::Share& share : likelihood->shares[named.slot])
      planes.of(share.slot).value[lane] += evidence * share.evidence;
    even += named.evidence * likelihood->even[named.slot];
  }
  if (even > 0) planes.even().value[lane] += view.evidence * even;
}

/// Reads the probabilities of the listed pixels. Returns how many name a class that the table does not know.
uint64_t read_probabilities(const BandVoxels& band, const ProbabilityImage& image, const ClassTable& classes,
                            int nobody, std::vector<SoftRank>& ranks) {
  const auto top = size_t(image.top);
  uint8_t unknown[kBlockVoxels];
  uint64_t any_unknown = 0;
  ranks.resize(top);
  for (size_t r = 0; r < top; ++r)
    for (int i = 0; i < band.count; ++i) {
      const size_t at = size_t(uint32_t(band.pixel[i])) * top + r;
      const uint16_t id = image.class_id[at], slot = classes.slot_of_id(id);
      ranks[r].amount[i] = image.probability[at];
      ranks[r].slot[i] = slot;
      if (slot != ClassTable::kNoSlot) continue;
      ranks[r].slot[i] = nobody;
      if (!(image.probability[at] > 0) || id == kNoLabel || classes.known(id)) continue;
      if (any_unknown++ == 0) std::fill_n(unknown, band.count, uint8_t(0));
      unknown[i] = 1;
    }
  return any_unknown == 0 ? 0 : uint64_t(std::count(unknown, unknown + band.count, uint8_t(1)));
}

LabelStats fuse_soft(const BandVoxels& band, const LabelView& view, Block& block, BlockStore& store) {
  LabelStats stats;
  BlockPlanes planes(block, store, view.classes->size());
  if (view.config.likelihood != nullptr || simd_scalar_forced()) {
    for (int i = 0; i < band.count; ++i) fuse_soft_voxel(band.lane[i], band.pixel[i], view, planes, block, stats);
    return stats;
  }
  static thread_local SoftPixels pixels;
  pixels.count = band.count, pixels.classes = planes.nobody();
  pixels.evidence = view.evidence, pixels.spread = view.config.spread_dropped;
  stats.unknown = read_probabilities(band, *view.probabilities, *view.classes, planes.nobody(), pixels.ranks);
  weigh_probabilities(pixels);
  stats.voxels = uint64_t(pixels.taken), stats.invalid = uint64_t(pixels.invalid);
  if (view.config.max_evidence > 0) {
    alignas(64) float added[kBlockVoxels];
    LaneBits taken = band.bits;
    for (int i = 0; i < band.count; ++i) {
      added[band.lane[i]] = pixels.added[i];
      if (pixels.verdict[i] != SoftPixels::kAdds) taken.clear(band.lane[i]);
    }
    fade_evidence(taken, planes.all(), added, view.config.max_evidence);
  }
  bool any_even = false;
  for (const SoftRank& rank : pixels.ranks)
    for (int i = 0; i < band.count; ++i) planes.of(rank.slot[i]).value[band.lane[i]] += rank.amount[i];
  for (int i = 0; i < band.count; ++i) any_even = any_even || pixels.even[i] > 0;
  if (any_even) {
    float* even = planes.even().value;
    for (int i = 0; i < band.count; ++i) even[band.lane[i]] += pixels.even[i];
  }
  if (pixels.any_left) {
    LabelStats left;
    for (int i = 0; i < band.count; ++i)
      if (pixels.verdict[i] == SoftPixels::kLeft)
        fuse_soft_voxel(band.lane[i], band.pixel[i], view, planes, block, left);
    stats.voxels += left.voxels;
  }
  return stats;
}

/// One vote for `id` (not 0): Boyer and Moore's majority vote.
void vote_instance(InstancePlanes& planes, int offset, uint16_t id) {
  constexpr uint16_t kMostVotes = 255;  // an old map stays able to change
  uint16_t& votes = planes.votes[offset];
  if (votes == 0) planes.id[offset] = id;
  if (planes.id[offset] == id)
    votes = std::min<uint16_t>(uint16_t(votes + 1), kMostVotes);
  else
    --votes;
}

void fuse_instances(const BandVoxels& band, const Image<uint16_t>& instances, Block& block, BlockStore& store) {
  for (int i = 0; i < band.count; ++i) {
    const uint16_t id = instances.data()[uint32_t(band.pixel[i])];
    if (id != 0 && id != kNoLabel) vote_instance(store.add_instance(block), band.lane[i], id);
  }
}

[[gnu::always_inline]] inline void prefetch(const Plane& plane, uint32_t groups) {
  for (; groups != 0; groups &= groups - 1)  // a group of floats is a cache line
    __builtin_prefetch(plane.value + __builtin_ctz(groups) * kGroupVoxels, 1, 3);
}

/// Lines of planes and images that `band` will need travel meanwhile. Always inline: GCC drops calls of a function that
/// does nothing but prefetch.
[[gnu::always_inline]] inline void prefetch(const BandVoxels& band, const LabelView& view, const Block& block) {
  constexpr size_t kMostPlanes = 4;
  if (block.even_evidence != nullptr) prefetch(*block.even_evidence, band.groups);
  for (size_t i = 0; i < std::min(kMostPlanes, block.evidence.size()); ++i)
    prefetch(*block.evidence[i].counts, band.groups);
  if (view.probabilities != nullptr && !view.probabilities->empty()) {
    const auto top = size_t(view.probabilities->top);
    for (int i = 0; i < band.count; ++i) {
      const size_t at = size_t(uint32_t(band.pixel[i])) * top;
      __builtin_prefetch(view.probabilities->class_id.data() + at, 0, 3);
      __builtin_prefetch(view.probabilities->probability.data() + at, 0, 3);
    }
  } else if (view.says_classes()) {
    for (int i = 0; i < band.count; ++i) __builtin_prefetch(view.labels->data() + uint32_t(band.pixel[i]), 0, 3);
  }
}

template <typename Pixels>
void require_depth_size(const Frame& frame, const char* what, const Pixels& image, int width, int height) {
  if (image.empty() || (width == frame.depth_m.width() && height == frame.depth_m.height())) return;
  throw FormatError(describe_mismatch("frame " + std::to_string(frame.index), std::string(what) + " image",
                                      size_text(frame.depth_m.width(), frame.depth_m.height()) + " as its depth",
                                      size_text(width, height)));
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

void LabelFusion::add(const BlockObservation& observation, Block& block) {
  BandVoxels& band = bands_[current_];
  select_band(observation, view_.band_m, band);
  if (band.count == 0) return;
  prefetch(band, view_, block);
  current_ = 1 - current_;
  fuse_waiting();
  waiting_ = &block;
}

LabelStats LabelFusion::finish() {
  current_ = 1 - current_;
  fuse_waiting();
  current_ = 1 - current_;
  return stats_;
}

void LabelFusion::fuse_waiting() {
  if (waiting_ == nullptr) return;
  const BandVoxels& band = bands_[current_];
  Block& block = *waiting_;
  waiting_ = nullptr;
  if (view_.says_instances()) fuse_instances(band, *view_.instances, block, store_);
  if (!view_.says_classes()) return;
  stats_ += view_.probabilities != nullptr && !view_.probabilities->empty() ? fuse_soft(band, view_, block, store_)
                                                                            : fuse_hard(band, view_, block, store_);
}

}  // namespace felt
