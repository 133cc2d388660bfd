#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>

#include "apps/command.h"
#include "apps/commands/commands.h"
#include "apps/exit_code.h"
#include "apps/options/camera_options.h"
#include "apps/options/number_checks.h"
#include "apps/options/problems.h"
#include "apps/options/reading_options.h"
#include "apps/options/touch_options.h"
#include "apps/output/output_files.h"
#include "core/error.h"
#include "io/map_file/map_file.h"
#include "io/pictures/picture.h"
#include "io/sequence/pose_list.h"
#include "mapping/surface/marching_cubes.h"
#include "mapping/surface/render.h"
#include "mapping/surface/render_classes.h"
#include "mapping/touch/touch_view.h"

namespace felt::apps {
namespace {
namespace fs = std::filesystem;

struct RenderCommand {
  CommonOptions common;
  CameraOptions camera;
  std::string map, out, trajectory, format, frames, overview, properties, up = "0,0,1";
  std::vector<std::string> poses;
  std::vector<std::string> images = {"depth", "normal", "color"}, more_images;
  CLI::Option *images_option = nullptr, *intrinsics = nullptr, *size = nullptr, *up_option = nullptr;
  std::vector<CLI::Option*> of_views;
  bool colored = false;
  ViewOptions options;
};

const std::vector<std::string> kImages = {"depth", "normal", "color", "class", "entropy"};

/// A property's mean or sd, asked for as "friction.mean".
struct PropertyImage {
  int property = 0;
  bool sd = false;
  double low = 0, high = 1;  ///< range of its levels: of all classes' priors and all touches
};

/// `touched`: the map's touch views.
std::optional<PropertyImage> property_image_of(const Map& map, const std::vector<TouchView>& touched,
                                               const std::string& name) {
  const size_t dot = name.rfind('.');
  if (dot == std::string::npos) return std::nullopt;
  const std::string what = name.substr(dot + 1);
  const auto property = map.properties.index_of(name.substr(0, dot));
  if (!property || (what != "mean" && what != "sd")) return std::nullopt;
  PropertyImage image{*property, what == "sd", std::numeric_limits<double>::infinity(), 0};
  if (!image.sd) image.high = -image.low;
  for (const auto& [class_name, prior] : map.properties[*property].priors) {
    // Means of mixtures lie between the classes'.
    image.low = std::min(image.low, image.sd ? 0 : prior.mean - prior.sd);
    image.high = std::max(image.high, image.sd ? 3 * prior.sd : prior.mean + prior.sd);
  }
  // Touches may have taught anything.
  for (const TouchView& view : touched)
    for_each_bit(view.mask, [&](int i) {
      const double value = double((image.sd ? view.sd : view.mean)[size_t(*property)][size_t(i)]);
      if (!std::isfinite(value)) return;
      image.low = std::min(image.low, value);
      image.high = std::max(image.high, value);
    });
  return image;
}

/// Whether a word of the command line is a list of images and so no map.
bool names_images(const std::string& word) {
  const auto names_image = [](const std::string& name) {
    return std::find(kImages.begin(), kImages.end(), name) != kImages.end() || name.ends_with(".mean") ||
           name.ends_with(".sd");
  };
  const std::vector<std::string> names = CLI::detail::split(word, ',');
  return std::all_of(names.begin(), names.end(), names_image);
}

/// Everything that the images of a view are made from.
struct Source {
  const Map& map;
  const std::map<std::string, PropertyImage>& properties;  ///< that are asked for, by the name of their image
  RayCaster caster;
  VoxelBeliefs beliefs;
};

/// Writes the images of one pose and returns their names. `too_far`: counts pixels whose depth 16 bits cannot hold.
nlohmann::ordered_json write_view(const RenderCommand& command, const Source& source, const RenderedView& view,
                                  size_t number, int64_t& too_far) {
  char stem[32];
  std::snprintf(stem, sizeof stem, "%06zu", number);
  nlohmann::ordered_json names = nlohmann::ordered_json::array();
  for (const std::string& image : command.images) {
    const auto path_of = [&](const char* extension) {
      names.push_back(std::string(stem) + "." + image + extension);
      return fs::path(command.out) / names.back().get<std::string>();
    };
    const auto write_values = [&](const Image<float>& values, double low, double high) {
      write_level_png(path_of(".png"), values, low, high);
      if (command.colored) write_png(path_of(".color.png"), felt::colored(values, low, high));
    };
    if (image == "depth") too_far += write_depth_png(path_of(".png"), view.depth_m);
    if (image == "normal") write_png(path_of(".png"), felt::colored(view.normal));
    if (image == "color") write_png(path_of(".png"), view.color);
    if (image == "class") {
      const LabelImage labels = class_image(source.map, source.beliefs, view.voxel);
      write_label_png(path_of(".png"), labels);
      if (command.colored) write_png(path_of(".color.png"), felt::colored(labels, source.map.classes));
    }
    if (image == "entropy") {
      const Image<float> entropy = entropy_image(source.beliefs, view.voxel);
      write_depth_png(path_of(".png"), entropy);
      if (command.colored)
        write_png(path_of(".color.png"),
                  felt::colored(entropy, 0, std::log(double(std::max(2, source.map.classes.size())))));
    }
    if (const auto asked = source.properties.find(image); asked != source.properties.end()) {
      const PropertyImage& property = asked->second;
      const PropertyImages values = property_images(source.beliefs, view.voxel, property.property);
      write_values(property.sd ? values.sd : values.mean, property.low, property.high);
    }
  }
  return names;
}

/// The camera and the poses, those of --pose first.
Viewpoints viewpoints_of(const RenderCommand& command) {
  const bool of_sequence = names_sequence(command.trajectory);
  Problems problems;
  for (const auto& [name, given] :
       {std::pair{"--format", !command.format.empty()}, {"--frames", !command.frames.empty()}})
    if (given && !of_sequence)
      problems.add_of_usage(describe_mismatch("render", name, "--trajectory SEQUENCE, which it is for", "none"));
  if (of_sequence && command.size->count() > 0)
    problems.add_of_usage(
        describe_mismatch("render", "--size", "that of the images of --trajectory SEQUENCE", "another"));
  Viewpoints views;
  for (const std::string& pose : command.poses)
    problems.attempt_reading([&] { views.T_world_camera.push_back(parse_pose(pose, "--pose")); });
  for (const CLI::Option* option : command.of_views)
    if (command.poses.empty() && command.trajectory.empty() && option->count() > 0)
      problems.add_of_usage(describe_mismatch("render", option->get_name(), "--pose or --trajectory", "none"));
  if (command.overview.empty() && command.up_option->count() > 0)
    problems.add_of_usage(describe_mismatch("render", "--up", "--overview, which it is for", "none"));
  problems.attempt([&] { require_ending(command.overview, ".png"); });
  problems.throw_if_any();
  if (command.trajectory.empty()) {
    views.camera = camera_of(command.camera);
    return views;
  }
  ReadingArguments reading;
  reading.format = command.format, reading.frames = command.frames;
  if (command.intrinsics->count() > 0) reading.intrinsics = command.camera.intrinsics;
  SequenceOptions options = resolve(reading);
  options.read_color = options.read_instances = false;
  const Viewpoints recorded = read_viewpoints(command.trajectory, command.camera, options);
  views.camera = recorded.camera;
  views.frames = recorded.frames;
  views.T_world_camera.insert(views.T_world_camera.end(), recorded.T_world_camera.begin(),
                              recorded.T_world_camera.end());
  return views;
}

int render(const RenderCommand& command) {
  const bool views = !command.poses.empty() || !command.trajectory.empty();
  if (!views && command.overview.empty()) throw CLI::RequiredError("--pose, --trajectory or --overview");
  if (views && command.out.empty()) throw CLI::RequiredError("--out");
  const auto [camera, poses, frames] = viewpoints_of(command);
  Problems problems;
  Map map = load_map(command.map);
  use_properties(map, command.properties);
  const std::vector<TouchView> touched = touch_views(map);
  std::map<std::string, PropertyImage> properties;
  nlohmann::ordered_json levels = nlohmann::ordered_json::object();
  bool any_to_color = false;
  for (const std::string& image : command.images) {
    const bool of_classes = image == "class" || image == "entropy";
    const auto property = property_image_of(map, touched, image);
    if (of_classes && map.classes.empty())
      problems.add(describe_mismatch(command.map, "--images class, entropy", "a map with classes", "none"));
    any_to_color |= of_classes || property;
    if (property) {
      properties.emplace(image, *property);
      levels[image] = {{"1", property->low}, {"65535", property->high}};
    }
    if (!property && std::find(kImages.begin(), kImages.end(), image) == kImages.end()) {
      std::string known = "depth, normal, color, class, entropy";
      for (const Property& p : map.properties.properties()) known += ", " + p.name + ".mean, " + p.name + ".sd";
      problems.add(describe_mismatch("--images", "image", "one of " + known, "'" + image + "'"));
    }
  }
  problems.throw_if_any();
  if (command.colored && !any_to_color)
    spdlog::warn("--colored: nothing to colour: only class, entropy and property images of --images are");

  nlohmann::ordered_json json = {{"map", command.map}};
  if (views) json["out"] = command.out;
  if (!frames.empty()) json["frames"] = frames;  // of the last views, those of --pose come first
  json["views"] = nlohmann::ordered_json::array();
  if (!levels.empty()) json["levels"] = levels;
  if (!command.overview.empty()) {
    write_png(command.overview, overview_picture(extract_mesh(map), point_of(command.up)));
    json["overview"] = command.overview;
  }
  if (!poses.empty()) {
    fs::create_directories(command.out);
    const Source source{map, properties, RayCaster(map), VoxelBeliefs(map)};
    int64_t too_far = 0;
    for (size_t i = 0; i < poses.size(); ++i)
      json["views"].push_back(
          write_view(command, source, source.caster.render(camera, poses[i], command.options), i, too_far));
    if (too_far > 0) {
      spdlog::warn("{} pixels lie beyond 65.535 m, which is as far as 16 bits of millimetres go: they are 0", too_far);
      json["depth_pixels_too_far"] = too_far;
    }
  }
  if (command.common.json) {
    print_json(json);
  } else if (!command.common.quiet) {
    if (!poses.empty()) std::printf("%zu views of %s in %s\n", poses.size(), command.map.c_str(), command.out.c_str());
    if (!command.overview.empty()) std::printf("overview of %s in %s\n", command.map.c_str(), command.overview.c_str());
  }
  return kDone;
}

}  // namespace

void add_render(CLI::App& app) {
  static RenderCommand command;
  CLI::App& sub = add_command(
      app,
      {"render", "Depth, normal, colour, class, entropy and property images of a map from any pose, ray-cast",
       "feltmap render out/map.vdb --trajectory recording --frames 0::10 --out views\n"
       "feltmap render out/map.vdb --pose 0,0,1.5,0.5,-0.5,0.5,-0.5 --images depth,color --out views\n"
       "feltmap render out/map.vdb --trajectory poses.txt --images class,friction.mean --colored --out views\n"
       "feltmap render out/map.vdb --overview picture.png --up 0,0,1"},
      command.common, [] {
        if (command.images_option->count() == 0 && !command.more_images.empty())
          throw CLI::ExtrasError(command.more_images);
        command.images.insert(command.images.end(), command.more_images.begin(), command.more_images.end());
        return render(command);
      });
  // Words after --images that name images are no map, wherever the map stands.
  sub.validate_positionals();
  sub.add_option("MAP", command.map, "Map file")->required()->check([](const std::string& word) {
    return names_images(word) ? "'" + word + "' names an image" : "";
  });
  sub.add_option("--pose", command.poses,
                 "Camera-to-world pose: tx,ty,tz,qx,qy,qz,qw or 12 or 16 numbers of a matrix (repeatable)")
      ->allow_extra_args(false);
  sub.add_option(
      "--trajectory", command.trajectory,
      "Text file with one such pose a line, a stamp before it or not; or a recorded sequence, seen again with "
      "its own camera");
  sub.add_option("--format", command.format, "Layout of the sequence (else detected)");
  sub.add_option("--frames", command.frames, "Frames a:b:step of the sequence");
  sub.add_option("--out", command.out,
                 "Folder for the images: <number>.<image>.png; depth in millimetres, entropy in "
                 "thousandths of a nat, classes as ids, properties from 1 to 65535 between the ends that --json "
                 "tells, 16 bit each");
  command.images_option =
      sub.add_option("--images", command.images,
                     "Which images, with commas or blanks between them: depth, normal, color, class, entropy, and "
                     "PROPERTY.mean or PROPERTY.sd of each property")
          ->delimiter(',')
          ->allow_extra_args(false)
          ->capture_default_str();
  sub.add_option("IMAGES", command.more_images, "Further words after --images")->delimiter(',')->group("");
  sub.add_flag("--colored", command.colored,
               "Also write class, entropy and property images in colour, to look at: <number>.<image>.color.png");
  sub.add_option("--properties", command.properties, "Property table (YAML), instead of the one that the map may have");
  add_camera_options(sub, command.camera);
  command.intrinsics = sub.get_option("--intrinsics");
  command.size = sub.get_option("--size");
  sub.add_option("--max-depth", command.options.max_depth_m, "Metres along the optical axis")
      ->check(above_zero())
      ->capture_default_str();
  sub.add_option("--overview", command.overview, "One picture of the whole map from outside and above (PNG)");
  for (const char* name : {"--out", "--images", "--colored", "--properties", "--intrinsics", "--size", "--max-depth"})
    command.of_views.push_back(sub.get_option(name));
  command.up_option = sub.add_option("--up", command.up, "Upward direction in the world, for --overview")
                          ->check(check_direction)
                          ->capture_default_str();
}

}  // namespace felt::apps
