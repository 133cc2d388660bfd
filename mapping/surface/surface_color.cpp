#include "mapping/surface/surface_color.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "core/error.h"
#include "mapping/touch/property_view.h"
#include "mapping/touch/touch_view.h"

namespace felt {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

constexpr Rgba8 kNothingKnown{128, 128, 128, 255};

/// Black over red to yellow for t in [0, 1].
Rgba8 heat(float t) {
  const auto level = [](float x) { return uint8_t(255 * std::clamp(x, 0.0f, 1.0f) + 0.5f); };
  return {level(2 * t), level(2 * t - 1), 0, 255};
}

ColorRange range_of(const Map& map, const SurfaceColor& color, const std::vector<float>& values) {
  if (color.source == SurfaceColor::Source::entropy) return {0, std::log(float(std::max(2, map.classes.size())))};
  ColorRange range{std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::infinity()};
  for (const float value : values)
    if (std::isfinite(value)) range = {std::min(range.low, value), std::max(range.high, value)};
  return range.low <= range.high ? range : ColorRange{};
}

std::string mean_name(const Property& property) { return property.name + "_mean"; }
std::string sd_name(const Property& property) { return property.name + "_sd"; }

/// `value(voxel)` of the voxel nearest to each vertex, in parallel.
template <typename Value>
void at_vertices(const std::vector<VertexEdge>& edges, const Value& value) {
  tbb::parallel_for(size_t(0), edges.size(), [&](size_t i) { value(i, nearest_voxel(edges[i])); });
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

void attach_beliefs(const Map& map, const std::vector<VertexEdge>& edges, TriangleMesh& mesh) {
  if (map.classes.empty()) return;
  const auto touched = std::make_shared<const std::vector<TouchView>>(touch_views(map));
  mesh.labels.assign(edges.size(), kNoLabel);
  MeshScalars probability{"label_prob", std::vector<float>(edges.size(), kNan)};
  MeshScalars entropy{"entropy", std::vector<float>(edges.size(), kNan)};
  at_vertices(edges, [&](size_t i, const Index3& voxel) {
    const ClassBelief belief = class_belief_at(map, *touched, voxel);
    if (belief.slot == ClassTable::kNoSlot) return;
    mesh.labels[i] = map.classes.at_slot(belief.slot).id;
    probability.values[i] = belief.probability;
    entropy.values[i] = belief.entropy;
  });
  mesh.scalars.push_back(std::move(probability));
  mesh.scalars.push_back(std::move(entropy));
  if (map.properties.empty()) return;
  MeshScalars reached{"touched", std::vector<float>(edges.size(), 0.0f)};
  for (int p = 0; p < map.properties.size(); ++p) {
    const PropertyView view(map, p, touched);
    MeshScalars mean{mean_name(map.properties[p]), std::vector<float>(edges.size())};
    MeshScalars sd{sd_name(map.properties[p]), std::vector<float>(edges.size())};
    at_vertices(edges, [&](size_t i, const Index3& voxel) {
      const PropertyEstimate estimate = view.at(voxel);
      mean.values[i] = estimate.mean;
      sd.values[i] = estimate.sd;
      if (estimate.touched) reached.values[i] = 1;
    });
    mesh.scalars.push_back(std::move(mean));
    mesh.scalars.push_back(std::move(sd));
  }
  mesh.scalars.push_back(std::move(reached));
}

std::optional<ColorRange> color_surface(const Map& map, const std::vector<VertexEdge>& edges, const SurfaceColor& color,
                                        TriangleMesh& mesh) {
  using Source = SurfaceColor::Source;
  if (map.classes.empty() || color.source == Source::rgb) return std::nullopt;
  mesh.colors.assign(edges.size(), kNothingKnown);
  if (color.source == Source::classes) {
    const std::vector<float>& probability = *TriangleMesh::find(mesh.scalars, "label_prob");
    for (size_t i = 0; i < edges.size(); ++i)
      if (std::isfinite(probability[i]))
        mesh.colors[i] = map.classes.at_slot(map.classes.slot_of_id(mesh.labels[i])).color;
    return std::nullopt;
  }
  const std::string name = color.source == Source::entropy ? "entropy"
                           : color.source == Source::mean  ? mean_name(map.properties[color.property])
                                                           : sd_name(map.properties[color.property]);
  const std::vector<float>& values = *TriangleMesh::find(mesh.scalars, name);
  const ColorRange range = range_of(map, color, values);
  const float span = range.high > range.low ? range.high - range.low : 1.0f;
  for (size_t i = 0; i < values.size(); ++i)
    if (std::isfinite(values[i])) mesh.colors[i] = heat((values[i] - range.low) / span);
  return range;
}

}  // namespace felt
