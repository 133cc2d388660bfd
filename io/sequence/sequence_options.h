#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "core/camera.h"
#include "core/frame_selection.h"
#include "io/sequence/undistortion.h"

namespace felt {

/// What recorded 4x4 matrices mean. Ours is camera-to-world with OpenCV axes (x right, y down, z forward).
struct PoseConvention {
  bool world_to_camera = false;
  bool opengl_axes = false;  ///< camera x right, y up, z backward
  bool operator==(const PoseConvention&) const = default;
};

/// Reads one or two of "camera-to-world" ("c2w"), "world-to-camera" ("w2c"), "opencv", "opengl", separated by commas.
/// Throws ConfigError.
PoseConvention parse_pose_convention(const std::string& text, const std::string& where);
std::string to_string(const PoseConvention& convention);

/// How the 16 bits of a depth pixel hold its value.
enum class DepthEncoding {
  plain,
  rotated3,  ///< rotated left by three bits, as in the Amazon Picking Challenge and SUN RGB-D
};

/// Reads "plain" or "rotated3". Throws ConfigError.
DepthEncoding parse_depth_encoding(const std::string& text, const std::string& where);
std::string to_string(DepthEncoding encoding);

/// fx, fy, cx, cy in pixels, without an image size.
struct Intrinsics {
  double fx = 0, fy = 0, cx = 0, cy = 0;
};

/// "fx, fy, cx, cy"
std::string to_string(const Intrinsics& intrinsics);

/// Reads "fx,fy,cx,cy". Throws ConfigError where a number is missing, not finite or a focal length is not positive.
Intrinsics parse_intrinsics(const std::string& text, const std::string& where);

/// What the user says about a sequence; everything left out is found in it or is the layout's default.
struct SequenceOptions {
  std::string format{};                    ///< layout name; empty: detected
  FrameSelection frames{};                 ///< positions in recorded order
  std::filesystem::path labels_dir{};      ///< label images, stems are frame numbers
  std::filesystem::path probs_dir{};       ///< probability maps
  std::filesystem::path instances_dir{};   ///< instance images, or folders of masks
  std::filesystem::path classes_file{};    ///< classes.yaml
  std::optional<Intrinsics> intrinsics{};  ///< of the depth image
  std::optional<double> depth_scale{};     ///< stored depth units per metre
  std::optional<DepthEncoding> depth_encoding{};
  std::optional<bool> depth_is_ray_length{};  ///< depth along the pixel's ray instead of along the optical axis
  std::optional<PoseConvention> pose_convention{};
  std::optional<Distortion> distortion{};            ///< of the depth image's lens, and of colour on its grid
  std::optional<Eigen::Isometry3d> T_body_camera{};  ///< where recorded poses are those of a body
  double max_dt_s = 0.02;                            ///< largest difference of stamps within one frame
  double pose_stamp_offset = 0;  ///< added to the stamps of poses: seconds, or frame numbers where there are no times
  int label_offset = 0;          ///< added to every label id; ids that leave 16 bits become kNoLabel
  bool bgr = false;              ///< colour images hold red and blue exchanged
  bool read_color = true;        ///< false: colour is not decoded, and frames without it are whole
  bool read_instances = true;    ///< false: instance images are not decoded
};

}  // namespace felt
