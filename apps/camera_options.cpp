#include "apps/camera_options.h"

#include <cmath>
#include <cstdio>
#include <vector>

#include "core/error.h"

namespace felt::apps {

void add_camera_options(CLI::App& command, CameraOptions& options) {
  command.add_option("--intrinsics", options.intrinsics, "fx,fy,cx,cy in pixels")->capture_default_str();
  command.add_option("--size", options.size, "Width x height in pixels")->capture_default_str();
}

PinholeCamera camera_of(const CameraOptions& options) {
  PinholeCamera camera;
  std::vector<std::string> problems;
  int used = 0;
  const int fields = std::sscanf(options.intrinsics.c_str(), "%lf,%lf,%lf,%lf%n", &camera.fx, &camera.fy, &camera.cx,
                                 &camera.cy, &used);
  const bool finite = std::isfinite(camera.fx + camera.fy + camera.cx + camera.cy);
  if (fields != 4 || size_t(used) != options.intrinsics.size() || !finite || !(camera.fx > 0 && camera.fy > 0))
    problems.push_back(
        describe_mismatch("--intrinsics", "camera", "fx,fy,cx,cy with positive fx and fy", options.intrinsics));
  const int sizes = std::sscanf(options.size.c_str(), "%dx%d%n", &camera.width, &camera.height, &used);
  constexpr int kLargest = 16384;
  if (sizes != 2 || size_t(used) != options.size.size() || camera.width < 1 || camera.height < 1 ||
      camera.width > kLargest || camera.height > kLargest)
    problems.push_back(
        describe_mismatch("--size", "image", "width x height from 1 to 16384, for example 640x480", options.size));
  if (!problems.empty()) throw ConfigError(problems);
  return camera;
}

}  // namespace felt::apps
