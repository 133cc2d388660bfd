#include "mapping/surface_color.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "core/error.h"
#include "mapping/property_view.h"
#include "mapping/touch_view.h"

namespace felt {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

/// What is known of a voxel.
struct Known {
  ClassBelief belief;
  float value = kNan;  ///< of the ramp

  bool labelled() const { return belief.slot != ClassTable::kNoSlot; }
};

/// What a colour shows of a voxel.
class SurfaceBeliefs {
public:
  SurfaceBeliefs(const Map& map, const SurfaceColor& color)
      : map_(map), color_(color), touched_(std::make_shared<const std::vector<TouchView>>(touch_views(map))) {
    if (color.property >= 0) property_.emplace(map, color.property, touched_);
  }

  Known at(const Index3& voxel) const {
    const ClassBelief belief = class_belief_at(map_, *touched_, voxel);
    if (!property_) return {belief, belief.slot == ClassTable::kNoSlot ? kNan : belief.entropy};
    const PropertyEstimate estimate = property_->at(voxel);
    return {belief, color_.source == SurfaceColor::Source::mean ? estimate.mean : estimate.sd};
  }

private:
  const Map& map_;
  const SurfaceColor& color_;
  TouchViews touched_;
  std::optional<PropertyView> property_;
};

constexpr Rgba8 kNothingKnown{128, 128, 128, 255};

/// Black over red to yellow for t in [0, 1].
Rgba8 heat(float t) {
  const auto level = [](float x) { return uint8_t(255 * std::clamp(x, 0.0f, 1.0f) + 0.5f); };
  return {level(2 * t), level(2 * t - 1), 0, 255};
}

ColorRange range_of(const Map& map, const SurfaceColor& color, const std::vector<Known>& known) {
  if (color.source == SurfaceColor::Source::entropy) return {0, std::log(float(std::max(2, map.classes.size())))};
  ColorRange range{std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::infinity()};
  for (const Known& k : known)
    if (std::isfinite(k.value)) range = {std::min(range.low, k.value), std::max(range.high, k.value)};
  return range.low <= range.high ? range : ColorRange{};
}

}  // namespace

Index3 nearest_voxel(const VertexEdge& edge) {
  Index3 voxel = edge.voxel;
  if (edge.t >= 0.5f) (edge.axis == 0 ? voxel.x : edge.axis == 1 ? voxel.y : voxel.z) += 1;
  return voxel;
}

SurfaceColor parse_surface_color(const std::string& text, const Map& map) {
  using Source = SurfaceColor::Source;
  std::string possible = "rgb";
  if (!map.classes.empty()) possible += ", class, entropy";
  for (int p = 0; p < map.properties.size(); ++p)
    for (const char* what : {".mean", ".sd"}) possible += ", " + map.properties[p].name + what;
  if (text == "rgb") return {};
  if (text == "class" && !map.classes.empty()) return {Source::classes, -1};
  if (text == "entropy" && !map.classes.empty()) return {Source::entropy, -1};
  for (const auto& [ending, source] : {std::pair{".mean", Source::mean}, {".sd", Source::sd}})
    if (text.ends_with(ending))
      if (const auto p = map.properties.index_of(text.substr(0, text.size() - std::string(ending).size())))
        return {source, int(*p)};
  throw ConfigError(describe_mismatch("--color-by", "what the map can show", "one of " + possible, "'" + text + "'"));
}

std::optional<ColorRange> color_surface(const Map& map, const std::vector<VertexEdge>& edges, const SurfaceColor& color,
                                        TriangleMesh& mesh) {
  using Source = SurfaceColor::Source;
  if (map.classes.empty()) return std::nullopt;
  std::vector<Known> known;
  const SurfaceBeliefs beliefs(map, color);
  known.resize(edges.size());
  tbb::parallel_for(size_t(0), edges.size(), [&](size_t i) { known[i] = beliefs.at(nearest_voxel(edges[i])); });
  MeshScalars probability{"label_prob", {}}, entropy{"entropy", {}};
  for (const Known& k : known) {
    mesh.labels.push_back(k.labelled() ? map.classes.at_slot(k.belief.slot).id : 0);
    probability.values.push_back(k.labelled() ? k.belief.probability : kNan);
    entropy.values.push_back(k.labelled() ? k.belief.entropy : kNan);
  }
  mesh.scalars.push_back(std::move(probability));
  mesh.scalars.push_back(std::move(entropy));
  if (color.source == Source::rgb) return std::nullopt;

  mesh.colors.assign(known.size(), kNothingKnown);
  if (color.source == Source::classes) {
    for (size_t i = 0; i < known.size(); ++i)
      if (known[i].labelled()) mesh.colors[i] = map.classes.at_slot(known[i].belief.slot).color;
    return std::nullopt;
  }
  const ColorRange range = range_of(map, color, known);
  const float span = range.high > range.low ? range.high - range.low : 1.0f;
  for (size_t i = 0; i < known.size(); ++i)
    if (std::isfinite(known[i].value)) mesh.colors[i] = heat((known[i].value - range.low) / span);
  if (color.property < 0) return range;
  MeshScalars scalars{map.properties[color.property].name + (color.source == Source::mean ? "_mean" : "_sd"), {}};
  for (const Known& k : known) scalars.values.push_back(k.value);
  mesh.scalars.push_back(std::move(scalars));
  return range;
}

}  // namespace felt
