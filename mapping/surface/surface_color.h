#pragma once

#include <optional>
#include <string>
#include <vector>

#include "mapping/map.h"
#include "mapping/surface/marching_cubes.h"

namespace felt {

/// What the colours of a surface show.
struct SurfaceColor {
  enum class Source { rgb, classes, entropy, mean, sd };
  Source source = Source::rgb;
  int property = -1;  ///< of mean and sd: PropertyTable index
};

/// Reads "rgb", "class", "entropy", "<property>.mean" or "<property>.sd". Throws ConfigError that lists what the map
/// can show, also where it has no classes.
SurfaceColor parse_surface_color(const std::string& text, const Map& map);

/// Values that the first and the last colour of a ramp stand for.
struct ColorRange {
  float low = 0, high = 0;
};

/// The voxel nearest to a vertex.
Index3 nearest_voxel(const VertexEdge& edge);

/// Gives a surface what the map believes of it, vertex by vertex from the voxel nearest to it. Where the map has
/// classes: `labels`, class ids (0: nothing known), and the scalars "label_prob" (probability of that class) and
/// "entropy" (nats), NaN where nothing is known. For each property of the map the scalars "<property>_mean" and
/// "<property>_sd" of the next reading (unit of the property, NaN where nothing is known), then "touched" (1 where a
/// touch reached, else 0). Vision and touches count alike. `edges`: of `extract_mesh`.
void attach_beliefs(const Map& map, const std::vector<VertexEdge>& edges, TriangleMesh& mesh);

/// Gives every vertex of a surface with its beliefs (attach_beliefs) the colour of what is believed there: of its class
/// by the class table, of entropy (nats, from 0 to the most that as many classes can have) and of the mean or standard
/// deviation of the next reading (from the least to the greatest on the surface) by a ramp from black over red to
/// yellow, and grey where nothing is known. Returns the range of the ramp; nothing for rgb and class.
std::optional<ColorRange> color_surface(const Map& map, const std::vector<VertexEdge>& edges, const SurfaceColor& color,
                                        TriangleMesh& mesh);

}  // namespace felt
