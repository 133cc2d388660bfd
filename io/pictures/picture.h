#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <span>

#include "core/class_table.h"
#include "core/image.h"
#include "core/mesh.h"

namespace felt {

/// Writes an 8-bit PNG, RGB or, where a pixel is transparent, RGBA, whole or not at all; throws IoError.
void write_png(const std::filesystem::path& path, const ColorImage& image);
/// Writes a 16-bit grey PNG: depth in steps of `metres_per_step`, 0 where there is none or it does not fit. Returns the
/// number of pixels that do not fit.
int64_t write_depth_png(const std::filesystem::path& path, const DepthImage& depth_m, double metres_per_step = 0.001);

/// Writes a 16-bit grey PNG of class ids.
void write_label_png(const std::filesystem::path& path, const LabelImage& labels);

/// Writes a 16-bit grey PNG: 0 where the value is not finite, else 1 at `low` to 65535 at `high`, linear, cut at both.
void write_level_png(const std::filesystem::path& path, const Image<float>& values, double low, double high);

/// Values in colour, dark blue at `low` over green to yellow at `high`; white where not finite.
ColorImage colored(const Image<float>& values, double low, double high);
/// Class ids in the colours of the table; white where there is none.
ColorImage colored(const LabelImage& labels, const ClassTable& classes);
/// Unit normals as red, green, blue; white where zero.
ColorImage colored(const Image<Eigen::Vector3f>& normals);

/// A picture of a whole mesh without a display: two views from above at an angle and one straight down, each in
/// colour (where the mesh has any), as grey clay, and by normal; walls towards the viewer are left out.
ColorImage overview_picture(const TriangleMesh& mesh, const Eigen::Vector3d& up, int panel_width = 640,
                            int panel_height = 480);

}  // namespace felt
