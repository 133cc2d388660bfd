#include "bench/paper/map_comparison.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <random>

#include "io/simulation/label_network.h"
#include "io/simulation/random.h"
#include "mapping/fusion/tsdf_integrator.h"
#include "mapping/touch/touch_suggestion.h"
#include "mapping/touch/touch_update.h"

namespace felt::paper {
namespace {

using Thing = std::pair<uint16_t, uint16_t>;  ///< instance, true label
enum Stream : uint64_t { kCommon = 900, kOwn, kPlace };

const PropertyPrior* prior_of(const Recording& recording, uint16_t label) {
  const uint16_t slot = recording.classes.slot_of_id(label);
  if (slot == ClassTable::kNoSlot) return nullptr;
  const auto found = recording.property.priors.find(recording.classes.at_slot(slot).name);
  return found == recording.property.priors.end() ? nullptr : &found->second;
}

double drawn(const Recording& recording, const Thing& thing, int time, uint64_t seed) {
  const PropertyPrior& prior = *prior_of(recording, thing.second);
  const uint64_t name = uint64_t(thing.first) << 16 | thing.second;
  const double common = standard_normal(random_bits(seed, kCommon, 0, name));
  const double own = standard_normal(random_bits(seed, kOwn, uint64_t(time), name));
  const double rho = recording.property.rho;
  return std::clamp(prior.mean + prior.sd * (std::sqrt(rho) * common + std::sqrt(1 - rho) * own),
                    recording.property.support_lo, recording.property.support_hi);
}

Thing thing_at(const Frame& frame, int u, int v) { return {frame.instances(u, v), frame.labels(u, v)}; }

/// Pixels of each touchable thing whose neighbours at a distance belong to it too.
std::map<Thing, std::vector<int>> inner_pixels(const Recording& recording, const Frame& frame) {
  constexpr int kMargin = 5;
  std::map<Thing, std::vector<int>> pixels;
  for (int v = kMargin; v < frame.labels.height() - kMargin; ++v)
    for (int u = kMargin; u < frame.labels.width() - kMargin; ++u) {
      const Thing thing = thing_at(frame, u, v);
      const float depth = frame.depth_m(u, v);
      if (!(depth > 0.3f && depth < recording.max_depth_m) || prior_of(recording, thing.second) == nullptr) continue;
      if (thing_at(frame, u - kMargin, v) == thing && thing_at(frame, u + kMargin, v) == thing &&
          thing_at(frame, u, v - kMargin) == thing && thing_at(frame, u, v + kMargin) == thing)
        pixels[thing].push_back(v * frame.labels.width() + u);
    }
  return pixels;
}

Eigen::Vector3d point_of(const Frame& frame, int pixel) {
  const int u = pixel % frame.labels.width(), v = pixel / frame.labels.width();
  return frame.T_world_camera * Eigen::Vector3d(double(frame.depth_m(u, v)) * frame.camera.ray(u, v));
}

/// What is at a point of the surface, by the frame that sees it from nearest.
std::optional<Thing> thing_at(const Recording& recording, const Eigen::Vector3d& point_m) {
  constexpr double kSame = 0.03;
  std::optional<Thing> thing;
  double nearest = recording.max_depth_m;
  for (const Frame& frame : recording.frames) {
    const Eigen::Vector3d p = frame.T_world_camera.inverse(Eigen::Isometry) * point_m;
    if (!(p.z() > 0.1 && p.z() < nearest)) continue;
    const Eigen::Vector2d at = frame.camera.project(p);
    const int u = int(std::floor(at.x() + 0.5)), v = int(std::floor(at.y() + 0.5));
    if (u < 0 || v < 0 || u >= frame.labels.width() || v >= frame.labels.height()) continue;
    if (!(std::abs(double(frame.depth_m(u, v)) - p.z()) < kSame)) continue;
    nearest = p.z();
    thing = thing_at(frame, u, v);
  }
  return thing;
}

bool touched(Map& map, const Recording& recording, const Reading& reading, double stamp_s) {
  TouchRequest request;
  request.stamp_s = stamp_s;
  request.point_m = reading.point_m;
  request.property = recording.property.name;
  request.value = reading.value;
  try {
    add_touch(map, resolve_touch(map, request));
    return true;
  } catch (const TouchError&) {
    return false;
  }
}

}  // namespace

ClassTable with_prior(const ClassTable& classes, double prior) {
  std::vector<ClassInfo> rows = classes.classes();
  for (ClassInfo& row : rows) row.prior = prior;
  return ClassTable(std::move(rows));
}

NetworkLabels network_labels(const Recording& recording, const ConfusionMatrix& confusion, uint64_t seed) {
  std::vector<double> share(size_t(recording.classes.size()), 1e-6);
  for (const Frame& frame : recording.frames)
    for (const uint16_t id : frame.labels)
      if (const uint16_t slot = recording.classes.slot_of_id(id); slot != ClassTable::kNoSlot) share[slot] += 1;
  double total = 0;
  for (const double s : share) total += s;
  for (double& s : share) s /= total;
  const LabelNetwork network{confusion, ErrorScale::scene, recording.classes.size(), 1, share};
  NetworkLabels all;
  for (const Frame& frame : recording.frames) {
    NetworkOutput out = run_network(network, recording.classes, frame.labels, frame.instances, seed, frame.index);
    all.labels.push_back(std::move(out.labels));
    all.probabilities.push_back(std::move(out.probabilities));
  }
  return all;
}

Map fused(const Recording& recording, const NetworkLabels& network, Evidence evidence) {
  Map map(recording.voxel_size_m, 4 * recording.voxel_size_m);
  map.classes = with_prior(recording.classes, evidence == Evidence::calibrated ? 1.0 / recording.classes.size() : 1);
  map.properties = PropertyTable({recording.property});
  IntegrationConfig config;
  config.max_depth_m = float(recording.max_depth_m);
  IntegrationScratch scratch;
  for (size_t i = 0; i < recording.frames.size(); ++i) {
    Frame frame = recording.frames[i];
    frame.instances = {};
    frame.labels = network.labels[i];
    if (evidence == Evidence::calibrated) frame.probabilities = network.probabilities[i];
    integrate(map, frame, config, scratch);
  }
  return map;
}

std::vector<Reading> readings_where_wrong(const Recording& recording, const NetworkLabels& network, int times,
                                          uint64_t seed) {
  /// The view that shows most of a thing.
  struct Best {
    size_t frame = 0;
    std::vector<int> pixels;
  };
  std::map<Thing, Best> best;
  for (size_t f = 0; f < recording.frames.size(); ++f)
    for (auto& [thing, pixels] : inner_pixels(recording, recording.frames[f])) {
      std::erase_if(pixels, [&](int pixel) { return network.labels[f].data()[pixel] == thing.second; });
      if (pixels.size() > best[thing].pixels.size()) best[thing] = {f, std::move(pixels)};
    }
  constexpr size_t kFewestPixels = 50;
  std::vector<Reading> readings;
  for (const auto& [thing, where] : best) {
    if (where.pixels.size() < kFewestPixels) continue;
    for (int time = 0; time < times; ++time) {
      const uint64_t name = uint64_t(thing.first) << 16 | thing.second;
      const int pixel = where.pixels[random_bits(seed, kPlace, uint64_t(time), name) % where.pixels.size()];
      readings.push_back({point_of(recording.frames[where.frame], pixel), drawn(recording, thing, time, seed)});
    }
  }
  return readings;
}

int touch(Map& map, const Recording& recording, const std::vector<Reading>& readings) {
  int refused = 0;
  for (size_t i = 0; i < readings.size(); ++i) refused += !touched(map, recording, readings[i], double(i));
  return refused;
}

void undo_touches(Map& map) {
  std::vector<uint64_t> ids;
  for (const Touch& t : map.touches.touches)
    if (!t.undone) ids.push_back(t.id);
  for (const uint64_t id : ids) undo_touch(map, id);
}

int touch_as_suggested(Map& map, const Recording& recording, int count, uint64_t seed) {
  SuggestionSettings settings;
  settings.most = 50;
  std::map<Thing, int> times;
  int made = 0;
  for (int i = 0; i < count; ++i) {
    bool done = false;
    for (const Suggestion& s : suggest_touches(map, recording.property.name, settings)) {
      // What cannot be felt (no prior: no friction known) is passed over, as a hand that reports nothing would be.
      const auto thing = thing_at(recording, s.point_m);
      if (!thing || prior_of(recording, thing->second) == nullptr) continue;
      if (!touched(map, recording, {s.point_m, drawn(recording, *thing, times[*thing], seed)}, 1e6 + i)) continue;
      ++times[*thing];
      ++made, done = true;
      break;
    }
    if (!done) break;
  }
  return made;
}

LabelScores score(const Map& map, const Recording& recording, bool class_images) {
  const RayCaster caster(map);
  const VoxelBeliefs beliefs(map);
  const TruthClasses slots(map.classes, recording.classes);
  LabelScores scores(map.classes.size());
  for (const Frame& frame : recording.frames)
    add_view(scores, predict_labels(caster, beliefs, frame.camera, frame.T_world_camera, 2 * recording.max_depth_m),
             {&frame.labels, &frame.depth_m, 0.1, recording.max_depth_m}, slots, class_images);
  return scores;
}

}  // namespace felt::paper
