#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace felt {

/// A camera-to-world pose (OpenCV axes, metres) written as numbers separated by spaces or commas: 16 or 12 of a matrix,
/// row-major, or tx ty tz qx qy qz qw; a stamp or frame number may come first. Throws FormatError naming `where` for
/// anything else, a matrix that is not rigid and a quaternion that is not of length 1 (within 1 %).
Eigen::Isometry3d parse_pose(std::string_view numbers, const std::string& where);

/// One pose a line; empty lines and lines that start with # are skipped. Throws IoError or FormatError (path:line).
std::vector<Eigen::Isometry3d> read_poses(const std::filesystem::path& path);

}  // namespace felt
