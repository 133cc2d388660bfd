#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "core/camera.h"

namespace felt::apps {

/// The camera as given on the command line.
struct CameraOptions {
  std::string intrinsics = "525,525,319.5,239.5";  ///< fx,fy,cx,cy in pixels
  std::string size = "640x480";                    ///< pixels
};

/// Adds --intrinsics and --size.
void add_camera_options(CLI::App& command, CameraOptions& options);

/// Throws ConfigError naming every option that cannot be used.
PinholeCamera camera_of(const CameraOptions& options);

}  // namespace felt::apps
