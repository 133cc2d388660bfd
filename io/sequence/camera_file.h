#pragma once

#include <filesystem>
#include <optional>

#include "io/sequence/sequence_options.h"

namespace felt {

/// What a calibration file says; sizes and scale are 0 where it is silent.
/// Begins the camera file of a recording whose colour lies on the grid of depth, where its layout would not have it so.
inline constexpr const char* kRegisteredMark = "# colour lies on the grid of depth";

struct CameraFile {
  Intrinsics intrinsics;
  int width = 0, height = 0;  ///< pixels
  double depth_scale = 0;     ///< stored depth units per metre
};

/// Reads a calibration: text with a 3x3 or 4x4 matrix (7-Scenes, ScanNet) or "fx fy cx cy"; JSON or YAML with fx, fy,
/// cx, cy and optionally w/width, h/height, scale/depth_scale, at the top or below `camera` (Replica), or with Open3D's
/// column-major `intrinsic_matrix`. Lines beginning with '#' are comments.
/// Throws IoError where it cannot be read, FormatError where it is no pinhole camera.
CameraFile read_camera_file(const std::filesystem::path& path);

/// Nine (3x3), sixteen (4x4) or four numbers, row-major, as intrinsics. Throws FormatError naming `where`.
Intrinsics intrinsics_of_numbers(const std::vector<double>& numbers, const std::string& where);

/// What to do about a negative fy, as the original ICL-NUIM has it, in brackets with a space before; empty for others.
std::string negative_focal_hint(double fy);

/// Throws FormatError where no lens of an RGB-D sensor gives such a camera: a principal point outside the image, or an
/// angle of view across the image below 5 or above 170 degrees. Catches calibrations of another camera or image size.
/// `lacking_file`: of a sequence's listing, for the remedy.
void check_camera_fits_image(const PinholeCamera& camera, const std::string& where,
                             const std::string& lacking_file = "");

}  // namespace felt
