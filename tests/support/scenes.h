#pragma once

#include <string>
#include <vector>

#include "io/simulation/render_sequence.h"
#include "io/simulation/scene_library.h"

namespace felt::test {

/// Frames of a built-in scene along its standard path, 160x120 unless told otherwise: small enough for a unit test.
inline std::vector<Frame> simulated_frames(const std::string& scene, int frames, const RenderOptions& options = {},
                                           int width = 160, int height = 120) {
  const Scene world = make_scene(scene);
  return render_sequence(world, standard_trajectory(world, frames), simulated_camera(width, height), options);
}

}  // namespace felt::test
