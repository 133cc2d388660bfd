#include "io/simulation/touches.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <utility>

#include "io/simulation/random.h"

namespace felt {
namespace {

enum Stream : uint64_t { kThing = 200, kPixel, kRegion, kReading, kMeasurement };

using Segment = std::pair<uint16_t, uint16_t>;  // instance, material

/// Pixels of each segment whose neighbours four pixels away belong to it too; where `predicted` is given, only those it
/// is wrong about.
std::map<Segment, std::vector<int>> touchable_pixels(const Scene& scene, const SceneView& view,
                                                     const Property& property, const LabelImage* predicted) {
  constexpr int kMargin = 4;
  std::map<Segment, std::vector<int>> pixels;
  const int w = view.depth_m.width(), h = view.depth_m.height();
  const auto segment = [&](int u, int v) { return Segment(view.instances(u, v), view.materials(u, v)); };
  for (int v = kMargin; v < h - kMargin; ++v) {
    for (int u = kMargin; u < w - kMargin; ++u) {
      const Segment here = segment(u, v);
      const uint16_t slot = scene.materials.slot_of_id(here.second);
      if (slot == ClassTable::kNoSlot || !property.priors.contains(scene.materials.at_slot(slot).name)) continue;
      if (predicted != nullptr && (*predicted)(u, v) == here.second) continue;
      if (segment(u - kMargin, v) == here && segment(u + kMargin, v) == here && segment(u, v - kMargin) == here &&
          segment(u, v + kMargin) == here)
        pixels[here].push_back(v * w + u);
    }
  }
  return pixels;
}

}  // namespace

std::vector<SimulatedTouch> simulate_touches(const Scene& scene, const Trajectory& trajectory,
                                             const PinholeCamera& camera, const Property& property,
                                             const TouchOptions& options) {
  std::vector<SimulatedTouch> touches;
  std::map<Segment, int> times;
  const auto draw = [&](Stream stream, uint64_t counter) { return random_bits(options.seed, stream, 0, counter); };
  for (int i = 0; i < options.count; ++i) {
    const size_t frame =
        std::min(size_t(i + 1) * trajectory.size() / (size_t(options.count) + 1), trajectory.size() - 1);
    const SceneView view = render_view(scene, camera, trajectory[frame], false);
    LabelImage predicted;
    if (options.mistaken_by)
      predicted = run_network(*options.mistaken_by, scene.materials, view.materials, view.instances, options.seed,
                              int64_t(frame))
                      .labels;
    const auto pixels = touchable_pixels(scene, view, property, options.mistaken_by ? &predicted : nullptr);
    if (pixels.empty()) continue;
    int fewest = options.count;
    for (const auto& [segment, where] : pixels) fewest = std::min(fewest, times[segment]);
    std::vector<Segment> candidates;
    for (const auto& [segment, where] : pixels)
      if (times[segment] == fewest) candidates.push_back(segment);
    const Segment segment = candidates[draw(kThing, i) % candidates.size()];
    ++times[segment];

    const std::vector<int>& where = pixels.at(segment);
    const int pixel = where[draw(kPixel, i) % where.size()], u = pixel % camera.width, v = pixel / camera.width;
    SimulatedTouch touch;
    touch.frame = int64_t(frame);
    touch.position_m = trajectory[frame] * Eigen::Vector3d(double(view.depth_m(u, v)) * camera.ray(u, v));
    touch.instance = segment.first;
    touch.material = segment.second;
    touch.sigma = options.sigma;
    const PropertyPrior& prior =
        property.priors.at(scene.materials.at_slot(scene.materials.slot_of_id(segment.second)).name);
    const double region = standard_normal(draw(kRegion, uint64_t(segment.first) << 16 | segment.second));
    const double reading = standard_normal(draw(kReading, i));
    touch.value = prior.mean + prior.sd * (std::sqrt(property.rho) * region + std::sqrt(1 - property.rho) * reading) +
                  options.sigma * standard_normal(draw(kMeasurement, i));
    touch.value = std::clamp(touch.value, property.support_lo, property.support_hi);
    touches.push_back(touch);
  }
  return touches;
}

std::string touches_csv(const std::vector<SimulatedTouch>& touches, const std::string& property) {
  std::string csv = "frame,x,y,z,property,value,sigma\n";
  for (const SimulatedTouch& t : touches) {
    char line[256];
    std::snprintf(line, sizeof line, "%lld,%.6f,%.6f,%.6f,%s,%.6f,%.6g\n", static_cast<long long>(t.frame),
                  t.position_m.x(), t.position_m.y(), t.position_m.z(), property.c_str(), t.value, t.sigma);
    csv += line;
  }
  return csv;
}

PropertyTable simulated_properties() {
  Property friction;
  friction.name = "friction";
  friction.support_lo = 0;
  friction.rho = 0.5;
  friction.priors = {{"concrete", {0.543, 0.065, 50}}, {"grass", {0.577, 0.077, 50}},  {"rock", {0.478, 0.133, 50}},
                     {"wood", {0.372, 0.055, 50}},     {"rubber", {0.616, 0.048, 50}}, {"plastic", {0.311, 0.045, 50}},
                     {"snow", {0.390, 0.071, 50}},     {"ice", {0.192, 0.046, 50}}};
  return PropertyTable({friction});
}

}  // namespace felt
