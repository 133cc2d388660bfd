#include <yaml-cpp/yaml.h>

#include <cmath>
#include <set>

#include "core/error.h"
#include "core/pose.h"
#include "io/files/text_input.h"
#include "io/files/yaml_problems.h"
#include "io/sequence/camera_file.h"
#include "io/sequence/layouts.h"
#include "io/sequence/layouts/file_names.h"
#include "io/sequence/layouts/frame_files.h"
#include "io/sequence/skip_reasons.h"
#include "io/sequence/trajectory_file.h"
#include "io/tables/class_table_file.h"

namespace felt {
namespace fs = std::filesystem;
namespace {

bool recognises(const fs::path& path) { return fs::exists(path / "sequence.yaml"); }

/// Reads `sequence.yaml`, gathering every problem.
class Settings : public YamlProblems {
public:
  Settings(const YAML::Node& root, const fs::path& file) : YamlProblems(file.string()), root_(root) {}

  std::string text(const char* key, const std::string& otherwise) {
    const YAML::Node node = root_[key];
    if (!node) return otherwise;
    if (!node.IsScalar()) problem(node, key, "a text");
    return node.IsScalar() ? node.Scalar() : otherwise;
  }
  double positive(const YAML::Node& parent, const char* key, std::optional<double> otherwise) {
    const YAML::Node node = parent[key];
    if (!node && otherwise) return *otherwise;
    const auto number = node && node.IsScalar() ? parse_number(node.Scalar()) : std::nullopt;
    if (number && std::isfinite(*number) && *number > 0) return *number;
    problem(node, key, "a number above 0" + (number && key == std::string("fy") ? negative_focal_hint(*number) : ""));
    return 1;
  }
  /// A list of one of these lengths; empty where the key is absent or wrong.
  std::vector<double> numbers(const YAML::Node& parent, const char* key, const std::set<size_t>& lengths) {
    const YAML::Node node = parent[key];
    std::vector<double> list;
    if (!node) return list;
    for (const YAML::Node& item : node)
      if (const auto number = item.IsScalar() ? parse_number(item.Scalar()) : std::nullopt;
          number && std::isfinite(*number))
        list.push_back(*number);
    if (node.IsSequence() && list.size() == node.size() && lengths.contains(list.size())) return list;
    problem(node, key,
            "a list of " + std::to_string(*lengths.begin()) + " or " + std::to_string(*lengths.rbegin()) + " numbers");
    return {};
  }

private:
  const YAML::Node& root_;
};

void read_settings(const fs::path& file, SequenceListing& listing, std::map<std::string, std::string>& paths) {
  const YAML::Node root = YAML::Load(read_whole_file(file, 1 << 20));
  if (!root.IsMap())
    throw FormatError(describe_mismatch(file.string(), "content", "keys and values", "something else"));
  Settings settings(root, file);
  settings.refuse_unknown(
      root, {"camera", "color_camera", "depth_scale", "depth_encoding", "depth_is_ray_length", "pose_convention",
             "paths", "name", "comment", "T_body_camera", "T_color_depth", "voxel_size", "max_depth"});
  const auto distortion_of = [&](const YAML::Node& node) {
    const std::vector<double> numbers = settings.numbers(node, "distortion", {4, 5});
    if (numbers.empty()) return Distortion{};
    return Distortion{numbers[0], numbers[1], numbers[2], numbers[3], numbers.size() > 4 ? numbers[4] : 0};
  };
  const auto rigid = [&](const char* key) {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    const std::vector<double> numbers = settings.numbers(root, key, {12, 16});
    if (!numbers.empty() && rigid_pose(matrix_of_numbers(numbers.data(), numbers.size()), T) != PoseFault::none)
      settings.problem(root[key], key, "a rigid transform", "another matrix");
    return T;
  };
  const auto camera_of = [&](const YAML::Node& node, int& width, int& height) {
    settings.refuse_unknown(node, {"fx", "fy", "cx", "cy", "width", "height", "distortion"});
    width = int(std::min(settings.positive(node, "width", std::nullopt), 1e6));
    height = int(std::min(settings.positive(node, "height", std::nullopt), 1e6));
    return Intrinsics{settings.positive(node, "fx", std::nullopt), settings.positive(node, "fy", std::nullopt),
                      settings.positive(node, "cx", std::nullopt), settings.positive(node, "cy", std::nullopt)};
  };
  if (const YAML::Node camera = root["camera"]; camera && camera.IsMap())
    listing.intrinsics = camera_of(camera, listing.width, listing.height), listing.distortion = distortion_of(camera);
  else
    settings.problem(root, "camera", "{fx, fy, cx, cy, width, height}", "nothing");
  if (const YAML::Node camera = root["color_camera"]; camera && camera.IsMap()) {
    listing.color_intrinsics = camera_of(camera, listing.color_width, listing.color_height);
    listing.color_distortion = distortion_of(camera);
  } else if (camera) {
    settings.problem(camera, "color_camera", "{fx, fy, cx, cy, width, height}");
  }
  listing.T_body_camera = rigid("T_body_camera");
  listing.T_color_depth = rigid("T_color_depth").matrix();
  listing.depth_scale = settings.positive(root, "depth_scale", 1000);
  listing.depth_scale_stated = bool(root["depth_scale"]);
  listing.voxel_size_m = settings.positive(root, "voxel_size", 0);
  listing.max_depth_m = settings.positive(root, "max_depth", 0);
  if (const YAML::Node flag = root["depth_is_ray_length"];
      flag && !YAML::convert<bool>::decode(flag, listing.depth_is_ray_length))
    settings.problem(flag, "depth_is_ray_length", "true or false");
  try {
    listing.pose_convention = parse_pose_convention(settings.text("pose_convention", "camera-to-world"), file.string());
    listing.depth_encoding = parse_depth_encoding(settings.text("depth_encoding", "plain"), file.string());
  } catch (const ConfigError& fault) {
    settings.problems.push_back(fault.what());
  }
  if (const YAML::Node given = root["paths"]; given && !given.IsMap()) {
    settings.problem(given, "paths", "a folder or file for each kind of image");
  } else if (given) {
    std::set<std::string> known;
    for (const auto& [key, value] : paths) known.insert(key);
    settings.refuse_unknown(given, known);
    for (auto& [key, value] : paths)
      if (given[key] && given[key].IsScalar()) {
        value = given[key].Scalar();
        if (!fs::exists(file.parent_path() / value))
          listing.notes.push_back(
              describe_mismatch(file.string(), "paths: " + key, "'" + value + "'", "nothing there"));
      }
  }
  if (!settings.problems.empty()) throw ConfigError(settings.problems);
}

SequenceListing list(const fs::path& path, const SequenceOptions& options) {
  SequenceListing listing;
  std::map<std::string, std::string> paths = {{"color", "color"},          {"depth", "depth"},
                                              {"labels", "labels"},        {"probs", "probs"},
                                              {"instances", "instances"},  {"poses", "poses.txt"},
                                              {"classes", "classes.yaml"}, {"properties", "properties.yaml"},
                                              {"touches", "touches.csv"}};
  const fs::path file = path / "sequence.yaml";
  try {
    read_settings(file, listing, paths);
  } catch (const YAML::Exception& fault) {
    throw ConfigError(yaml_fault(file.string(), fault));
  }
  const auto images = [&](const char* key) { return numbered_files(path / paths[key], "", {".png", ".jpg", ".jpeg"}); };
  const FrameFiles files{.depth = depth_files(path / paths["depth"]),
                         .color = images("color"),
                         .labels = images("labels"),
                         .instances = images("instances"),
                         .probabilities = images("probs")};
  const std::vector<StampedPose> poses = read_trajectory(path / paths["poses"], true);

  // The first column of poses.txt holds frame numbers where all of them name a frame; else stamps, one a frame in
  // order.
  std::vector<double> numbers;
  bool by_number = true;
  for (const StampedPose& pose : poses) {
    numbers.push_back(pose.stamp_s);
    by_number &= pose.stamp_s == std::floor(pose.stamp_s) && std::abs(pose.stamp_s) < 1e9;
  }
  if (!by_number && poses.size() != files.depth.size())
    throw FormatError(describe_mismatch(
        (path / paths["poses"]).string(), "poses",
        "frame numbers, or a stamp for each of the " + std::to_string(files.depth.size()) + " depth images in order",
        std::to_string(poses.size()) + " stamps"));
  const std::vector<bool> disordered = out_of_order(numbers);
  std::map<int64_t, const StampedPose*> pose_of;
  if (by_number)
    for (const StampedPose& pose : poses) {
      const auto [other, is_new] = pose_of.emplace(int64_t(pose.stamp_s), &pose);
      if (!is_new)
        throw FormatError(describe_mismatch((path / paths["poses"]).string() + ":" + std::to_string(pose.line),
                                            "frame number", "each once", std::to_string(other->first) + " again"));
    }
  std::vector<int64_t> posed;
  for (const auto& [number, pose] : pose_of) posed.push_back(number);
  listing.frames = frame_records(files, posed);
  listing.stamped = !by_number;
  size_t position = 0;
  for (FrameRecord& frame : listing.frames) {
    if (by_number) {
      if (const auto found = pose_of.find(frame.index); found != pose_of.end()) frame.pose = found->second->matrix;
    } else if (!frame.depth.empty()) {
      frame.stamp_s = poses[position].stamp_s;
      frame.pose = poses[position].matrix;
      if (disordered[position]) {
        frame.fault = kStampOutOfOrder;
        frame.fault_detail = (path / paths["poses"]).string() + ":" + std::to_string(poses[position].line) +
                             ": not after the stamps before it";
      }
      ++position;
    }
  }
  if (options.classes_file.empty() && fs::exists(path / paths["classes"]))
    listing.classes = read_class_table(path / paths["classes"]);
  if (fs::exists(path / paths["properties"])) listing.properties_file = path / paths["properties"];
  if (fs::exists(path / paths["touches"])) listing.touches_file = path / paths["touches"];
  return listing;
}

}  // namespace

const Layout kGenericLayout = {"generic", "sequence.yaml", recognises, list};

}  // namespace felt
