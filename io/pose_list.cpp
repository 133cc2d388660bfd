#include "io/pose_list.h"

#include <charconv>
#include <cmath>
#include <fstream>

#include "core/error.h"
#include "core/pose.h"

namespace felt {
namespace {

std::vector<double> parse_numbers(std::string_view text, const std::string& where) {
  std::vector<double> numbers;
  constexpr const char* kSeparators = " \t\r,";
  for (size_t at = text.find_first_not_of(kSeparators); at != std::string_view::npos;) {
    const size_t end = std::min(text.find_first_of(kSeparators, at), text.size());
    std::string_view word = text.substr(at, end - at);
    if (word.front() == '+') word.remove_prefix(1);
    double value = 0;
    const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc() || stop != word.data() + word.size())
      throw FormatError(describe_mismatch(where, "pose", "numbers", std::string(word.substr(0, 40))));
    numbers.push_back(value);
    at = text.find_first_not_of(kSeparators, end);
  }
  return numbers;
}

}  // namespace

Eigen::Isometry3d parse_pose(std::string_view text, const std::string& where) {
  const std::vector<double> all = parse_numbers(text, where);
  const bool stamped = all.size() == 8 || all.size() == 13 || all.size() == 17;
  const size_t count = all.size() - (stamped ? 1 : 0);
  const double* n = all.data() + (stamped ? 1 : 0);
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  if (count == 7) {
    const Eigen::Quaterniond q(n[6], n[3], n[4], n[5]);
    if (!(std::abs(q.norm() - 1) < 0.01))
      throw FormatError(describe_mismatch(where, "quaternion", "length 1", std::to_string(q.norm())));
    matrix.topLeftCorner<3, 3>() = q.normalized().toRotationMatrix();
    matrix.topRightCorner<3, 1>() << n[0], n[1], n[2];
  } else if (count == 12 || count == 16) {
    for (size_t i = 0; i < count; ++i) matrix(Eigen::Index(i / 4), Eigen::Index(i % 4)) = n[i];
  } else {
    throw FormatError(describe_mismatch(where, "pose", "16, 12 or 7 numbers, with or without a stamp before them",
                                        std::to_string(all.size())));
  }
  Eigen::Isometry3d T;
  const PoseFault fault = rigid_pose(matrix, T);
  if (fault != PoseFault::none)
    throw FormatError(
        describe_mismatch(where, "pose", "a rigid transform",
                          fault == PoseFault::not_finite ? "numbers that are not finite" : "another matrix"));
  return T;
}

std::vector<Eigen::Isometry3d> read_poses(const std::filesystem::path& path) {
  std::ifstream in(path);
  if (!in) throw IoError(path.string() + ": cannot open");
  std::vector<Eigen::Isometry3d> poses;
  int number = 0;
  for (std::string line; std::getline(in, line);) {
    ++number;
    const size_t start = line.find_first_not_of(" \t\r");
    if (start == std::string::npos || line[start] == '#') continue;
    poses.push_back(parse_pose(line, path.string() + ":" + std::to_string(number)));
  }
  if (poses.empty()) throw FormatError(describe_mismatch(path.string(), "trajectory", "poses", "none"));
  return poses;
}

}  // namespace felt
