#include "io/simulation/scene_file.h"

#include <yaml-cpp/yaml.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <set>

#include "core/error.h"
#include "core/text.h"
#include "core/utf8.h"
#include "io/files/text_input.h"
#include "io/files/yaml_problems.h"
#include "io/simulation/furniture.h"

namespace felt {
namespace {

using Eigen::Vector3d;

constexpr const char* kShapes[] = {"plane", "box", "sphere", "cylinder"};
constexpr const char* kPatterns[] = {"plain", "checker", "noise", "wood", "tiles", "stripes", "picture"};

class SceneParser : private YamlProblems {
public:
  using YamlProblems::YamlProblems;

  Scene parse(const std::string& text, const std::string& where) {
    YAML::Node document;
    try {
      document = YAML::Load(text);
    } catch (const YAML::Exception& e) {
      throw ConfigError(yaml_fault(where, e));
    }
    const YAML::Node root = document.IsMap() && document["scene"] ? document["scene"] : document;
    scene_.semantics = simulated_semantics();
    scene_.materials = simulated_materials();
    if (check_keys(root, {"name", "description", "bounds_m", "light_m", "primitives", "path"})) {
      if (root["name"]) scene_.name = text_of(root["name"], "name");
      if (root["description"]) scene_.description = text_of(root["description"], "description");
      bounds(root);
      if (root["light_m"]) scene_.light_m = vector(root["light_m"], "light_m");
      for (const YAML::Node& node : list(root, "primitives")) primitive(node);
      for (const YAML::Node& node : list(root, "path")) way_point(node);
    }
    if (!problems.empty()) throw ConfigError(problems);
    return std::move(scene_);
  }

private:
  bool check_keys(const YAML::Node& node, const std::set<std::string>& known) {
    if (!node.IsMap()) {
      problem(node, "scene", "a mapping");
      return false;
    }
    refuse_unknown(node, known);
    return true;
  }
  YAML::Node list(const YAML::Node& parent, const char* key) {
    const YAML::Node node = parent[key];
    if (node && node.IsSequence() && node.size() > 0) return node;
    problem(node, key, "a list that is not empty");
    return YAML::Node(YAML::NodeType::Sequence);
  }
  std::string text_of(const YAML::Node& node, const std::string& what) {
    if (node && node.IsScalar() && is_utf8(node.Scalar())) return node.Scalar();
    problem(node, what, "a text in UTF-8");
    return "";
  }
  double number(const YAML::Node& node, const std::string& what, double low, double high) {
    double value = 0;
    if (node && node.IsScalar() && YAML::convert<double>::decode(node, value) && value >= low && value <= high)
      return value;
    problem(node, what, "a number from " + number_text(low) + " to " + number_text(high));
    return low;
  }
  Vector3d vector(const YAML::Node& node, const std::string& what, double low = -1e4, double high = 1e4) {
    if (!node || !node.IsSequence() || node.size() != 3) {
      problem(node, what, "[x, y, z]");
      return Vector3d::Constant(low);
    }
    return {number(node[0], what, low, high), number(node[1], what, low, high), number(node[2], what, low, high)};
  }
  Rgba8 color(const YAML::Node& node, const std::string& what) {
    const Vector3d c = vector(node, what, 0, 255);
    return {uint8_t(c.x()), uint8_t(c.y()), uint8_t(c.z()), 255};
  }
  template <size_t N>
  int choice(const YAML::Node& node, const std::string& what, const char* const (&names)[N]) {
    for (size_t i = 0; i < N; ++i)
      if (node && node.IsScalar() && node.Scalar() == names[i]) return int(i);
    problem(node, what, "one of " + listed(names));
    return 0;
  }
  uint16_t class_id(const YAML::Node& node, const std::string& what, const ClassTable& classes) {
    const auto slot = node && node.IsScalar() ? classes.slot_of_name(node.Scalar()) : std::nullopt;
    if (slot) return classes.at_slot(*slot).id;
    problem(node, what, "one of " + listed(classes.classes(), &ClassInfo::name));
    return 0;
  }
  void bounds(const YAML::Node& root) {
    const YAML::Node node = root["bounds_m"];
    if (!node || !node.IsSequence() || node.size() != 2) return problem(node, "bounds_m", "[[x, y, z], [x, y, z]]");
    const Vector3d low = vector(node[0], "bounds_m"), high = vector(node[1], "bounds_m");
    if ((low.array() >= high.array()).any()) problem(node, "bounds_m", "the low corner below the high one");
    scene_.bounds = {low, high};
  }
  void primitive(const YAML::Node& node) {
    if (!check_keys(node, {"name", "shape", "half_size_m", "position_m", "rotation_deg", "semantic", "material",
                           "instance", "pattern", "color", "second_color", "scale_m"}))
      return;
    Primitive p;
    p.name = node["name"] ? text_of(node["name"], "name") : "solid";
    p.shape = ShapeKind(choice(node["shape"], "shape", kShapes));
    p.half_size_m = vector(node["half_size_m"], "half_size_m", 0, 1e3);
    if (p.shape != ShapeKind::plane && (p.half_size_m.array() <= 0).any())
      problem(node["half_size_m"], "half_size_m", "numbers above 0");
    const Vector3d turn = node["rotation_deg"] ? vector(node["rotation_deg"], "rotation_deg") : Vector3d::Zero();
    const Vector3d rad = turn * std::numbers::pi / 180;
    p.T_world_shape.linear() =
        (Eigen::AngleAxisd(rad.z(), Vector3d::UnitZ()) * Eigen::AngleAxisd(rad.y(), Vector3d::UnitY()) *
         Eigen::AngleAxisd(rad.x(), Vector3d::UnitX()))
            .toRotationMatrix();
    p.T_world_shape.translation() = vector(node["position_m"], "position_m");
    p.semantic = class_id(node["semantic"], "semantic", scene_.semantics);
    p.material = class_id(node["material"], "material", scene_.materials);
    p.instance = uint16_t(number(node["instance"], "instance", 1, 65535));
    if (node["pattern"]) p.texture.pattern = Pattern(choice(node["pattern"], "pattern", kPatterns));
    p.texture.first = node["color"] ? color(node["color"], "color") : Rgba8{190, 190, 190, 255};
    p.texture.second = node["second_color"] ? color(node["second_color"], "second_color") : p.texture.first;
    if (node["scale_m"]) p.texture.scale_m = number(node["scale_m"], "scale_m", 1e-3, 1e3);
    scene_.primitives.push_back(std::move(p));
  }
  void way_point(const YAML::Node& node) {
    if (!check_keys(node, {"position_m", "look_at_m"})) return;
    const WayPoint point{vector(node["position_m"], "position_m"), vector(node["look_at_m"], "look_at_m")};
    const Vector3d gaze = point.look_at_m - point.position_m;
    if (gaze.head<2>().norm() < 1e-6) problem(node, "way-point", "a camera that does not look straight up or down");
    scene_.path.push_back(point);
  }

