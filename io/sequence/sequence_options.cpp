#include "io/sequence/sequence_options.h"

#include <cmath>
#include <vector>

#include "core/error.h"
#include "io/files/text_input.h"

namespace felt {

PoseConvention parse_pose_convention(const std::string& text, const std::string& where) {
  PoseConvention convention;
  const std::vector<std::string_view> words = split_words(text, ',');
  for (const std::string_view word : words) {
    if (word == "world-to-camera" || word == "w2c")
      convention.world_to_camera = true;
    else if (word == "opengl")
      convention.opengl_axes = true;
    else if (word != "camera-to-world" && word != "c2w" && word != "opencv")
      throw ConfigError(describe_mismatch(
          where, "pose convention", "camera-to-world or world-to-camera, and opencv or opengl, with a comma between",
          "'" + text + "'"));
  }
  if (words.empty())
    throw ConfigError(describe_mismatch(where, "pose convention", "camera-to-world or world-to-camera", "nothing"));
  return convention;
}

std::string to_string(const PoseConvention& convention) {
  return std::string(convention.world_to_camera ? "world-to-camera" : "camera-to-world") +
         (convention.opengl_axes ? ",opengl" : ",opencv");
}

DepthEncoding parse_depth_encoding(const std::string& text, const std::string& where) {
  if (text == "plain") return DepthEncoding::plain;
  if (text == "rotated3") return DepthEncoding::rotated3;
  throw ConfigError(describe_mismatch(where, "depth encoding", "plain or rotated3", "'" + text + "'"));
}

Intrinsics parse_intrinsics(const std::string& text, const std::string& where) {
  std::vector<double> numbers;
  for (const std::string_view word : split_words(text, ','))
    if (const auto number = parse_number(word); number && std::isfinite(*number)) numbers.push_back(*number);
  if (numbers.size() != 4 || split_words(text, ',').size() != 4 || numbers[0] <= 0 || numbers[1] <= 0)
    throw ConfigError(
        describe_mismatch(where, "intrinsics", "fx,fy,cx,cy in pixels with fx, fy > 0", "'" + text + "'"));
  return {numbers[0], numbers[1], numbers[2], numbers[3]};
}

}  // namespace felt
