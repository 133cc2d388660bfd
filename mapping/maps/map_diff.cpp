#include "mapping/maps/map_diff.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "core/text.h"
#include "mapping/labels/class_belief.h"
#include "mapping/maps/table_difference.h"
#include "mapping/touch/touch_view.h"

namespace felt {
namespace {

/// Sums of one channel while blocks are compared.
struct Accumulator {
  ChannelDifference result;
  double sum = 0;

  Accumulator(std::string name, std::string unit) { result.name = std::move(name), result.unit = std::move(unit); }

  void add(bool in_a, bool in_b, double a, double b) {
    if (!in_a && !in_b) return;
    if (in_a != in_b) {
      ++(in_a ? result.voxels_only_a : result.voxels_only_b);
      return;
    }
    ++result.voxels_both;
    if (a == b || (std::isnan(a) && std::isnan(b))) return;
    ++result.voxels_changed;
    const double d = std::isfinite(a - b) ? std::fabs(a - b) : std::numeric_limits<double>::infinity();
    result.max_difference = std::max(result.max_difference, d);
    sum += d;
  }

  ChannelDifference finish() {
    if (result.voxels_both > 0) result.mean_difference = sum / double(result.voxels_both);
    return result;
  }
};

const Plane* evidence_of(const Block* block, std::optional<int> slot) {
  return block != nullptr && slot ? evidence_counts(*block, *slot) : nullptr;
}

const Block* observed_block(const Map& map, const BlockCoord& coord) {
  const Block* block = map.store.get(coord);
  return block != nullptr && block->geometry->observed() ? block : nullptr;
}

std::set<BlockCoord> observed_coordinates(const Map& a, const Map& b) {
  std::set<BlockCoord> coordinates;
  for (const Map* map : {&a, &b})
    for (const Block& block : map->store.blocks())
      if (block.geometry->observed()) coordinates.insert(block.coord);
  return coordinates;
}

std::vector<std::string> different_settings(const Map& a, const Map& b) {
  std::vector<std::string> lines;
  const auto compare = [&](const char* what, double x, double y) {
    if (x != y) lines.push_back(std::string(what) + ": " + number_text(x, "%.15g") + " and " + number_text(y, "%.15g"));
  };
  compare("voxel_size_m", a.voxel_size_m, b.voxel_size_m);
  compare("truncation_m", a.truncation_m, b.truncation_m);
  if (!(a.classes == b.classes))
    lines.push_back("class tables: " + std::to_string(a.classes.size()) + " and " + std::to_string(b.classes.size()) +
                    " classes; " + first_difference(a.classes, b.classes));
  if (!(a.properties == b.properties))
    lines.push_back("property tables: " + std::to_string(a.properties.size()) + " and " +
                    std::to_string(b.properties.size()) + " properties; " +
                    first_difference(a.properties, b.properties));
  return lines;
}

struct Channels {
  Accumulator tsdf{"tsdf", "m"}, weight{"weight", ""}, color{"color", "grey levels"},
      color_count{"color_count", "observations"}, even_evidence{"evidence_even", "counts"},
      instance{"instance", "ids that differ"}, instance_votes{"instance_votes", "votes"};
  struct Evidence {
    std::optional<int> slot_a, slot_b;
    Accumulator sums;
  };
  std::vector<Evidence> evidence;
  struct Touched {
    std::optional<int> property_a, property_b;
    Accumulator n, mean, m2;
  };
  std::vector<Touched> touched;
};

Channels make_channels(const Map& a, const Map& b) {
  Channels channels;
  std::set<std::string> names;
  for (const Map* map : {&a, &b})
    for (int slot = 0; slot < map->classes.size(); ++slot) names.insert(map->classes.at_slot(slot).name);
  for (const std::string& name : names)
    channels.evidence.push_back(
        {a.classes.slot_of_name(name), b.classes.slot_of_name(name), {"evidence/" + name, "counts"}});
  std::set<std::string> properties;
  for (const Map* map : {&a, &b})
    if (map->touches.any_active())
      for (int p = 0; p < map->properties.size(); ++p) properties.insert(map->properties[p].name);
  for (const std::string& name : properties) {
    const std::string prefix = "touch/" + name + "/";
    channels.touched.push_back({a.properties.index_of(name),
                                b.properties.index_of(name),
                                {prefix + "n", "readings"},
                                {prefix + "mean", "unit"},
                                {prefix + "m2", "unit^2"}});
  }
  return channels;
}

void compare_geometry(const Block* a, const Block* b, Channels& channels) {
  for (int i = 0; i < kBlockVoxels; ++i) {
    const float wa = a != nullptr ? a->geometry->weight[i] : 0, wb = b != nullptr ? b->geometry->weight[i] : 0;
    // A weight that is not a number is a value too: it must not hide.
    const bool in_a = !(wa <= 0), in_b = !(wb <= 0);
    channels.weight.add(in_a, in_b, wa, wb);
    channels.tsdf.add(in_a, in_b, in_a ? a->geometry->tsdf[i] : 0, in_b ? b->geometry->tsdf[i] : 0);
  }
}

void compare_color(const Block* a, const Block* b, Channels& channels) {
  const ColorPlanes* ca = a != nullptr ? a->color : nullptr;
  const ColorPlanes* cb = b != nullptr ? b->color : nullptr;
  if (ca == nullptr && cb == nullptr) return;
  for (int i = 0; i < kBlockVoxels; ++i) {
    const int na = ca != nullptr ? ca->count[i] : 0, nb = cb != nullptr ? cb->count[i] : 0;
    channels.color_count.add(na > 0, nb > 0, na, nb);
    double worst = 0;
    if (na > 0 && nb > 0)
      worst = std::max({std::abs(ca->r[i] - cb->r[i]), std::abs(ca->g[i] - cb->g[i]), std::abs(ca->b[i] - cb->b[i])});
    channels.color.add(na > 0, nb > 0, worst / 256, 0);
  }
}

void compare_planes(const Plane* a, const Plane* b, Accumulator& channel) {
  if (a == nullptr && b == nullptr) return;
  for (int i = 0; i < kBlockVoxels; ++i) {
    const float va = a != nullptr ? a->value[i] : 0, vb = b != nullptr ? b->value[i] : 0;
    channel.add(va != 0, vb != 0, va, vb);
  }
}

void compare_evidence(const Block* a, const Block* b, Channels::Evidence& channel) {
  compare_planes(evidence_of(a, channel.slot_a), evidence_of(b, channel.slot_b), channel.sums);
}

void compare_instances(const Block* a, const Block* b, Channels& channels) {
  const InstancePlanes* pa = a != nullptr ? a->instance : nullptr;
  const InstancePlanes* pb = b != nullptr ? b->instance : nullptr;
  if (pa == nullptr && pb == nullptr) return;
  for (int i = 0; i < kBlockVoxels; ++i) {
    const int ia = pa != nullptr ? pa->id[i] : 0, ib = pb != nullptr ? pb->id[i] : 0;
    channels.instance.add(ia != 0, ib != 0, ia != ib, 0);
    channels.instance_votes.add(ia != 0, ib != 0, pa != nullptr ? pa->votes[i] : 0, pb != nullptr ? pb->votes[i] : 0);
  }
}

const TouchPlanes* touch_planes_of(const Block* block, std::optional<int> property) {
  if (block == nullptr || !property) return nullptr;
  for (const TouchPlanes& planes : block->touch)
    if (planes.property == *property) return &planes;
  return nullptr;
}

void compare_touched(const Block* a, const Block* b, Channels::Touched& channel) {
  const TouchPlanes* ta = touch_planes_of(a, channel.property_a);
  const TouchPlanes* tb = touch_planes_of(b, channel.property_b);
  if (ta == nullptr && tb == nullptr) return;
  const auto compare = [&](Plane* const TouchPlanes::*plane, Accumulator& sums) {
    for (int i = 0; i < kBlockVoxels; ++i)
      sums.add(ta != nullptr && ta->n->value[i] > 0, tb != nullptr && tb->n->value[i] > 0,
               ta != nullptr ? (ta->*plane)->value[i] : 0, tb != nullptr ? (tb->*plane)->value[i] : 0);
  };
  compare(&TouchPlanes::n, channel.n);
  compare(&TouchPlanes::mean, channel.mean);
  compare(&TouchPlanes::m2, channel.m2);
}

void compare_journals(const TouchJournal& a, const TouchJournal& b, MapDifference& result) {
  const auto active = [](const Touch* touch) { return touch != nullptr && !touch->undone; };
  for (const Touch& touch : b.touches) {
    result.touches_only_b += active(&touch) && !active(a.find(touch.id));
    result.undone_only_b += touch.undone && a.find(touch.id) == nullptr;
  }
  for (const Touch& touch : a.touches) {
    result.undone_only_a += touch.undone && b.find(touch.id) == nullptr;
    if (!active(&touch)) continue;
    const Touch* other = b.find(touch.id);
    if (!active(other)) {
      ++result.touches_only_a;
      continue;
    }
    ++result.touches_both;
    if (touch.region == other->region) continue;
    ++result.regions_changed;
    result.region_voxels_changed +=
        subtracted(touch.region, other->region).voxels() + subtracted(other->region, touch.region).voxels();
  }
}

/// Labels of the voxels of a map, as in its grid `label`.
class Labels {
public:
  explicit Labels(const Map& map) : map_(map) {
    if (map.touches.any_active()) touched_ = touch_views(map);
  }

