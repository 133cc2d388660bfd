#include "io/simulation/sequence_writer.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <set>
#include <string>

#include "core/error.h"
#include "io/files/atomic_file.h"
#include "io/files/folder_in_progress.h"
#include "io/files/yaml_text.h"
#include "io/images/depth_encode.h"
#include "io/images/image_encode.h"
#include "io/images/label_images.h"
#include "io/simulation/scene_file.h"
#include "io/simulation/scene_mesh.h"
#include "io/tables/class_table_file.h"
#include "io/tables/confusion_file.h"
#include "io/tables/property_yaml.h"

namespace felt {
namespace fs = std::filesystem;
namespace {

std::string frame_name(size_t i, const char* extension) {
  char name[32];
  std::snprintf(name, sizeof name, "%06zu%s", i, extension);
  return name;
}

template <typename... Values>
std::string formatted(const char* format, Values... values) {
  char text[512];
  std::snprintf(text, sizeof text, format, values...);
  return text;
}

/// What keeps `folder` from making place; empty where it is empty, or a simulated sequence and nothing else.
std::string in_the_way(const fs::path& folder) {
  if (!fs::is_directory(folder)) return "something that is no folder";
  if (fs::is_empty(folder)) return "";
  if (!fs::exists(folder / "sequence.yaml") || !fs::exists(folder / "scene.json")) return "another folder";
  static const std::set<std::string> kWritten = {
      "classes.yaml", "color", "confusion.csv",   "depth",      "instances",     "labels",      "mesh.ply",
      "poses.txt",    "probs", "properties.yaml", "scene.json", "sequence.yaml", "touches.csv", "truth"};
  for (const auto& entry : fs::directory_iterator(folder))
    if (const std::string name = entry.path().filename().string(); !kWritten.contains(name))
      return "one with '" + name + "', which no simulation wrote";
  return "";
}

std::string sequence_yaml(const SimulationSettings& s, const std::string& root, const std::string& labels,
                          const std::string& classes) {
  const PinholeCamera& c = s.camera;
  std::string text = "name: " + yaml_scalar(s.scene.name) + "\n";
  text += formatted("camera: {fx: %.15g, fy: %.15g, cx: %.15g, cy: %.15g, width: %d, height: %d}\n", c.fx, c.fy, c.cx,
                    c.cy, c.width, c.height);
  text += formatted("depth_scale: %.15g\npose_convention: camera-to-world\n", s.depth_scale);
  text += "paths: {color: " + root + "color, depth: " + root + "depth, labels: " + labels + ", instances: " + root +
          "instances, poses: " + root + "poses.txt, classes: " + classes + "}\n";
  return text;
}

std::string poses_text(const Trajectory& trajectory) {
  std::string text;
  for (size_t i = 0; i < trajectory.size(); ++i) {
    text += std::to_string(i);
    const Eigen::Matrix4d T = trajectory[i].matrix();
    for (int row = 0; row < 4; ++row)
      for (int column = 0; column < 4; ++column) text += formatted(" %.15g", T(row, column));
    text += "\n";
  }
  return text;
}

std::string simulation_json(const SimulationSettings& s, const std::vector<SimulatedTouch>& touches) {
  nlohmann::ordered_json out;
  out["seed"] = s.seed;
  out["frames"] = s.trajectory.size();
  out["label_set"] = s.label_set == LabelSet::semantic ? "semantic" : "material";
  out["depth_noise"] = nullptr;
  if (s.noise)
    out["depth_noise"] = {{"axial_scale", s.noise->axial_scale},
                          {"lateral_scale", s.noise->lateral_scale},
                          {"disparity_step_px", s.noise->disparity_step_px},
                          {"baseline_m", s.noise->baseline_m},
                          {"max_incidence_deg", s.noise->max_incidence_deg},
                          {"edge_dropout", s.noise->edge_dropout},
                          {"random_dropout", s.noise->random_dropout}};
  out["network"] = nullptr;
  if (s.network) {
    constexpr const char* kScales[] = {"pixel", "segment", "scene"};
    out["network"] = {{"confusion", "confusion.csv"},
                      {"errors", kScales[int(s.network->scale)]},
                      {"top", s.network->top},
                      {"sharpness", s.network->sharpness}};
  }
  for (const SimulatedTouch& t : touches)
    out["touches"].push_back({{"frame", t.frame},
                              {"instance", t.instance},
                              {"material", s.scene.materials.at_slot(s.scene.materials.slot_of_id(t.material)).name},
                              {"value", t.value}});
  return out.dump();
}

void check(const SimulationSettings& s) {
  std::vector<std::string> problems;
  if (s.trajectory.empty()) problems.push_back(describe_mismatch("simulate", "frames", "at least 1", "0"));
  if (!(s.depth_scale >= 1 && s.depth_scale <= 65535))
    problems.push_back(describe_mismatch("simulate", "depth scale", "1 to 65535", std::to_string(s.depth_scale)));
  const int k = (s.label_set == LabelSet::semantic ? s.scene.semantics : s.scene.materials).size();
  if (s.network && s.network->confusion.k != k)
    problems.push_back(describe_mismatch("simulate", "confusion matrix", std::to_string(k) + " classes",
                                         std::to_string(s.network->confusion.k)));
  if (s.touches.count > 0 && s.properties.empty())
    problems.push_back(describe_mismatch("simulate", "properties", "at least one for touches", "none"));
  if (!problems.empty()) throw ConfigError(problems);
}

void write_frame(const SimulationSettings& s, const ClassTable& classes, const fs::path& folder, size_t i) {
  const SceneView view = render_view(s.scene, s.camera, s.trajectory[i]);
  const auto png = frame_name(i, ".png");
  const DepthImage depth_m = s.noise ? add_depth_noise(view, s.camera, *s.noise, s.seed, int64_t(i)) : view.depth_m;
  int64_t too_far = 0;  // not measured
  write_bytes(folder / "depth" / png, encode_png(stored_depth(depth_m, s.depth_scale, too_far)));
  if (s.jpeg_color)
    write_bytes(folder / "color" / frame_name(i, ".jpg"), encode_jpeg(view.color));
  else
    write_bytes(folder / "color" / png, encode_png(view.color));
  write_bytes(folder / "instances" / png, encode_png(view.instances));
  write_bytes(folder / "truth" / "semantic" / png, encode_labels(view.semantics, s.scene.semantics));
  write_bytes(folder / "truth" / "material" / png, encode_labels(view.materials, s.scene.materials));
  const LabelImage& labels = s.label_set == LabelSet::semantic ? view.semantics : view.materials;
  if (!s.network) {
    write_bytes(folder / "labels" / png, encode_labels(labels, classes));
    return;
  }
  const NetworkOutput seen = run_network(*s.network, classes, labels, view.instances, s.seed, int64_t(i));
  write_bytes(folder / "labels" / png, encode_labels(seen.labels, classes));
  if (!seen.probabilities.empty()) write_bytes(folder / "probs" / png, encode_probabilities(seen.probabilities));
}

bool write_sequence(const SimulationSettings& s, const fs::path& out, bool replace,
                    const std::function<bool(int64_t)>& progress) {
  const ClassTable& classes = s.label_set == LabelSet::semantic ? s.scene.semantics : s.scene.materials;
  const char* set_name = s.label_set == LabelSet::semantic ? "semantic" : "material";
  if (fs::exists(out) && !replace)
    throw IoError(describe_mismatch(out.string(), "output",
                                    "a path that does not exist (--force replaces a simulated sequence)",
                                    "something that exists"));
  if (const std::string other = fs::exists(out) ? in_the_way(out) : ""; !other.empty())
    throw IoError(
        describe_mismatch(out.string(), "output", "an empty folder or a simulated sequence to replace", other));
  FolderInProgress folder(out);
  const fs::path& root = folder.path();
  for (const char* part : {"color", "depth", "labels", "instances", "truth/semantic", "truth/material"})
    fs::create_directories(root / part);
  if (s.network && s.network->top > 0) fs::create_directories(root / "probs");

  // The small files first: what they can find fault with needs no frames.
  const auto write_text = [&](const fs::path& name, const std::string& text) {
    write_bytes(root / name, {text.begin(), text.end()});
  };
  std::vector<SimulatedTouch> touches;
  if (s.touches.count > 0) touches = simulate_touches(s.scene, s.trajectory, s.camera, s.properties[0], s.touches);
  write_text("sequence.yaml", sequence_yaml(s, "", "labels", "classes.yaml"));
  write_text("truth/sequence.yaml", sequence_yaml(s, "../", set_name, std::string(set_name) + ".yaml"));
  write_text("poses.txt", poses_text(s.trajectory));
  write_text("classes.yaml", class_table_yaml(classes));
  write_text("truth/semantic.yaml", class_table_yaml(s.scene.semantics));
  write_text("truth/material.yaml", class_table_yaml(s.scene.materials));
  if (s.label_set == LabelSet::material) write_text("properties.yaml", properties_yaml(s.properties));
  if (s.network) write_text("confusion.csv", confusion_csv(s.network->confusion, classes));
  if (s.touches.count > 0) write_text("touches.csv", touches_csv(touches, s.properties[0].name));
  write_text("scene.json", scene_json(s.scene, simulation_json(s, touches)));
  if (s.with_mesh) write_scene_mesh(scene_mesh(s.scene), root / "mesh.ply");

  constexpr size_t kBatch = 16;  // frames between two calls of `progress`; memory stays bounded by the threads at work
  for (size_t first = 0; first < s.trajectory.size(); first += kBatch) {
    const size_t end = std::min(first + kBatch, s.trajectory.size());
    tbb::parallel_for(first, end, [&](size_t i) { write_frame(s, classes, root, i); });
    if (progress && !progress(int64_t(end))) return false;
  }
  folder.commit();
  return true;
}

}  // namespace

std::vector<double> class_shares(const Scene& scene, const Trajectory& trajectory, const PinholeCamera& camera,
                                 LabelSet label_set) {
  const ClassTable& classes = label_set == LabelSet::semantic ? scene.semantics : scene.materials;
  const PinholeCamera small = resized(camera, 80, 60);
  std::vector<double> shares(classes.size(), 0.0);
  double total = 0;
  const size_t step = std::max<size_t>(1, trajectory.size() / 32);
  for (size_t i = 0; i < trajectory.size(); i += step) {
    const SceneView view = render_view(scene, small, trajectory[i], false);
    for (const uint16_t id : label_set == LabelSet::semantic ? view.semantics : view.materials)
      if (const uint16_t slot = classes.slot_of_id(id); slot != ClassTable::kNoSlot) shares[slot] += 1, total += 1;
  }
  for (double& share : shares) share = total > 0 ? share / total : 1.0 / double(shares.size());
  return shares;
}

bool write_simulated_sequence(const SimulationSettings& settings, const fs::path& out, bool replace,
                              const std::function<bool(int64_t)>& progress) {
  check(settings);
  try {
    return write_sequence(settings, out, replace, progress);
  } catch (const fs::filesystem_error& e) {
    throw IoError(out.string() + ": cannot be written: " + e.code().message() + " (" + e.path1().string() + ")");
  }
}

}  // namespace felt
