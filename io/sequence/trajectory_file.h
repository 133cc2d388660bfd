#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <optional>
#include <string_view>
#include <vector>

namespace felt {

/// One line of a trajectory file: the matrix as recorded, not yet checked for being a pose.
struct StampedPose {
  double stamp_s = 0;  ///< or a frame number
  Eigen::Matrix4d matrix;
  int64_t line = 0;  ///< of the file, from 1
};

/// Pose between `a` (share 0) and `b` (share 1): translation linear, rotation along the shortest arc at constant speed.
/// Shares outside [0, 1] extrapolate.
Eigen::Isometry3d interpolated_pose(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b, double share);

/// Matrix of sixteen or twelve (last row left out) numbers, row-major.
Eigen::Matrix4d matrix_of_numbers(const double* numbers, size_t count);

/// Matrix of a translation and a quaternion x y z w. A quaternion whose length is farther than 1 % from 1 gives a
/// matrix of NaN (the frame's pose counts as not finite); others are normalised.
Eigen::Matrix4d matrix_of_translation_quaternion(const double* t_q);

/// Reads one pose a line: stamp or frame number, then 16 numbers, 12 numbers, or tx ty tz qx qy qz qw.
/// `numbered` false: without the first column; the stamp is then the position from 0.
/// Throws IoError or FormatError (path:line).
std::vector<StampedPose> read_trajectory(const std::filesystem::path& path, bool numbered);

/// The 4x4 matrix of a file with 16 (or 12) numbers. Throws IoError or FormatError.
Eigen::Matrix4d read_pose_file(const std::filesystem::path& path);

/// Position of the stamp nearest to `stamp_s` in ascending `stamps`, -1 where none is within `max_dt_s`.
int64_t nearest_stamp(const std::vector<double>& stamps, double stamp_s, double max_dt_s);

/// Pose at a stamp: between the two neighbours where both are within `max_dt_s` (translation linear, rotation along the
/// shortest arc), else the nearest one within `max_dt_s`, as recorded. `stamps`: those of `poses`, ascending.
std::optional<Eigen::Matrix4d> pose_at_stamp(const std::vector<StampedPose>& poses, const std::vector<double>& stamps,
                                             double stamp_s, double max_dt_s);

/// True for every position to leave out so that what remains ascends strictly, as few as possible.
std::vector<bool> out_of_order(const std::vector<double>& stamps);

}  // namespace felt
