#include "io/simulation/render_sequence.h"

namespace felt {

PinholeCamera simulated_camera(int width, int height) {
  return resized({525, 525, 319.5, 239.5, 640, 480}, width, height);
}

Frame render_frame(const Scene& scene, const PinholeCamera& camera, const Eigen::Isometry3d& T_world_camera,
                   int64_t index, const RenderOptions& options) {
  SceneView view = render_view(scene, camera, T_world_camera, options.with_color);
  Frame frame;
  frame.index = index;
  frame.stamp_s = double(index) / 30;
  frame.camera = camera;
  frame.T_world_camera = T_world_camera;
  frame.depth_m = options.noise ? add_depth_noise(view, camera, *options.noise, options.seed, index) : view.depth_m;
  frame.color = std::move(view.color);
  frame.labels = std::move(options.label_set == LabelSet::semantic ? view.semantics : view.materials);
  frame.instances = std::move(view.instances);
  return frame;
}

std::vector<Frame> render_sequence(const Scene& scene, const Trajectory& trajectory, const PinholeCamera& camera,
                                   const RenderOptions& options) {
  std::vector<Frame> frames;
  frames.reserve(trajectory.size());
  for (size_t i = 0; i < trajectory.size(); ++i)
    frames.push_back(render_frame(scene, camera, trajectory[i], int64_t(i), options));
  return frames;
}

}  // namespace felt
