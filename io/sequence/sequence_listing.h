#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

#include "core/class_table.h"
#include "io/sequence/sequence_options.h"

namespace felt {

/// Where one image lies: a whole file, or `bytes` at `offset` of a container.
struct ImageSource {
  enum class Codec { image_file, zlib_u16, raw_u16, scan };
  std::filesystem::path path;
  uint64_t offset = 0;
  uint64_t bytes = 0;  ///< 0: the whole file
  Codec codec = Codec::image_file;
  int face = 0;  ///< of a scan (io/sequence/lidar_scan.h)
  bool empty() const { return path.empty(); }
};

/// Bytes that an image takes where it lies; 0 where there is no such image.
inline uint64_t stored_bytes(const ImageSource& source) {
  if (source.empty() || source.bytes > 0) return source.bytes;
  std::error_code fault;
  const uintmax_t bytes = std::filesystem::file_size(source.path, fault);
  return fault ? 0 : bytes;
}

/// A probability image of one class, or one detection of it: values times `score`.
struct ClassMap {
  uint16_t class_id = 0;
  ImageSource image;
  float score = 1;
  bool from_network = false;  ///< `class_id` is a network's number, as label images hold: --label-offset moves it
};

/// One frame as the layout found it: names and a pose, nothing decoded.
struct FrameRecord {
  int64_t index = 0;   ///< frame number
  double stamp_s = 0;  ///< or the index where none is recorded
  ImageSource depth, color, labels, instances;
  ImageSource probabilities;  ///< stacked top-m image, or confidence of the labels (io/sequence/probability_images.h)
  std::vector<ClassMap> class_maps;     ///< probability images of single classes; class 0: the rest
  std::vector<ImageSource> masks;       ///< one thing each, instead of `instances`
  std::optional<Eigen::Matrix4d> pose;  ///< as recorded; absent: read from `pose_file`
  std::filesystem::path pose_file;      ///< empty and no `pose`: the frame has none
  std::string fault, fault_detail;      ///< why the layout already knows that it cannot be used
};

/// A sequence as plain data: what every layout produces and one reader decodes.
struct SequenceListing {
  std::string layout;
  std::vector<FrameRecord> frames;       ///< in recorded order
  std::optional<Intrinsics> intrinsics;  ///< of the depth images
  std::string lacking_camera_file;       ///< without it `intrinsics` are the layout's default; empty: they are not
  int width = 0, height = 0;             ///< of the depth images; 0: from the first one that can be read
  std::optional<Intrinsics> color_intrinsics;  ///< where colour is not on the depth images' grid
  int color_width = 0, color_height = 0;       ///< of that camera's images; 0: not stated
  Distortion distortion, color_distortion;     ///< of each camera's lens
  Eigen::Matrix4d T_color_depth = Eigen::Matrix4d::Identity();
  double depth_scale = 1000;
  bool depth_scale_stated = false;  ///< by the sequence; else floating-point depth counts metres
  DepthEncoding depth_encoding = DepthEncoding::plain;
  bool depth_is_ray_length = false;
  PoseConvention pose_convention;
  Eigen::Isometry3d T_body_camera = Eigen::Isometry3d::Identity();  ///< where poses are those of a body
  ClassTable classes;
  bool stamped = false;  ///< frames carry times in seconds; otherwise `stamp_s` is the frame number
  std::filesystem::path properties_file, touches_file;  ///< empty: the sequence carries none
  double voxel_size_m = 0, max_depth_m = 0;  ///< what suits the sensor, where the user says nothing; 0: the defaults
  std::vector<std::string> notes;
};

}  // namespace felt
