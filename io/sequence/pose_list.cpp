#include "io/sequence/pose_list.h"

#include "core/error.h"
#include "core/pose.h"
#include "io/files/text_input.h"
#include "io/sequence/trajectory_file.h"

namespace felt {

Eigen::Isometry3d parse_pose(std::string_view text, const std::string& where) {
  std::vector<double> all;
  for (const std::string_view word : split_words(text, ',')) {
    const auto number = parse_number(word);
    if (!number) throw FormatError(describe_mismatch(where, "pose", "numbers", std::string(word.substr(0, 40))));
    all.push_back(*number);
  }
  const bool stamped = all.size() == 8 || all.size() == 13 || all.size() == 17;
  const size_t count = all.size() - (stamped ? 1 : 0);
  const double* const numbers = all.data() + (stamped ? 1 : 0);
  if (count != 7 && count != 12 && count != 16)
    throw FormatError(describe_mismatch(where, "pose", "16, 12 or 7 numbers, with or without a stamp before them",
                                        std::to_string(all.size())));
  if (count == 7)
    if (const double length = Eigen::Map<const Eigen::Vector4d>(numbers + 3).norm(); !(std::abs(length - 1) < 0.01))
      throw FormatError(describe_mismatch(where, "quaternion", "length 1", std::to_string(length)));
  Eigen::Isometry3d T;
  const PoseFault fault =
      rigid_pose(count == 7 ? matrix_of_translation_quaternion(numbers) : matrix_of_numbers(numbers, count), T);
  if (fault != PoseFault::none)
    throw FormatError(
        describe_mismatch(where, "pose", "a rigid transform",
                          fault == PoseFault::not_finite ? "numbers that are not finite" : "another matrix"));
  return T;
}

std::vector<Eigen::Isometry3d> read_poses(const std::filesystem::path& path) {
  const std::string content = read_whole_file(path);
  std::vector<Eigen::Isometry3d> poses;
  for (LineReader lines(content, path); lines.next();) poses.push_back(parse_pose(lines.line(), lines.where()));
  if (poses.empty()) throw FormatError(describe_mismatch(path.string(), "trajectory", "poses", "none"));
  return poses;
}

}  // namespace felt
