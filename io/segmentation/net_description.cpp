#include "io/segmentation/net_description.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "core/error.h"
#include "core/text.h"
#include "io/files/text_input.h"
#include "io/files/yaml_problems.h"

namespace felt {
namespace fs = std::filesystem;
namespace {

constexpr size_t kLimitBytes = 1 << 20;

/// Reads the keys of one YAML table and gathers what is wrong with them.
class Reader : public YamlProblems {
public:
  using YamlProblems::YamlProblems;

  /// The table under `key`, or an undefined node; refuses keys in it that are not `known`.
  YAML::Node table(const YAML::Node& parent, const char* key, const std::set<std::string>& known) {
    const YAML::Node node = parent[key];
    if (!node) return node;
    if (!node.IsMap()) {
      problem(node, key, "keys and values");
      return YAML::Node(YAML::NodeType::Undefined);
    }
    refuse_unknown(node, known);
    return node;
  }
  std::string text(const YAML::Node& parent, const char* key, const std::string& otherwise) {
    const YAML::Node node = parent ? parent[key] : YAML::Node(YAML::NodeType::Undefined);
    if (!node) return otherwise;
    if (node.IsScalar() && !node.Scalar().empty()) return node.Scalar();
    problem(node, key, "a text");
    return otherwise;
  }
  /// Index of the word under `key` among `words`.
  size_t choice(const YAML::Node& parent, const char* key, const std::vector<std::string>& words, size_t otherwise) {
    const std::string word = text(parent, key, words[otherwise]);
    const auto found = std::find(words.begin(), words.end(), word);
    if (found != words.end()) return size_t(found - words.begin());
    std::string all;
    for (const std::string& w : words) all += (all.empty() ? "" : " or ") + w;
    problem(parent[key], key, all, "'" + word + "'");
    return otherwise;
  }
  /// One number for all planes, or three.
  std::array<float, 3> planes(const YAML::Node& parent, const char* key, float otherwise, bool positive) {
    std::array<float, 3> values = {otherwise, otherwise, otherwise};
    const YAML::Node node = parent ? parent[key] : YAML::Node(YAML::NodeType::Undefined);
    if (!node) return values;
    const bool list = node.IsSequence() && node.size() == 3;
    for (size_t i = 0; i < 3; ++i) {
      const YAML::Node entry = list ? node[i] : node;
      const auto number = entry.IsScalar() ? parse_number(entry.Scalar()) : std::nullopt;
      if (!number || !std::isfinite(*number) || (positive && !(*number > 0))) {
        problem(node, key, std::string(positive ? "a number above 0" : "a number") + ", or three of them, one a plane");
        break;
      }
      values[i] = float(*number);
    }
    return values;
  }
};

void read_size(const YAML::Node& input, NetDescription& net, Reader& reader) {
  const YAML::Node size = input ? input["size"] : YAML::Node(YAML::NodeType::Undefined);
  if (!size) return;
  int64_t sides[2] = {0, 0};
  bool good = size.IsSequence() && size.size() == 2;
  for (size_t i = 0; good && i < 2; ++i) {
    const auto number = size[i].IsScalar() ? parse_integer(size[i].Scalar()) : std::nullopt;
    good = number && *number >= 1 && *number <= kMostPixelsAcross;
    if (good) sides[i] = *number;
  }
  if (!good) reader.problem(size, "size", "[width, height] from 1 to " + std::to_string(kMostPixelsAcross));
  net.width = int(sides[0]), net.height = int(sides[1]);
}

/// A list of names, or the name of a text file with one a line.
void read_classes(const YAML::Node& root, const fs::path& folder, NetDescription& net, Reader& reader) {
  const YAML::Node node = root["classes"];
  if (!node) {
    reader.problem(root, "classes", "the names of the network's classes in order, or a file with one a line",
                   "nothing");
    return;
  }
  if (node.IsScalar()) {
    const fs::path file = folder / node.Scalar();
    const std::string text = read_whole_file(file, kLimitBytes);
    for (LineReader lines(text, file); lines.next();) net.classes.emplace_back(lines.line());
  } else if (node.IsSequence()) {
    for (const YAML::Node& name : node) {
      if (!name.IsScalar() || name.Scalar().empty()) reader.problem(name, "classes", "a name");
      net.classes.push_back(name.IsScalar() ? name.Scalar() : "");
    }
  }
  std::set<std::string> seen;
  for (const std::string& name : net.classes)
    if (!seen.insert(name).second) reader.problem(node, "classes", "each name once", "'" + name + "' again");
  if (net.classes.empty()) reader.problem(node, "classes", "at least one name", "none");
}

void read_mapping(const YAML::Node& root, NetDescription& net, Reader& reader) {
  const YAML::Node node = root["map"];
  if (!node) return;
  if (!node.IsMap()) {
    reader.problem(node, "map", "network class: class of the map, or none");
    return;
  }
  for (const auto& entry : node) {
    if (!entry.first.IsScalar() || !entry.second.IsScalar()) {
      reader.problem(entry.first, "map", "two names");
      continue;
    }
    const std::string& from = entry.first.Scalar();
    if (std::find(net.classes.begin(), net.classes.end(), from) == net.classes.end())
      reader.problem(entry.first, "map", "a class of the network", "'" + from + "'");
    else if (!net.mapping.emplace(from, entry.second.Scalar()).second)
      reader.problem(entry.first, "map", "each class once", "'" + from + "' again");
  }
}

/// Name in the user's table of a class of the network.
std::string target_name(const NetDescription& net, const std::string& name) {
  const auto mapped = net.mapping.find(name);
  return mapped != net.mapping.end() ? mapped->second : name;
}

}  // namespace

NetDescription read_net_description(const fs::path& path) {
  NetDescription net;
  net.described_in = path;
  const std::string content = read_whole_file(path, kLimitBytes);
  Reader reader(path.string());
  try {
    const YAML::Node root = YAML::Load(content);
    if (!root.IsMap())
      throw ConfigError(describe_mismatch(path.string(), "network description", "keys and values", "something else"));
    reader.refuse_unknown(root, {"file", "backend", "input", "output", "classes", "map", "otherwise", "comment"});
    const std::string file = reader.text(root, "file", "");
    if (file.empty()) reader.problem(root, "file", "an ONNX model", "nothing");
    net.file = path.parent_path() / file;
    std::error_code fault;  // such as a name that is too long
    if (!file.empty() && !fs::is_regular_file(net.file, fault))
      reader.problem(root["file"], "file", "an ONNX model that exists", "'" + net.file.string() + "'");
    net.backend = NetBackend(reader.choice(root, "backend", {"automatic", "opencv", "onnxruntime"}, 0));
    const YAML::Node input = reader.table(root, "input", {"name", "size", "order", "scale", "mean", "std"});
    net.input = reader.text(input, "name", "");
    read_size(input, net, reader);
    net.bgr = reader.choice(input, "order", {"rgb", "bgr"}, 0) == 1;
    net.scale = reader.planes(input, "scale", net.scale, true)[0];
    net.mean = reader.planes(input, "mean", 0, false);
    net.std = reader.planes(input, "std", 1, true);
    const YAML::Node output = reader.table(root, "output", {"name", "kind"});
    net.output = reader.text(output, "name", "");
    net.kind = NetOutput(reader.choice(output, "kind", {"probabilities", "logits", "labels"}, 0));
    read_classes(root, path.parent_path(), net, reader);
    read_mapping(root, net, reader);
    if (root["otherwise"]) net.otherwise = reader.text(root, "otherwise", kNoClassName);
  } catch (const YAML::Exception& fault) {
    reader.problems.push_back(yaml_fault(path.string(), fault));
  }
  if (!reader.problems.empty()) throw ConfigError(reader.problems);
  return net;
}

ClassTable own_class_table(const NetDescription& net) {
  std::vector<ClassInfo> classes = {{0, kNoClassName, {0, 0, 0, 255}, true}};
  std::set<std::string> names = {kNoClassName};
  const auto add = [&](const std::string& name) {
    if (names.insert(name).second)
      classes.push_back({uint16_t(classes.size()), name, default_class_color(int(classes.size()) - 1), false});
  };
  // `otherwise` is for classes that a given table lacks; here every class has a place of its own.
  for (const std::string& name : net.classes) add(target_name(net, name));
  return ClassTable(std::move(classes));
}

std::vector<uint16_t> map_classes(const NetDescription& net, const ClassTable& table) {
  const auto known = [&](const std::string& name) {
    return name == kNoClassName || std::any_of(table.classes().begin(), table.classes().end(),
                                               [&](const ClassInfo& c) { return c.name == name; });
  };
  std::vector<std::string> problems;
  const auto where = net.described_in.string();
  for (const auto& [from, to] : net.mapping)
    if (!known(to))
      problems.push_back(describe_mismatch(where, "map: " + from, "a class of the table", "'" + to + "'"));
  if (net.otherwise && !known(*net.otherwise))
    problems.push_back(describe_mismatch(where, "otherwise", "a class of the table", "'" + *net.otherwise + "'"));
  std::vector<uint16_t> slots;
  std::vector<std::string> homeless;
  for (const std::string& name : net.classes) {
    std::string target = target_name(net, name);
    if (!net.mapping.contains(name) && !known(target)) {
      if (net.otherwise)
        target = *net.otherwise;
      else
        homeless.push_back(name);
    }
    const std::optional<int> slot = target == kNoClassName ? std::nullopt : table.slot_of_name(target);
    slots.push_back(slot ? uint16_t(*slot) : ClassTable::kNoSlot);
  }
  if (!homeless.empty())
    problems.push_back(describe_mismatch(where, "map", "a place in the class table for every class of the network",
                                         "none for " + listed(homeless) + " (map them, or say `otherwise: none`)"));
  if (std::all_of(slots.begin(), slots.end(), [](uint16_t s) { return s == ClassTable::kNoSlot; }) && problems.empty())
    problems.push_back(
        describe_mismatch(where, "map", "at least one class of the network in the class table", "all of them none"));
  if (!problems.empty()) throw ConfigError(problems);
  return slots;
}

}  // namespace felt
