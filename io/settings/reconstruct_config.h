#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "io/sequence/sequence_options.h"
#include "io/settings/label_settings.h"
#include "io/settings/perception_settings.h"
#include "mapping/fusion/integration_config.h"

namespace felt {

/// Names on the command line and in configuration files.
extern const std::map<std::string, DistanceModel> kDistanceNames;
extern const std::map<std::string, WeightModel> kWeightNames;

/// A reconstruct configuration file: what it sets, checked one by one; what it leaves out is empty. Paths are absolute
/// or relative to the working directory (in the file they are relative to the file).
struct ReconstructConfig {
  std::filesystem::path labels, probs, classes, properties, touches;
  std::optional<std::string> format;
  std::optional<FrameSelection> frames;
  std::optional<Intrinsics> intrinsics;
  std::optional<double> depth_scale;
  std::optional<DepthEncoding> depth_encoding;
  std::optional<bool> ray_length;
  std::optional<PoseConvention> pose_convention;
  std::optional<Distortion> distortion;
  std::optional<Eigen::Isometry3d> T_body_camera;
  std::optional<double> max_dt_s, stamp_offset;
  std::optional<int> label_offset;
  std::optional<bool> bgr;
  std::optional<bool> color;
  std::optional<double> voxel_size_m;
  std::optional<std::string> truncation;  ///< "0.08" (metres) or "4vox"
  std::optional<double> min_depth_m, max_depth_m, max_weight, dropoff_start_vox, color_band_vox;
  std::optional<DistanceModel> distance;
  std::optional<WeightModel> weight;
  std::optional<bool> carve;
  LabelSettings label_settings;
  PerceptionSettings perception;
  std::optional<int> checkpoint_every;  ///< frames; 0: only at the end
  std::optional<int> threads;
};

/// Reads a YAML file of keys as on the command line, with '_' or '-' between words (`voxel_size: 0.02`).
/// Throws IoError where it cannot be read, and ConfigError with every problem at once, each with path:line and key;
/// an unknown key is refused with the nearest known one suggested.
ReconstructConfig read_reconstruct_config(const std::filesystem::path& path);

/// Metres of a truncation written as metres ("0.08") or voxels ("4vox"). Throws ConfigError naming `where`.
double parse_truncation(const std::string& text, double voxel_size_m, const std::string& where);

}  // namespace felt
