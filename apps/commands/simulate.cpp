#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>

#include "apps/command.h"
#include "apps/commands/commands.h"
#include "apps/exit_code.h"
#include "apps/fusion/interrupt.h"
#include "apps/options/number_checks.h"
#include "apps/options/problems.h"
#include "apps/output/progress.h"
#include "core/error.h"
#include "core/text.h"
#include "io/simulation/scene_file.h"
#include "io/simulation/scene_library.h"
#include "io/simulation/sequence_writer.h"
#include "io/tables/confusion_file.h"
#include "io/tables/property_yaml.h"

namespace felt::apps {
namespace {

namespace fs = std::filesystem;

struct SimulateOptions {
  CommonOptions common;
  std::string scene;
  std::string out;
  bool list = false;
  bool force = false;
  int frames = 100;
  int width = 640, height = 480;
  std::string trajectory = "path";
  std::string noise = "none";
  std::string labels = "semantic";
  std::string network = "none";
  std::string errors = "segment";
  int top = 0;
  double sharpness = 1;
  int touches = 0;
  double touch_sigma = 0;
  std::string touch_where = "anywhere";
  std::string properties;
  uint64_t seed = 1;
  double depth_scale = 5000;
  std::string color = "png";
  bool no_mesh = false;
  std::vector<const CLI::Option*> of_network, of_touches;
};

int list_scenes(const SimulateOptions& o) {
  nlohmann::ordered_json scenes = nlohmann::ordered_json::array();
  for (const std::string& name : scene_names()) {
    const Scene scene = make_scene(name);
    if (o.common.json)
      scenes.push_back({{"name", name}, {"description", scene.description}, {"solids", scene.primitives.size()}});
    else
      std::printf("%-14s %s\n", name.c_str(), scene.description.c_str());
  }
  if (o.common.json) print_json(scenes);
  return kDone;
}

/// A file where the name has a file's extension, else a built-in scene.
Scene scene_of(const std::string& name) {
  const std::string extension = fs::path(name).extension();
  return extension == ".yaml" || extension == ".yml" || extension == ".json" ? read_scene(name) : make_scene(name);
}

Trajectory trajectory_of(const SimulateOptions& o, const Scene& scene) {
  if (o.trajectory == "path") return standard_trajectory(scene, o.frames);
  const Eigen::Vector3d middle = scene.bounds.center(), size = scene.bounds.sizes();
  // On the spot: where the scene's path begins, which keeps clear of its solids.
  if (o.trajectory == "sweep") return sweep(scene.path.front().position_m, 0, 2 * std::numbers::pi, -0.25, o.frames);
  return orbit(middle, 0.35 * std::min(size.x(), size.y()), 0.2 * size.z(), 2 * std::numbers::pi, o.frames);
}

void check(const SimulateOptions& o) {
  Problems problems;
  for (const CLI::Option* option : o.of_network)
    if (o.network == "none" && option->count() > 0)
      problems.add_of_usage(describe_mismatch("simulate", option->get_name(), "a --network, which it is for", "none"));
  for (const CLI::Option* option : o.of_touches)
    if (o.touches == 0 && option->count() > 0)
      problems.add_of_usage(describe_mismatch("simulate", option->get_name(), "--touches, which it is for", "none"));
  problems.throw_if_any();
}

SimulationSettings settings_of(const SimulateOptions& o) {
  SimulationSettings s;
  s.scene = scene_of(o.scene);
  s.trajectory = trajectory_of(o, s.scene);
  s.camera = simulated_camera(o.width, o.height);
  if (o.noise == "rgbd") s.noise = DepthNoise{};
  s.label_set = o.labels == "semantic" ? LabelSet::semantic : LabelSet::material;
  const ClassTable& classes = s.label_set == LabelSet::semantic ? s.scene.semantics : s.scene.materials;
  if (o.network != "none") {
    LabelNetwork network;
    network.confusion = fs::path(o.network).extension() == ".csv" ? read_confusion_matrix(o.network, classes)
                                                                  : preset_confusion(o.network, classes);
    network.scale = o.errors == "pixel"     ? ErrorScale::pixel
                    : o.errors == "segment" ? ErrorScale::segment
                                            : ErrorScale::scene;
    network.top = o.top;
    network.sharpness = o.sharpness;
    network.class_share = class_shares(s.scene, s.trajectory, s.camera, s.label_set);
    s.network = std::move(network);
  }
  if (!o.properties.empty()) s.properties = read_properties(o.properties);
  s.touches = {o.touches, o.touch_sigma, o.seed};
  if (o.touch_where == "mistaken") {
    if (!s.network || s.label_set != LabelSet::material)
      throw CLI::ValidationError(
          describe_mismatch("simulate", "--touch-where mistaken", "--labels material and a --network", "none"));
    s.touches.mistaken_by = s.network;
  }
  s.seed = o.seed;
  s.depth_scale = o.depth_scale;
  s.jpeg_color = o.color == "jpg";
  s.with_mesh = !o.no_mesh;
  // A camera inside a solid sees nothing that makes sense.
  if (const double clear_m = clearance_m(s.scene, s.trajectory); clear_m <= 0.01)
    throw ConfigError(describe_mismatch("simulate", "trajectory", "a camera more than 1 cm from every surface",
                                        "one at " + number_text(clear_m, "%.3g") + " m (choose another --trajectory)"));
  return s;
}

/// Touches that a reconstruction of the sequence cannot use as it is, or that cannot be made.
void warn_of_touches(const SimulationSettings& s) {
  if (s.touches.count == 0 || s.properties.empty()) return;
  const Property& property = s.properties[0];
  if (std::none_of(s.scene.primitives.begin(), s.scene.primitives.end(), [&](const Primitive& solid) {
        const uint16_t slot = s.scene.materials.slot_of_id(solid.material);
        return slot != ClassTable::kNoSlot && property.priors.contains(s.scene.materials.at_slot(slot).name);
      }))
    spdlog::warn(
        "--touches: nothing is touched, as no material of the scene has a prior of {}: they need --properties "
        "with one",
        property.name);
  else if (s.label_set == LabelSet::semantic)
    spdlog::warn(
        "--touches: labels are of things and priors of {} of materials: to use the touches, reconstruct needs "
        "--properties with priors of these things (or simulate --labels material)",
        property.name);
}

int run_simulate(const SimulateOptions& o) {
  if (o.list) return list_scenes(o);
  if (o.scene.empty() || o.out.empty()) throw CLI::RequiredError(o.scene.empty() ? "SCENE" : "--out");
  check(o);
  const SimulationSettings settings = settings_of(o);
  warn_of_touches(settings);
  const InterruptGuard interrupt;
  bool whole = false;
  {
    ProgressBar bar("frames", o.frames, !o.common.quiet);
    whole = write_simulated_sequence(settings, o.out, o.force, [&](int64_t done) {
      bar.update(done);
      return !interrupt.requested();
    });
  }
  if (!whole) {
    std::fprintf(stderr, "feltmap: simulate: stopped; nothing was written to %s\n", o.out.c_str());
    return kInterrupted;
  }
  if (o.common.json)
    print_json({{"scene", settings.scene.name}, {"frames", o.frames}, {"out", o.out}, {"seed", o.seed}});
  else if (!o.common.quiet)
    std::printf("%d frames of %s (%s) in %s\n", o.frames, settings.scene.name.c_str(),
                settings.scene.description.c_str(), o.out.c_str());
  return kDone;
}

}  // namespace

void add_simulate(CLI::App& app) {
  static SimulateOptions o;
  CLI::App& command = add_command(
      app,
      {"simulate", "Write a sequence of an analytic scene: colour, depth, labels, poses, touches, and the truth",
       "feltmap simulate room1 --out room1 --noise rgbd --network medium --top 3\n"
       "feltmap simulate ice_crossing --out ice --labels material --network data/confusion/ice_is_snow.csv --touches "
       "3"},
      o.common, [] { return run_simulate(o); });
  command.add_option("SCENE", o.scene, "A built-in scene (--list) or a scene file (.yaml, .json; docs/datasets.md)");
  command.add_option("--out", o.out, "The folder to write");
  command.add_flag("--list", o.list, "Show the built-in scenes");
  command.add_flag("--force", o.force, "Replace an earlier simulated sequence");
  command.add_option("--frames", o.frames, "Number of frames")->check(CLI::Range(1, 1000000))->capture_default_str();
  command.add_option("--width", o.width, "Pixels")->check(CLI::Range(16, 8192))->capture_default_str();
  command.add_option("--height", o.height, "Pixels")->check(CLI::Range(16, 8192))->capture_default_str();
  command
      .add_option("--trajectory", o.trajectory, "The scene's own path, once around its middle, or a turn on the spot")
      ->check(CLI::IsMember({"path", "orbit", "sweep"}))
      ->capture_default_str();
  command.add_option("--noise", o.noise, "Depth exact or as a structured-light camera measures it")
      ->check(CLI::IsMember({"none", "rgbd"}))
      ->capture_default_str();
  command.add_option("--labels", o.labels, "Which classes the labels are: things or materials")
      ->check(CLI::IsMember({"semantic", "material"}))
      ->capture_default_str();
  command
      .add_option("--network", o.network,
                  "Who labels: none (the truth), good, medium, poor, or a confusion matrix (.csv)")
      ->capture_default_str();
  command
      .add_option("--errors", o.errors, "What the network mistakes as one: a pixel, a thing in a frame, a thing always")
      ->check(CLI::IsMember({"pixel", "segment", "scene"}))
      ->capture_default_str();
  command.add_option("--top", o.top, "Class probabilities to keep per pixel; 0: labels only")
      ->check(CLI::Range(0, 1000))
      ->capture_default_str();
  command
      .add_option("--sharpness", o.sharpness, "Exponent of the probabilities; above 1 the network is over-confident")
      ->check(finite())
      ->check(CLI::Range(0.01, 100.0))
      ->capture_default_str();
  command.add_option("--touches", o.touches, "Number of touches")->check(CLI::Range(0, 100000))->capture_default_str();
  command.add_option("--touch-sigma", o.touch_sigma, "Measurement noise of the readings")
      ->check(finite())
      ->check(CLI::Range(0.0, 1e6))
      ->capture_default_str();
  command.add_option("--touch-where", o.touch_where, "Anywhere, or only where the network mistakes the material")
      ->check(CLI::IsMember({"anywhere", "mistaken"}))
      ->capture_default_str();
  command.add_option("--properties", o.properties,
                     "What touches measure (YAML); without it the friction of eight materials");
  command.add_option("--seed", o.seed, "Everything random is a function of it")
      ->check(at_least_zero())
      ->capture_default_str();
  command.add_option("--depth-scale", o.depth_scale, "Depth images hold metres times this")
      ->check(CLI::Range(1.0, 65535.0))
      ->capture_default_str();
  command.add_option("--color", o.color, "Format of the colour images")
      ->check(CLI::IsMember({"png", "jpg"}))
      ->capture_default_str();
  command.add_flag("--no-mesh", o.no_mesh, "Leave out mesh.ply");
  for (const char* name : {"--errors", "--top", "--sharpness"}) o.of_network.push_back(command.get_option(name));
  for (const char* name : {"--touch-sigma", "--touch-where"}) o.of_touches.push_back(command.get_option(name));
}

}  // namespace felt::apps
