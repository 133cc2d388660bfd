#pragma once

#include <filesystem>
#include <string>

#include "io/simulation/scene.h"

namespace felt {

/// Reads a scene from YAML (JSON is YAML too, so a `scene.json` that the simulator wrote is one). Classes and materials
/// are named as in the built-in tables. Keys:
///   name, description
///   bounds_m: [[x, y, z], [x, y, z]]       light_m: [x, y, z]
///   primitives: list of
///     {name, shape: plane|box|sphere|cylinder, half_size_m: [x, y, z], semantic, material, instance,
///      position_m: [x, y, z], rotation_deg: [about x, about y, about z, in this order about fixed axes],
///      pattern: plain|checker|noise|wood|tiles|stripes|picture, color: [r, g, b], second_color: [r, g, b], scale_m}
///   path: list of {position_m: [x, y, z], look_at_m: [x, y, z]}
/// Throws IoError, or ConfigError with every problem found (path:line).
Scene read_scene(const std::filesystem::path& file);
/// The same from text; `where` stands for the path in messages.
Scene parse_scene(const std::string& text, const std::string& where);

/// A JSON document that `parse_scene` turns back into the scene. `simulation`: a JSON value stored under that key,
/// about how frames were made from it; empty: none.
std::string scene_json(const Scene& scene, const std::string& simulation = "");

}  // namespace felt
