#include "io/sequence/trajectory_file.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "core/pose.h"
#include "io/files/text_input.h"

namespace felt {
namespace fs = std::filesystem;

Eigen::Isometry3d interpolated_pose(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b, double share) {
  const Eigen::AngleAxisd turn(Eigen::Quaterniond(a.linear().transpose() * b.linear()).normalized());
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = a.linear() * Eigen::AngleAxisd(share * turn.angle(), turn.axis()).toRotationMatrix();
  T.translation() = a.translation() + share * (b.translation() - a.translation());
  return T;
}

Eigen::Matrix4d matrix_of_numbers(const double* numbers, size_t count) {
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  for (size_t i = 0; i < count; ++i) matrix(i / 4, i % 4) = numbers[i];
  return matrix;
}

Eigen::Matrix4d matrix_of_translation_quaternion(const double* n) {
  const Eigen::Quaterniond q(n[6], n[3], n[4], n[5]);
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  matrix.topRightCorner<3, 1>() = Eigen::Vector3d(n[0], n[1], n[2]);
  if (std::abs(q.norm() - 1) < 0.01)
    matrix.topLeftCorner<3, 3>() = q.normalized().toRotationMatrix();
  else
    matrix.setConstant(std::numeric_limits<double>::quiet_NaN());
  return matrix;
}

std::vector<StampedPose> read_trajectory(const fs::path& path, bool numbered) {
  const std::string content = read_whole_file(path);
  std::vector<StampedPose> poses;
  LineReader lines(content, path);
  while (lines.next()) {
    const std::vector<double> numbers = parse_numbers(lines.line(), lines.where());
    const size_t first = numbered ? 1 : 0, count = numbers.size() - first;
    if (numbers.size() < 7 || (count != 16 && count != 12 && count != 7))
      throw FormatError(describe_mismatch(lines.where(), "pose",
                                          std::string(numbered ? "a stamp or frame number and " : "") +
                                              "16 numbers, 12 numbers or tx ty tz qx qy qz qw",
                                          std::to_string(numbers.size()) + " numbers"));
    StampedPose pose;
    pose.stamp_s = numbered ? numbers[0] : double(poses.size());
    pose.matrix =
        count == 7 ? matrix_of_translation_quaternion(&numbers[first]) : matrix_of_numbers(&numbers[first], count);
    pose.line = lines.number();
    poses.push_back(pose);
  }
  return poses;
}

Eigen::Matrix4d read_pose_file(const fs::path& path) {
  const std::string content = read_whole_file(path, 1 << 16);
  std::vector<double> numbers;
  LineReader lines(content, path);
  while (lines.next() && numbers.size() <= 16) {
    const std::vector<double> row = parse_numbers(lines.line(), lines.where());
    numbers.insert(numbers.end(), row.begin(), row.end());
  }
  if (numbers.size() != 16 && numbers.size() != 12)
    throw FormatError(describe_mismatch(path.string(), "pose", "16 numbers", std::to_string(numbers.size())));
  return matrix_of_numbers(numbers.data(), numbers.size());
}

int64_t nearest_stamp(const std::vector<double>& stamps, double stamp_s, double max_dt_s) {
  const auto after = std::lower_bound(stamps.begin(), stamps.end(), stamp_s);
  auto best = after;
  if (after != stamps.begin() && (after == stamps.end() || stamp_s - *(after - 1) <= *after - stamp_s)) --best;
  if (best == stamps.end() || std::abs(*best - stamp_s) > max_dt_s) return -1;
  return best - stamps.begin();
}

std::optional<Eigen::Matrix4d> pose_at_stamp(const std::vector<StampedPose>& poses, const std::vector<double>& stamps,
                                             double stamp_s, double max_dt_s) {
  const int64_t nearest = nearest_stamp(stamps, stamp_s, max_dt_s);
  if (nearest < 0) return std::nullopt;
  const auto n = size_t(nearest);
  const size_t before = stamps[n] <= stamp_s ? n : n - 1, after = before + 1;
  const bool outside = (n == 0 && stamps[n] > stamp_s) || after >= stamps.size();
  if (outside || stamps[n] == stamp_s || stamp_s - stamps[before] > max_dt_s || stamps[after] - stamp_s > max_dt_s ||
      stamps[after] <= stamps[before])
    return poses[n].matrix;
  Eigen::Isometry3d a, b;
  if (rigid_pose(poses[before].matrix, a) != PoseFault::none || rigid_pose(poses[after].matrix, b) != PoseFault::none)
    return poses[n].matrix;
  return interpolated_pose(a, b, (stamp_s - stamps[before]) / (stamps[after] - stamps[before])).matrix();
}

std::vector<bool> out_of_order(const std::vector<double>& stamps) {
  // Longest strictly increasing subsequence: `tails[n]` ends the best run of n + 1 stamps so far.
  std::vector<int64_t> tails, previous(stamps.size(), -1);
  for (size_t i = 0; i < stamps.size(); ++i) {
    if (std::isnan(stamps[i])) continue;
    const auto place = std::lower_bound(tails.begin(), tails.end(), stamps[i],
                                        [&](int64_t tail, double stamp) { return stamps[tail] < stamp; });
    if (place != tails.begin()) previous[i] = *(place - 1);
    if (place == tails.end())
      tails.push_back(int64_t(i));
    else
      *place = int64_t(i);
  }
  std::vector<bool> out(stamps.size(), true);
  for (int64_t i = tails.empty() ? -1 : tails.back(); i >= 0; i = previous[i]) out[i] = false;
  return out;
}

}  // namespace felt
