#include "mapping/maps/merge.h"

#include <algorithm>
#include <set>
#include <utility>

#include "core/error.h"
#include "core/text.h"
#include "mapping/fusion/tsdf_kernels.h"
#include "mapping/labels/class_belief.h"
#include "mapping/maps/table_difference.h"
#include "mapping/touch/touch_update.h"

namespace felt {
namespace {

std::string in_millimetres(double metres) { return number_text(metres * 1000, "%.9g") + " mm"; }

/// Class table of the result: that of every map that has one.
const ClassTable& common_classes(std::span<const Map* const> maps) {
  for (const Map* map : maps)
    if (!map->classes.empty()) return map->classes;
  return maps.front()->classes;
}

/// Property table of the result: the longest, which continues those of all maps.
const PropertyTable& common_properties(std::span<const Map* const> maps) {
  const auto shorter = [](const Map* a, const Map* b) { return a->properties.size() < b->properties.size(); };
  return (*std::max_element(maps.begin(), maps.end(), shorter))->properties;
}

void require_mergeable(std::span<const Map* const> maps, const MergeOptions& options) {
  std::vector<std::string> problems;
  const ClassTable& classes = common_classes(maps);
  const PropertyTable& properties = common_properties(maps);
  for (size_t i = 0; i < maps.size(); ++i) {
    const std::string where = "map " + std::to_string(i + 1);
    if (maps[i]->voxel_size_m != maps[0]->voxel_size_m)
      problems.push_back(describe_mismatch(where, "voxel size", in_millimetres(maps[0]->voxel_size_m),
                                           in_millimetres(maps[i]->voxel_size_m)));
    if (maps[i]->truncation_m != maps[0]->truncation_m)
      problems.push_back(describe_mismatch(where, "truncation", in_millimetres(maps[0]->truncation_m),
                                           in_millimetres(maps[i]->truncation_m)));
    if (!maps[i]->classes.empty() && !(maps[i]->classes == classes))
      problems.push_back(describe_mismatch(where, "class table", "the same in all maps",
                                           "another: " + first_difference(classes, maps[i]->classes)));
    if (!continues(properties, maps[i]->properties))
      problems.push_back(describe_mismatch(where, "property table",
                                           "the same in all maps, or the beginning of a longer one",
                                           "another: " + first_difference(properties, maps[i]->properties)));
    for (size_t j = 0; j < i && !options.allow_shared_frames; ++j)
      if (const auto shared = shared_frames(maps[j]->frames, maps[i]->frames); !shared.empty())
        problems.push_back(describe_mismatch(where, "frames", "none of those of map " + std::to_string(j + 1),
                                             std::to_string(shared.size()) + " shared, the first is " +
                                                 std::to_string(shared.front().second) + " of sequence " +
                                                 shared.front().first));
  }
  if (!problems.empty()) throw ConfigError(problems);
}

/// The maps in an order that follows from their content.
std::vector<const Map*> canonical_order(std::span<const Map* const> maps) {
  std::vector<std::pair<std::string, const Map*>> keyed;
  for (const Map* map : maps) keyed.emplace_back(map_hash(*map), map);
  std::stable_sort(keyed.begin(), keyed.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<const Map*> ordered;
  for (const auto& [hash, map] : keyed) ordered.push_back(map);
  return ordered;
}

void merge_geometry(std::span<const Block* const> from, float max_weight, GeometryPlanes& to) {
  for (int i = 0; i < kBlockVoxels; ++i) {
    double weight = 0, sum = 0;
    int observed = 0;
    const Block* last = nullptr;
    for (const Block* block : from)
      if (const double w = block->geometry->weight[i]; w > 0) {
        weight += w;
        sum += w * block->geometry->tsdf[i];
        ++observed;
        last = block;
      }
    if (observed == 0) continue;
    // One observer: its value, not its value after a multiplication and a division.
    to.tsdf[i] = observed == 1 ? last->geometry->tsdf[i] : float(sum / weight);
    to.weight[i] = std::min(float(weight), max_weight);
  }
}

void merge_color(std::span<const Block* const> from, ColorPlanes& to) {
  for (int i = 0; i < kBlockVoxels; ++i) {
    uint64_t count = 0, r = 0, g = 0, b = 0;
    for (const Block* block : from)
      if (const ColorPlanes* color = block->color; color != nullptr) {
        const uint64_t n = color->count[i];
        count += n;
        r += n * color->r[i];
        g += n * color->g[i];
        b += n * color->b[i];
      }
    if (count == 0) continue;
    const auto average = [&](uint64_t sum) { return uint16_t((sum + count / 2) / count); };
    to.r[i] = average(r);
    to.g[i] = average(g);
    to.b[i] = average(b);
    to.count[i] = uint16_t(std::min<uint64_t>(count, kMaxColorCount));
  }
}

void merge_evidence(std::span<const Block* const> from, BlockStore& store, Block& to) {
  std::set<uint16_t> slots;
  for (const Block* block : from)
    for (const EvidencePlane& plane : block->evidence) slots.insert(plane.slot);
  for (const uint16_t slot : slots) {
    double sum[kBlockVoxels] = {};
    for (const Block* block : from)
      if (const Plane* counts = evidence_counts(*block, slot))
        for (int i = 0; i < kBlockVoxels; ++i) sum[i] += counts->value[i];
    Plane* plane = store.new_plane();
    for (int i = 0; i < kBlockVoxels; ++i) plane->value[i] = float(sum[i]);
    to.evidence.push_back({slot, plane});
  }
}

void merge_even_evidence(std::span<const Block* const> from, BlockStore& store, Block& to) {
  double sum[kBlockVoxels] = {};
  bool any = false;
  for (const Block* block : from) {
    if (block->even_evidence == nullptr) continue;
    any = true;
    for (int i = 0; i < kBlockVoxels; ++i) sum[i] += block->even_evidence->value[i];
  }
  if (!any) return;
  to.even_evidence = store.new_plane();
  for (int i = 0; i < kBlockVoxels; ++i) to.even_evidence->value[i] = float(sum[i]);
}

/// Brings the evidence of voxels that have more than the cap down to it, all classes alike. A voxel that was capped
/// before may be beyond it by what that rounded, and keeps its values: a map merged with nothing stays the same.
void cap_evidence(Block& block, float max_evidence) {
  constexpr double kRounding = 1e-5;
  float share[kBlockVoxels];
  for (int i = 0; i < kBlockVoxels; ++i) {
    double total = block.even_evidence == nullptr ? 0 : double(block.even_evidence->value[i]);
    for (const EvidencePlane& plane : block.evidence) total += double(plane.counts->value[i]);
    share[i] = total > double(max_evidence) * (1 + kRounding) ? float(double(max_evidence) / total) : 1.0f;
  }
  const auto scale = [&](Plane& plane) {
    for (int i = 0; i < kBlockVoxels; ++i) plane.value[i] *= share[i];
  };
  for (const EvidencePlane& plane : block.evidence) scale(*plane.counts);
  if (block.even_evidence != nullptr) scale(*block.even_evidence);
}

/// The id with the most votes over all maps, and its lead over the other ids together; the smaller id of equals.
void merge_instances(std::span<const Block* const> from, InstancePlanes& to) {
  for (int i = 0; i < kBlockVoxels; ++i) {
    std::map<uint16_t, int> votes;
    int all = 0;
    for (const Block* block : from)
      if (block->instance != nullptr && block->instance->id[i] != 0)
        votes[block->instance->id[i]] += block->instance->votes[i], all += block->instance->votes[i];
    if (votes.empty()) continue;
    const auto most =
        std::max_element(votes.begin(), votes.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
    to.id[i] = most->first;
    to.votes[i] = uint16_t(std::clamp(2 * most->second - all, 0, 0xffff));
  }
}

/// Texts that all maps agree on keep their key; of others every distinct text is kept, numbered in ascending order.
std::map<std::string, std::string> joined_texts(std::span<const Map* const> maps) {
  std::map<std::string, std::set<std::string>> texts;
  for (const Map* map : maps)
    for (const auto& [key, text] : map->metadata) texts[without_number(key)].insert(text);
  std::map<std::string, std::string> result;
  for (const auto& [key, distinct] : texts) {
    int number = 0;
    for (const std::string& text : distinct)
      result[distinct.size() == 1 ? key : key + " " + std::to_string(++number)] = text;
  }
  return result;
}

}  // namespace

std::string without_number(const std::string& key) {
  const size_t space = key.find_last_of(' ');
  const bool numbered = space != std::string::npos && space + 1 < key.size() &&
                        key.find_first_not_of("0123456789", space + 1) == std::string::npos;
  return numbered ? key.substr(0, space) : key;
}

Map merge(std::span<const Map* const> maps, const MergeOptions& options) {
  if (maps.empty()) throw ConfigError("merge: expected at least one map, found none");
  require_mergeable(maps, options);
  Map result(maps[0]->voxel_size_m, maps[0]->truncation_m);
  result.classes = common_classes(maps);
  result.properties = common_properties(maps);
  result.metadata = joined_texts(maps);
  const std::vector<const Map*> ordered = canonical_order(maps);
  std::map<BlockCoord, std::vector<const Block*>> blocks;
  for (const Map* map : ordered) {
    result.frames = joined(result.frames, map->frames);
    result.touches = joined(result.touches, map->touches);
    for (const Block& block : map->store.blocks())
      if (block.geometry->observed()) blocks[block.coord].push_back(&block);
  }
  for (const auto& [coord, from] : blocks) {
    Block& to = result.store[result.store.find_or_create(coord)];
    merge_geometry(from, options.max_weight, *to.geometry);
    if (std::any_of(from.begin(), from.end(), [](const Block* b) { return b->color != nullptr; }))
      merge_color(from, result.store.add_color(to));
    merge_evidence(from, result.store, to);
    merge_even_evidence(from, result.store, to);
    if (options.max_evidence > 0) cap_evidence(to, options.max_evidence);
    if (std::any_of(from.begin(), from.end(), [](const Block* b) { return b->instance != nullptr; }))
      merge_instances(from, result.store.add_instance(to));
  }
  rebuild_touch_planes(result);
  return result;
}

}  // namespace felt
