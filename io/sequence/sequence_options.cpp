#include "io/sequence/sequence_options.h"

#include <fmt/format.h>

#include <cmath>
#include <vector>

#include "core/error.h"
#include "io/files/text_input.h"
#include "io/sequence/camera_file.h"

namespace felt {

PoseConvention parse_pose_convention(const std::string& text, const std::string& where) {
  std::optional<bool> world_to_camera, opengl_axes;
  const std::vector<std::string_view> words = split_words(text, ',');
  bool valid = !words.empty();
  const auto say = [&valid](std::optional<bool>& choice, bool value) {
    valid &= choice.value_or(value) == value;  // both of two that exclude each other are neither
    choice = value;
  };
  for (const std::string_view word : words) {
    if (word == "world-to-camera" || word == "w2c")
      say(world_to_camera, true);
    else if (word == "camera-to-world" || word == "c2w")
      say(world_to_camera, false);
    else if (word == "opengl")
      say(opengl_axes, true);
    else if (word == "opencv")
      say(opengl_axes, false);
    else
      valid = false;
  }
  if (!valid)
    throw ConfigError(
        describe_mismatch(where, "pose convention",
                          "camera-to-world (c2w) or world-to-camera (w2c), and opencv or opengl, with a comma between",
                          words.empty() ? "nothing" : "'" + text + "'"));
  return {.world_to_camera = world_to_camera.value_or(false), .opengl_axes = opengl_axes.value_or(false)};
}

std::string to_string(const PoseConvention& convention) {
  return std::string(convention.world_to_camera ? "world-to-camera" : "camera-to-world") +
         (convention.opengl_axes ? ",opengl" : ",opencv");
}

DepthEncoding parse_depth_encoding(const std::string& text, const std::string& where) {
  for (const DepthEncoding encoding : {DepthEncoding::plain, DepthEncoding::rotated3})
    if (text == to_string(encoding)) return encoding;
  throw ConfigError(describe_mismatch(where, "depth encoding", "plain or rotated3", "'" + text + "'"));
}

std::string to_string(DepthEncoding encoding) { return encoding == DepthEncoding::rotated3 ? "rotated3" : "plain"; }

std::string to_string(const Intrinsics& k) { return fmt::format("{:g}, {:g}, {:g}, {:g}", k.fx, k.fy, k.cx, k.cy); }

Intrinsics parse_intrinsics(const std::string& text, const std::string& where) {
  std::vector<double> numbers;
  for (const std::string_view word : split_words(text, ','))
    if (const auto number = parse_number(word); number && std::isfinite(*number)) numbers.push_back(*number);
  if (numbers.size() != 4 || split_words(text, ',').size() != 4 || numbers[0] <= 0 || numbers[1] <= 0)
    throw ConfigError(
        describe_mismatch(where, "intrinsics", "fx,fy,cx,cy in pixels with fx, fy > 0",
                          "'" + text + "'" + (numbers.size() == 4 ? negative_focal_hint(numbers[1]) : "")));
  return {numbers[0], numbers[1], numbers[2], numbers[3]};
}

}  // namespace felt