  bool any(const Block& block) const { return block.has_evidence() || view_of(touched_, block.coord) != nullptr; }
  /// Slot of the class of a voxel, ClassTable::kNoSlot where it has none.
  uint16_t slot(const Block& block, int i) const {
    if (const TouchView* view = view_of(touched_, block.coord); view != nullptr && view->mask.test(i))
      return uint16_t(view->label[size_t(i)]);
    return class_belief(block, i, map_.classes, /*with_entropy=*/false).slot;
  }
  const std::string& name(uint16_t slot) const { return map_.classes.at_slot(slot).name; }

private:
  const Map& map_;
  std::vector<TouchView> touched_;
};

size_t flips(const Labels& labels_a, const Labels& labels_b, const Block* a, const Block* b) {
  if (a == nullptr || b == nullptr || !labels_a.any(*a) || !labels_b.any(*b)) return 0;
  size_t n = 0;
  for (int i = 0; i < kBlockVoxels; ++i) {
    const uint16_t slot_a = labels_a.slot(*a, i), slot_b = labels_b.slot(*b, i);
    n += slot_a != ClassTable::kNoSlot && slot_b != ClassTable::kNoSlot &&
         labels_a.name(slot_a) != labels_b.name(slot_b);
  }
  return n;
}

/// Voxels that both maps label, as another class.
size_t all_flips(const Map& a, const Map& b, const std::set<BlockCoord>& coordinates) {
  const Labels labels_a(a), labels_b(b);
  size_t n = 0;
  for (const BlockCoord& coord : coordinates)
    n += flips(labels_a, labels_b, observed_block(a, coord), observed_block(b, coord));
  return n;
}

}  // namespace

MapDifference difference(const Map& a, const Map& b) {
  MapDifference result;
  result.settings = different_settings(a, b);
  result.comparable = a.voxel_size_m == b.voxel_size_m;
  if (!(a.frames == b.frames))
    result.settings.push_back("frame journals: " + std::to_string(frame_count(a.frames)) + " and " +
                              std::to_string(frame_count(b.frames)) + " frames, not the same");
  if (!result.comparable) return result;
  result.same_hash = map_hash(a) == map_hash(b);
  Channels channels = make_channels(a, b);
  const std::set<BlockCoord> coordinates = observed_coordinates(a, b);
  for (const BlockCoord& coord : coordinates) {
    const Block* in_a = observed_block(a, coord);
    const Block* in_b = observed_block(b, coord);
    ++(in_a == nullptr ? result.blocks_only_b : in_b == nullptr ? result.blocks_only_a : result.blocks_both);
    compare_geometry(in_a, in_b, channels);
    compare_color(in_a, in_b, channels);
    for (Channels::Evidence& channel : channels.evidence) compare_evidence(in_a, in_b, channel);
    compare_planes(in_a != nullptr ? in_a->even_evidence : nullptr, in_b != nullptr ? in_b->even_evidence : nullptr,
                   channels.even_evidence);
    compare_instances(in_a, in_b, channels);
    for (Channels::Touched& channel : channels.touched) compare_touched(in_a, in_b, channel);
  }
  // What touched voxels are believed to be takes a while: not where every value and every prior is the same.
  if (!result.same_hash || !(a.classes == b.classes) || !(a.properties == b.properties))
    result.class_flips = all_flips(a, b, coordinates);
  for (Accumulator* sums : {&channels.tsdf, &channels.weight, &channels.color, &channels.color_count})
    result.channels.push_back(sums->finish());
  for (Channels::Evidence& channel : channels.evidence) result.channels.push_back(channel.sums.finish());
  // Most maps have neither: then there is nothing to say.
  for (Accumulator* sums : {&channels.even_evidence, &channels.instance, &channels.instance_votes})
    if (const ChannelDifference channel = sums->finish();
        channel.voxels_both + channel.voxels_only_a + channel.voxels_only_b > 0)
      result.channels.push_back(channel);
  for (Channels::Touched& channel : channels.touched)
    for (Accumulator* sums : {&channel.n, &channel.mean, &channel.m2}) result.channels.push_back(sums->finish());
  compare_journals(a.touches, b.touches, result);
  return result;
}

bool beyond(const MapDifference& difference, double tolerance) {
  if (!difference.comparable) return true;
  for (const std::string& line : difference.settings)
    if (!line.starts_with("frame journals")) return true;
  if (difference.touches_only_a + difference.touches_only_b + difference.regions_changed > 0) return true;
  return std::any_of(difference.channels.begin(), difference.channels.end(), [&](const ChannelDifference& c) {
    // Ids are names: no two of them are nearly equal.
    const bool other_names = c.name == "instance" && c.voxels_changed > 0;
    return c.voxels_only_a != 0 || c.voxels_only_b != 0 || other_names || !(c.max_difference <= tolerance);
  });
}

}  // namespace felt
