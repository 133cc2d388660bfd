#pragma once

#include <array>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/class_table.h"

namespace felt {

/// Which library runs a network.
enum class NetBackend { automatic, opencv, onnxruntime };

/// What a network's output holds: k planes of probabilities or, before the softmax, logits; or one plane of class
/// numbers.
enum class NetOutput { probabilities, logits, labels };

/// Largest width or height of a network's input.
inline constexpr int kMostPixelsAcross = 8192;

/// A segmentation network as `net.yaml` describes it (docs/perception.md).
struct NetDescription {
  std::filesystem::path described_in;  ///< for messages
  std::filesystem::path file;          ///< ONNX model
  NetBackend backend = NetBackend::automatic;
  std::string input, output;  ///< names; empty: the only one of the model
  int width = 0, height = 0;  ///< of the network's input; 0: as the model says or, where it leaves it open, the image's
  bool bgr = false;           ///< order of the colour planes
  /// A colour value v of 0 .. 255 goes in as (v * scale - mean) / std.
  float scale = 1.0f / 255;
  std::array<float, 3> mean = {0, 0, 0}, std = {1, 1, 1};  ///< by plane, in the network's order
  NetOutput kind = NetOutput::probabilities;
  std::vector<std::string> classes;  ///< in the order of the output's planes
  /// Names of the network's classes to names of the user's class table; "none": pixels of this class carry no label.
  std::map<std::string, std::string> mapping;
  std::optional<std::string> otherwise;  ///< for classes that are neither mapped nor in the table by the same name
};

/// Reads `net.yaml`; relative paths in it are relative to it. Throws IoError where it cannot be read and ConfigError
/// with every problem at once, each with path:line.
NetDescription read_net_description(const std::filesystem::path& path);

/// What `net.yaml` calls a class that is none.
inline constexpr const char* kNoClassName = "none";

/// The classes that the network can tell apart after its mapping, as a table of their own, for users who have none: id
/// 0 is "none" and ignored, the others are numbered from 1 in the order of the network's classes.
ClassTable own_class_table(const NetDescription& net);

/// Slot in `table` of each of the network's classes, ClassTable::kNoSlot where it carries no label: mapped to "none" or
/// to an ignored class. Throws ConfigError that names every class without a place in the table, and every mapping to a
/// class that the table lacks.
std::vector<uint16_t> map_classes(const NetDescription& net, const ClassTable& table);

}  // namespace felt
