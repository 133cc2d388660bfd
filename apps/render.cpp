#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "apps/camera_options.h"
#include "apps/command.h"
#include "apps/commands.h"
#include "apps/exit_code.h"
#include "core/error.h"
#include "io/map_file.h"
#include "io/picture.h"
#include "io/pose_list.h"
#include "mapping/marching_cubes.h"
#include "mapping/render.h"
#include "mapping/render_classes.h"

namespace felt::apps {
namespace {
namespace fs = std::filesystem;

struct RenderCommand {
  CommonOptions common;
  CameraOptions camera;
  std::string map, out, trajectory, overview, up = "0,0,1";
  std::vector<std::string> poses;
  std::vector<std::string> images = {"depth", "normal", "color"};
  RenderOptions options;
};

constexpr const char* kImages[] = {"depth", "normal", "color", "class", "entropy"};

ColorImage normal_picture(const Image<Eigen::Vector3f>& normals) {
  ColorImage picture(normals.width(), normals.height(), {0, 0, 0, 255});
  for (size_t i = 0; i < normals.size(); ++i) {
    const Eigen::Vector3f& n = normals.data()[i];
    if (n.isZero()) continue;
    const Eigen::Vector3f level = (n + Eigen::Vector3f::Ones()) * 127.5f + Eigen::Vector3f::Constant(0.5f);
    picture.data()[i] = {uint8_t(level.x()), uint8_t(level.y()), uint8_t(level.z()), 255};
  }
  return picture;
}

Eigen::Vector3d parse_up(const std::string& text) {
  Eigen::Vector3d up;
  int used = 0;
  if (std::sscanf(text.c_str(), "%lf,%lf,%lf%n", &up.x(), &up.y(), &up.z(), &used) != 3 ||
      size_t(used) != text.size() || !up.allFinite() || up.isZero())
    throw ConfigError(describe_mismatch("--up", "direction", "x,y,z", text));
  return up;
}

/// Writes the images of one pose and returns their names.
std::vector<std::string> write_view(const RenderCommand& command, const Map& map, const RenderedView& view,
                                    size_t number) {
  char stem[32];
  std::snprintf(stem, sizeof stem, "%06zu", number);
  std::vector<std::string> names;
  for (const std::string& image : command.images) {
    const std::string name = std::string(stem) + "." + image + ".png";
    const fs::path path = fs::path(command.out) / name;
    if (image == "depth") write_depth_png(path, view.depth_m);
    if (image == "normal") write_png(path, normal_picture(view.normal));
    if (image == "color") write_png(path, view.color);
    if (image == "class") write_label_png(path, class_image(map, view.voxel));
    if (image == "entropy") write_depth_png(path, entropy_image(map, view.voxel));
    names.push_back(name);
  }
  return names;
}

int render(const RenderCommand& command) {
  const PinholeCamera camera = camera_of(command.camera);
  std::vector<std::string> problems;
  std::vector<Eigen::Isometry3d> poses;
  for (const std::string& pose : command.poses) poses.push_back(parse_pose(pose, "--pose"));
  if (!command.trajectory.empty())
    for (const auto& T : read_poses(command.trajectory)) poses.push_back(T);
  if (poses.empty() && command.overview.empty())
    problems.push_back(
        describe_mismatch("render", "what to render", "--pose, --trajectory or --overview", "none of them"));
  if (!poses.empty() && command.out.empty())
    problems.push_back(describe_mismatch("render", "where to write", "--out DIR", "nothing"));
  const bool classes = std::any_of(command.images.begin(), command.images.end(),
                                   [](const std::string& image) { return image == "class" || image == "entropy"; });
  const Map map = load_map(command.map);
  if (classes && map.classes.empty())
    problems.push_back(describe_mismatch(command.map, "--images class, entropy", "a map with classes", "none"));
  if (!problems.empty()) throw ConfigError(problems);

  nlohmann::ordered_json json = {{"map", command.map}, {"views", nlohmann::ordered_json::array()}};
  if (!command.overview.empty()) {
    write_png(command.overview, overview_picture(extract_mesh(map), parse_up(command.up)));
    json["overview"] = command.overview;
  }
  if (!poses.empty()) {
    fs::create_directories(command.out);
    const RayCaster caster(map);
    for (size_t i = 0; i < poses.size(); ++i)
      json["views"].push_back(write_view(command, map, caster.render(camera, poses[i], command.options), i));
  }
  if (command.common.json)
    std::printf("%s\n", json.dump(2).c_str());
  else if (!command.common.quiet)
    std::printf("%zu views of %s\n", poses.size(), command.map.c_str());
  return kDone;
}

}  // namespace

void add_render(CLI::App& app) {
  static RenderCommand command;
  CLI::App& sub =
      add_command(app,
                  {"render", "Depth, normal, colour, class and entropy images of a map from any pose, ray-cast",
                   "feltmap render out/map.vdb --trajectory poses.txt --out views\n"
                   "feltmap render out/map.vdb --pose 0,0,1.5,0.5,-0.5,0.5,-0.5 --images depth,color --out views\n"
                   "feltmap render out/map.vdb --overview picture.png --up 0,0,1"},
                  command.common, [] { return render(command); });
  sub.add_option("MAP", command.map, "Map file")->required()->check(CLI::ExistingFile);
  sub.add_option("--pose", command.poses,
                 "Camera-to-world pose: tx,ty,tz,qx,qy,qz,qw or 12 or 16 numbers of a matrix (repeatable)")
      ->allow_extra_args(false);
  sub.add_option("--trajectory", command.trajectory, "Text file with one such pose a line, a stamp before it or not")
      ->check(CLI::ExistingFile);
  sub.add_option("--out", command.out,
                 "Folder for the images: <number>.<image>.png; depth in millimetres, entropy in "
                 "thousandths of a nat, classes as ids, 16 bit each");
  sub.add_option("--images", command.images, "Which images")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->check(CLI::IsMember(std::vector<std::string>(std::begin(kImages), std::end(kImages))))
      ->capture_default_str();
  add_camera_options(sub, command.camera);
  sub.add_option("--max-depth", command.options.max_depth_m, "Metres along the optical axis")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  sub.add_option("--overview", command.overview, "One picture of the whole map from outside and above (PNG)");
  sub.add_option("--up", command.up, "Upward direction in the world, for --overview")->capture_default_str();
}

}  // namespace felt::apps
