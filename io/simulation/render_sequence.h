#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/frame.h"
#include "io/simulation/depth_noise.h"
#include "io/simulation/trajectory.h"

namespace felt {

/// Which of a scene's two label sets a frame's labels are.
enum class LabelSet : uint8_t { semantic, material };

/// 640x480, fx = fy = 525, cx = 319.5, cy = 239.5: the usual RGB-D camera; or the same field of view at another size.
PinholeCamera simulated_camera(int width = 640, int height = 480);

struct RenderOptions {
  std::optional<DepthNoise> noise;  ///< none: exact depth
  LabelSet label_set = LabelSet::semantic;
  bool with_color = true;
  uint64_t seed = 1;
};

/// Frame number `index` of a simulated sequence: true labels and instances; stamps at 30 Hz.
Frame render_frame(const Scene& scene, const PinholeCamera& camera, const Eigen::Isometry3d& T_world_camera,
                   int64_t index, const RenderOptions& options = {});

/// A whole sequence in memory, frames in the trajectory's order.
std::vector<Frame> render_sequence(const Scene& scene, const Trajectory& trajectory, const PinholeCamera& camera,
                                   const RenderOptions& options = {});

}  // namespace felt
