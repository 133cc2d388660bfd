#pragma once

#include <CLI/CLI.hpp>
#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "core/camera.h"
#include "io/sequence/sequence_options.h"

namespace felt::apps {

/// The camera as given on the command line.
struct CameraOptions {
  std::string intrinsics = "525,525,319.5,239.5";  ///< fx,fy,cx,cy in pixels
  std::string size = "640x480";                    ///< pixels
};

/// Adds --intrinsics and --size.
void add_camera_options(CLI::App& command, CameraOptions& options);

/// Throws CLI::ValidationError naming every option that cannot be read.
PinholeCamera camera_of(const CameraOptions& options);

/// Where a surface is looked at from, and with which camera.
struct Viewpoints {
  PinholeCamera camera;
  std::vector<Eigen::Isometry3d> T_world_camera;
  std::vector<int64_t> frames;  ///< of a sequence: their numbers (`Frame::index`)
};

/// Of a recorded sequence: its camera and the poses of its readable frames, both as `reading` has them; a warning
/// counts the others. Of a file with one pose a line: those, and the camera of `options`.
Viewpoints read_viewpoints(const std::string& trajectory, const CameraOptions& options, const SequenceOptions& reading);

}  // namespace felt::apps
