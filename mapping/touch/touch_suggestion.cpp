#include "mapping/touch/touch_suggestion.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <unordered_map>
#include <utility>

#include "core/text.h"
#include "inference/class_posterior.h"
#include "inference/information_gain.h"
#include "mapping/regions/map_segments.h"
#include "mapping/regions/region_area.h"
#include "mapping/regions/region_surface.h"

namespace felt {
namespace {

/// Tries per block: voxels of noisy labels each make a region of their own, and none of them is worth a touch.
constexpr int kSeedsPerBlock = 8;
constexpr double kLeastOutcome = 0.05;
constexpr size_t kMostOutcomes = 4;

/// The region's voxel nearest to its centroid; the first of equals.
Index3 middle_of(const Region& region) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  const auto visit = [&](const auto& f) {
    for (size_t b = 0; b < region.blocks(); ++b)
      for_each_bit(region.mask[b], [&](int i) { f(voxel_at(region.coord[b], i)); });
  };
  visit([&](const Index3& v) { sum += Eigen::Vector3d(v.x, v.y, v.z); });
  const Eigen::Vector3d centre = sum / double(region.voxels());
  Index3 nearest;
  double best = std::numeric_limits<double>::infinity();
  visit([&](const Index3& v) {
    const double d = (Eigen::Vector3d(v.x, v.y, v.z) - centre).squaredNorm();
    if (d < best) best = d, nearest = v;
  });
  return nearest;
}

std::vector<Outcome> outcomes_of(const StudentTMixture& next) {
  std::vector<size_t> order(next.weight.size());
  std::iota(order.begin(), order.end(), size_t(0));
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return next.weight[a] > next.weight[b]; });
  std::vector<Outcome> outcomes;
  for (const size_t c : order) {
    if (next.weight[c] < kLeastOutcome || outcomes.size() == kMostOutcomes) break;
    Outcome outcome{int(c), next.weight[c], next.component[c].location, {}};
    std::vector<double> log_likelihood;
    for (size_t j = 0; j < next.weight.size(); ++j)
      log_likelihood.push_back(next.weight[j] > 0 ? log_pdf(next.component[j], outcome.reading)
                                                  : -std::numeric_limits<double>::infinity());
    outcome.class_probability = class_posterior(next.weight, log_likelihood).p;
    outcomes.push_back(std::move(outcome));
  }
  return outcomes;
}

}  // namespace

std::vector<Region> segments(const Map& map, const RegionSettings& settings, size_t min_voxels) {
  if (settings.rule == RegionRule::segment) {
    std::vector<Region> all = map_segments(map, map_segment_settings(settings));
    std::erase_if(all, [&](const Region& region) { return region.voxels() < min_voxels; });
    return all;
  }
  std::unordered_map<BlockCoord, BlockMask> done;
  std::vector<Region> found;
  const float band_m = float(settings.band_voxels * map.voxel_size_m);
  for (const uint32_t number : map.store.sorted()) {
    const Block& block = map.store[number];
    if (block.evidence.empty()) continue;
    const BlockMask band = surface_band(block, band_m, float(settings.min_weight));
    BlockMask tried;  // not `done`: a seed belongs to the region that it finds
    for (int tries = 0; tries < kSeedsPerBlock; ++tries) {
      // Beside a known segment lies its border: from there the same surface would be flooded again.
      const BlockMask left = band - dilated_inside(done[block.coord] | tried);
      if (!left.any()) break;
      int seed = -1;
      for_each_bit(left, [&](int i) {
        if (seed < 0) seed = i;
      });
      tried.set(seed);
      const Index3 voxel = voxel_at(block.coord, seed);
      Region region;
      try {
        const Contact contact =
            find_contact(map, Eigen::Vector3d(voxel.x, voxel.y, voxel.z) * map.voxel_size_m, settings);
        region = find_region(map, contact, settings);
      } catch (const TouchError&) {
        continue;  // unlabelled surface, or class noise
      }
      Region fresh;
      for (size_t b = 0; b < region.blocks(); ++b) {
        BlockMask& seen = done[region.coord[b]];
        if (const BlockMask bits = region.mask[b] - seen; bits.any()) fresh.append(region.coord[b], bits);
        seen |= region.mask[b];
      }
      if (!fresh.empty() && fresh.voxels() >= min_voxels) found.push_back(std::move(fresh));
    }
  }
  return found;
}

std::vector<Suggestion> suggest_touches(const Map& map, const std::string& property,
                                        const SuggestionSettings& settings) {
  const auto index = map.properties.index_of(property);
  if (!index) {
    const std::string names = listed(map.properties.properties(), &Property::name);
    throw TouchError(describe_mismatch(
        "suggest", "property", names.empty() ? "a map with properties" : "one of " + names, "'" + property + "'"));
  }
  if (!class_priors(map.properties[*index], map.classes).any())
    throw TouchError(
        describe_mismatch("suggest", "priors of '" + property + "'", "one for a class of the map", "none"));
  Beliefs beliefs(map);
  std::vector<Suggestion> all;
  for (const Region& region : segments(map, settings.region, settings.min_voxels)) {
    const Index3 middle = middle_of(region);
    const Belief belief = beliefs.of(region, covering_touches(map, region));
    const StudentTMixture& next = belief.next_reading[size_t(*index)];
    if (next.weight.empty()) continue;
    Suggestion s;
    s.normal = surface_normal(map, middle, float(settings.region.min_weight)).cast<double>();
    const Block& block = *map.store.get(block_of_voxel(middle));
    s.point_m = Eigen::Vector3d(middle.x, middle.y, middle.z) * map.voxel_size_m -
                double(block.geometry->tsdf[offset_in_block(middle)]) * s.normal;
    s.voxels = region.voxels();
    s.area_m2 = surface_area_m2(map, region, settings.region);
    s.gain_nat = information_gain(next).value;
    s.class_probability = belief.class_probability;
    s.outcomes = outcomes_of(next);
    all.push_back(std::move(s));
  }
  std::stable_sort(all.begin(), all.end(), [](const Suggestion& a, const Suggestion& b) {
    return a.gain_nat * a.area_m2 > b.gain_nat * b.area_m2;
  });
  if (all.size() > size_t(settings.most)) all.resize(size_t(settings.most));
  return all;
}

}  // namespace felt