  Scene scene_;
};

nlohmann::ordered_json array_of(const Vector3d& v) { return nlohmann::ordered_json::array({v.x(), v.y(), v.z()}); }
nlohmann::ordered_json array_of(Rgba8 c) { return nlohmann::ordered_json::array({c.r, c.g, c.b}); }

const std::string& name_of(const ClassTable& classes, uint16_t id) {
  return classes.at_slot(classes.slot_of_id(id)).name;
}

}  // namespace

Scene parse_scene(const std::string& text, const std::string& where) { return SceneParser(where).parse(text, where); }

Scene read_scene(const std::filesystem::path& file) {
  return parse_scene(read_file_or_pipe(file, 16 << 20), file.string());
}

std::string scene_json(const Scene& scene, const std::string& simulation) {
  using Json = nlohmann::ordered_json;
  // One line for each solid and way-point: a list for people to read.
  const auto lines = [](const std::vector<Json>& items) {
    std::string text = "[";
    for (const Json& item : items) text += (text.size() > 1 ? ",\n" : "\n") + item.dump();
    return text + "]";
  };
  std::vector<Json> primitives, path;
  for (const Primitive& p : scene.primitives) {
    const Eigen::Matrix3d R = p.T_world_shape.linear();
    const Vector3d turn(std::atan2(R(2, 1), R(2, 2)), std::atan2(-R(2, 0), std::hypot(R(2, 1), R(2, 2))),
                        std::atan2(R(1, 0), R(0, 0)));
    primitives.push_back({{"name", p.name},
                          {"shape", kShapes[int(p.shape)]},
                          {"half_size_m", array_of(p.half_size_m)},
                          {"position_m", array_of(p.T_world_shape.translation())},
                          {"rotation_deg", array_of(turn * 180 / std::numbers::pi)},
                          {"semantic", name_of(scene.semantics, p.semantic)},
                          {"material", name_of(scene.materials, p.material)},
                          {"instance", p.instance},
                          {"pattern", kPatterns[int(p.texture.pattern)]},
                          {"color", array_of(p.texture.first)},
                          {"second_color", array_of(p.texture.second)},
                          {"scale_m", p.texture.scale_m}});
  }
  for (const WayPoint& w : scene.path)
    path.push_back({{"position_m", array_of(w.position_m)}, {"look_at_m", array_of(w.look_at_m)}});
  std::string text = "{\"scene\": {\n\"name\": " + Json(scene.name).dump() +
                     ",\n\"description\": " + Json(scene.description).dump() +
                     ",\n\"bounds_m\": " + Json({array_of(scene.bounds.min()), array_of(scene.bounds.max())}).dump() +
                     ",\n\"light_m\": " + array_of(scene.light_m).dump() + ",\n\"primitives\": " + lines(primitives) +
                     ",\n\"path\": " + lines(path) + "}";
  if (!simulation.empty()) text += ",\n\"simulation\": " + simulation;
  return text + "}\n";
}

}  // namespace felt
