#pragma once

#include <string>
#include <vector>

#include "io/simulation/scene.h"

namespace felt {

/// Names of the built-in scenes, in the order in which `feltmap simulate --list` shows them.
const std::vector<std::string>& scene_names();
/// A built-in scene. Throws ConfigError that lists the names where there is none of this name.
Scene make_scene(const std::string& name);

}  // namespace felt
