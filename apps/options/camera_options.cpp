#include "apps/options/camera_options.h"

#include <spdlog/spdlog.h>

#include <cmath>
#include <cstdio>
#include <map>
#include <string>
#include <variant>

#include "apps/options/problems.h"
#include "apps/options/reading_options.h"
#include "io/sequence/open_sequence.h"
#include "io/sequence/pose_list.h"
#include "io/sequence/skip_reasons.h"

namespace felt::apps {

void add_camera_options(CLI::App& command, CameraOptions& options) {
  command.add_option("--intrinsics", options.intrinsics, "fx,fy,cx,cy in pixels")->capture_default_str();
  command.add_option("--size", options.size, "Width x height in pixels")->capture_default_str();
}

PinholeCamera camera_of(const CameraOptions& options) {
  PinholeCamera camera;
  Problems problems;
  int used = 0;
  const int fields = std::sscanf(options.intrinsics.c_str(), "%lf,%lf,%lf,%lf%n", &camera.fx, &camera.fy, &camera.cx,
                                 &camera.cy, &used);
  const bool finite = std::isfinite(camera.fx + camera.fy + camera.cx + camera.cy);
  if (fields != 4 || size_t(used) != options.intrinsics.size() || !finite || !(camera.fx > 0 && camera.fy > 0))
    problems.add_of_usage(
        describe_mismatch("--intrinsics", "camera", "fx,fy,cx,cy with positive fx and fy", options.intrinsics));
  const int sizes = std::sscanf(options.size.c_str(), "%dx%d%n", &camera.width, &camera.height, &used);
  constexpr int kLargest = 16384;
  if (sizes != 2 || size_t(used) != options.size.size() || camera.width < 1 || camera.height < 1 ||
      camera.width > kLargest || camera.height > kLargest)
    problems.add_of_usage(
        describe_mismatch("--size", "image", "width x height from 1 to 16384, for example 640x480", options.size));
  problems.throw_if_any();
  return camera;
}

Viewpoints read_viewpoints(const std::string& trajectory, const CameraOptions& options,
                           const SequenceOptions& reading) {
  if (!names_sequence(trajectory)) return {camera_of(options), read_poses(trajectory), {}};
  const auto sequence = open_sequence(trajectory, reading);
  Viewpoints views{sequence->info().camera, {}, {}};
  std::map<std::string, int64_t> skipped;
  for (int64_t i = 0; i < sequence->size(); ++i) {
    const ReadResult result = sequence->read(i);
    if (const auto* frame = std::get_if<Frame>(&result))
      views.T_world_camera.push_back(frame->T_world_camera), views.frames.push_back(frame->index);
    else
      ++skipped[std::get<SkippedFrame>(result).reason];
  }
  if (!skipped.empty()) spdlog::warn("{}: frames that are no views: {}", trajectory, skipped_text(skipped));
  return views;
}

}  // namespace felt::apps
