#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <vector>

namespace felt {

/// Points from text: one `x,y,z` a line, or a header line that names the columns `x`, `y`, `z` among others, which are
/// passed over; empty lines and lines that start with '#' are skipped. Throws IoError, and FormatError with the first
/// problem, its line, and how many more.
std::vector<Eigen::Vector3d> read_points(const std::filesystem::path& file);

}  // namespace felt
