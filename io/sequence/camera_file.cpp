#include "io/sequence/camera_file.h"

#include <yaml-cpp/yaml.h>

#include <cmath>

#include "core/error.h"
#include "core/text.h"
#include "io/files/text_input.h"
#include "io/files/yaml_problems.h"
#include "io/images/image_decode.h"

namespace felt {
namespace fs = std::filesystem;
namespace {

constexpr size_t kLimitBytes = 1 << 20;

double first_number(const YAML::Node& node, std::initializer_list<const char*> keys) {
  for (const char* key : keys)
    if (node[key] && node[key].IsScalar()) return node[key].as<double>();
  return 0;
}

/// Width or height of the images; 0: not given.
int side_of(const YAML::Node& camera, std::initializer_list<const char*> keys, const fs::path& path) {
  const double side = first_number(camera, keys);
  if (!(side >= 0 && side <= double(kMaxImagePixels)))
    throw FormatError(describe_mismatch(path.string(), *keys.begin(), "pixels", std::to_string(side)));
  return int(side);
}

CameraFile read_structured(const fs::path& path, const std::string& content) {
  CameraFile file;
  try {
    const YAML::Node root = YAML::Load(content);
    if (!root.IsMap())
      throw FormatError(describe_mismatch(path.string(), "camera", "an object with fx, fy, cx, cy", "none"));
    const YAML::Node camera = root["camera"] && root["camera"].IsMap() ? root["camera"] : root;
    file.width = side_of(camera, {"width", "w"}, path);
    file.height = side_of(camera, {"height", "h"}, path);
    file.depth_scale = first_number(camera, {"depth_scale", "scale"});
    if (const YAML::Node matrix = camera["intrinsic_matrix"]; matrix && matrix.IsSequence()) {
      const auto m = matrix.as<std::vector<double>>();
      if (m.size() != 9)
        throw FormatError(describe_mismatch(path.string(), "intrinsic_matrix", "9 numbers", std::to_string(m.size())));
      // Column-major in Open3D's files.
      file.intrinsics = intrinsics_of_numbers({m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8]}, path.string());
    } else {
      file.intrinsics = intrinsics_of_numbers({first_number(camera, {"fx"}), first_number(camera, {"fy"}),
                                               first_number(camera, {"cx"}), first_number(camera, {"cy"})},
                                              path.string());
    }
  } catch (const YAML::Exception& fault) {
    throw FormatError(yaml_fault(path.string(), fault, "camera"));
  }
  return file;
}

}  // namespace

Intrinsics intrinsics_of_numbers(const std::vector<double>& n, const std::string& where) {
  Intrinsics k;
  if (n.size() == 4)
    k = {n[0], n[1], n[2], n[3]};
  else if (n.size() == 9)
    k = {n[0], n[4], n[2], n[5]};
  else if (n.size() == 16)
    k = {n[0], n[5], n[2], n[6]};
  else
    throw FormatError(
        describe_mismatch(where, "camera matrix", "3x3, 4x4 or fx fy cx cy", std::to_string(n.size()) + " numbers"));
  const bool lower_left_is_zero =
      n.size() == 4 || (n.size() == 9 ? n[3] == 0 && n[6] == 0 && n[7] == 0 : n[4] == 0 && n[8] == 0 && n[9] == 0);
  const bool finite = std::isfinite(k.fx) && std::isfinite(k.fy) && std::isfinite(k.cx) && std::isfinite(k.cy);
  if (!lower_left_is_zero || !finite || k.fx <= 0 || k.fy <= 0)
    throw FormatError(describe_mismatch(where, "camera matrix", "[fx 0 cx; 0 fy cy; 0 0 1] with fx, fy > 0",
                                        "fx " + std::to_string(k.fx) + ", fy " + std::to_string(k.fy) + ", cx " +
                                            std::to_string(k.cx) + ", cy " + std::to_string(k.cy) +
                                            negative_focal_hint(k.fy)));
  return k;
}

std::string negative_focal_hint(double fy) {
  if (!(fy < 0)) return {};
  // K diag(1, -1, 1) has the positive fy; poses T become M T M, which stay rotations, and the world is mirrored.
  return " (a negative fy is a camera whose y axis points up, as ICL-NUIM's: give it without the sign, as by "
         "--intrinsics, and poses mirrored alike, M T M with M = diag(1, -1, 1, 1), that is tx -ty tz -qx qy -qz qw)";
}

CameraFile read_camera_file(const fs::path& path) {
  const std::string content = read_whole_file(path, kLimitBytes);
  const std::string extension = path.extension().string();
  if (extension == ".json" || extension == ".yaml" || extension == ".yml") return read_structured(path, content);
  std::vector<double> numbers;
  LineReader lines(content, path);
  while (lines.next() && numbers.size() < 17) {
    const std::vector<double> row = parse_numbers(lines.line(), lines.where());
    numbers.insert(numbers.end(), row.begin(), row.end());
  }
  return {intrinsics_of_numbers(numbers, path.string())};
}

void check_camera_fits_image(const PinholeCamera& camera, const std::string& where, const std::string& lacking_file) {
  const auto angle_deg = [](double focal, int pixels) {
    return 2 * std::atan(pixels / (2 * focal)) * 180 / 3.14159265358979;
  };
  const double across = angle_deg(camera.fx, camera.width), down = angle_deg(camera.fy, camera.height);
  const bool inside = camera.cx > 0 && camera.cx < camera.width && camera.cy > 0 && camera.cy < camera.height;
  if (inside && across > 5 && across < 170 && down > 5 && down < 170) return;
  const std::string found = lacking_file.empty()
                                ? "fx " + std::to_string(camera.fx) + ", fy " + std::to_string(camera.fy) + ", cx " +
                                      std::to_string(camera.cx) + ", cy " + std::to_string(camera.cy)
                                : "the layout's default " +
                                      to_string(Intrinsics{camera.fx, camera.fy, camera.cx, camera.cy}) +
                                      "; give --intrinsics fx,fy,cx,cy or a " + lacking_file;
  throw FormatError(describe_mismatch(where, "intrinsics",
                                      "a camera of " + size_text(camera.width, camera.height) + " images", found));
}

}  // namespace felt
