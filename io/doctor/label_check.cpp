#include "io/doctor/label_check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "core/text.h"

namespace felt {
namespace {

enum class Lie { any, up, upright, down };

/// How surfaces of a class lie, by the words of its name.
Lie expected_lie(const std::string& name) {
  static const std::map<std::string, Lie> lies = {
      {"floor", Lie::up},        {"ground", Lie::up},       {"carpet", Lie::up},
      {"rug", Lie::up},          {"road", Lie::up},         {"sidewalk", Lie::up},
      {"grass", Lie::up},        {"desk", Lie::up},         {"snow", Lie::up},
      {"ice", Lie::up},          {"asphalt", Lie::up},      {"gravel", Lie::up},
      {"sand", Lie::up},         {"soil", Lie::up},         {"counter", Lie::up},
      {"wall", Lie::upright},    {"door", Lie::upright},    {"window", Lie::upright},
      {"picture", Lie::upright}, {"curtain", Lie::upright}, {"whiteboard", Lie::upright},
      {"mirror", Lie::upright},  {"blinds", Lie::upright},  {"ceiling", Lie::down}};
  for (size_t at = 0; at < name.size();) {
    const size_t end = std::min(name.find_first_of(" _-/", at), name.size());
    if (const auto found = lies.find(name.substr(at, end - at)); found != lies.end()) return found->second;
    at = end + 1;
  }
  return Lie::any;
}

/// Labelled pixels by stored id: how many, and how many face up, sideways or down.
struct Counts {
  double pixels = 0, up = 0, upright = 0, down = 0;
};

Eigen::Vector3d mean_up(const std::vector<Eigen::Isometry3d>& poses) {
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  for (const Eigen::Isometry3d& T : poses) up -= T.linear().col(1);
  return up.normalized();
}

/// Normal of the surface at a pixel towards the camera, in the camera's frame; zero at depth edges.
Eigen::Vector3d normal_at(const DepthImage& depth_m, const PinholeCamera& camera, const Reading& reading, int u,
                          int v) {
  constexpr int kApart = 3;
  const auto point = [&](int x, int y) -> Eigen::Vector3d {
    double z = depth_m(x, y) * reading.depth_factor;
    if (reading.ray_length) z /= camera.ray(x, y).norm();
    return z * camera.ray(x, y);
  };
  if (u < kApart || v < kApart || u + kApart >= depth_m.width() || v + kApart >= depth_m.height())
    return Eigen::Vector3d::Zero();
  const Eigen::Vector3d left = point(u - kApart, v), right = point(u + kApart, v), above = point(u, v - kApart),
                        below = point(u, v + kApart);
  const double z = depth_m(u, v) * reading.depth_factor;
  for (const Eigen::Vector3d& p : {left, right, above, below})
    if (p.z() <= 0 || std::abs(p.z() - z) > 0.1 * z) return Eigen::Vector3d::Zero();
  const Eigen::Vector3d normal = (right - left).cross(below - above);
  return normal.dot(left) > 0 ? (-normal).normalized() : normal.normalized();
}

std::map<int, Counts> count_labels(const GeometrySample& sample, const Reading& reading) {
  const PinholeCamera camera = camera_of(sample.camera, reading);
  std::vector<Eigen::Isometry3d> poses;
  std::vector<const SampledFrame*> frames;
  for (const SampledFrame& frame : sample.frames) {
    const auto& positions = sample.trajectory.position;
    const auto at = std::lower_bound(positions.begin(), positions.end(), frame.position);
    if (frame.labels.empty() || at == positions.end() || *at != frame.position) continue;
    poses.push_back(pose_under(reading, sample.trajectory.recorded[size_t(at - positions.begin())],
                               sample.trajectory.T_body_camera));
    frames.push_back(&frame);
  }
  const Eigen::Vector3d up = frames.empty() ? Eigen::Vector3d::UnitZ() : mean_up(poses);
  std::map<int, Counts> counts;
  for (size_t i = 0; i < frames.size(); ++i) {
    const LabelImage& labels = frames[i]->labels;
    for (int v = 4; v < labels.height(); v += 8)
      for (int u = 4; u < labels.width(); u += 8) {
        if (labels(u, v) == kNoLabel) continue;
        Counts& c = counts[labels(u, v)];
        ++c.pixels;
        const Eigen::Vector3d normal = normal_at(frames[i]->depth_m, camera, reading, u, v);
        if (normal.isZero()) continue;
        const double along = (poses[i].linear() * normal).dot(up);
        c.up += along > 0.8;
        c.upright += std::abs(along) < 0.5;
        c.down += along < -0.8;
      }
  }
  return counts;
}

/// What the labels look like when `offset` is added to every id.
struct Fit {
  double unknown = 0;    ///< share of pixels whose id the table lacks
  double named = 0;      ///< share of pixels, with a normal, of classes whose lie is known
  double lies_well = 0;  ///< share of those that lie as named
};

Fit fit_of(const std::map<int, Counts>& counts, const ClassTable& classes, int offset) {
  double total = 0, unknown = 0, named = 0, well = 0;
  for (const auto& [stored, c] : counts) {
    const int id = stored + offset;
    total += c.pixels;
    const bool known = id >= 0 && classes.known(uint16_t(id));
    if (!known) unknown += c.pixels;
    if (!known) continue;
    const auto info = std::find_if(classes.classes().begin(), classes.classes().end(),
                                   [&](const ClassInfo& candidate) { return candidate.id == id; });
    const Lie lie = expected_lie(info->name);
    if (lie == Lie::any) continue;
    named += c.up + c.upright + c.down;
    well += lie == Lie::up ? c.up : lie == Lie::upright ? c.upright : c.down;
  }
  return {unknown / std::max(1.0, total), named / std::max(1.0, total), well / std::max(1.0, named)};
}

}  // namespace

std::optional<Finding> check_labels(const GeometrySample& sample, const Reading& reading, const ClassTable& classes,
                                    int label_offset) {
  const std::map<int, Counts> counts = count_labels(sample, reading);
  if (counts.empty()) return std::nullopt;
  Finding finding{"labels", false, 0.5, "", "", ""};
  const std::string range =
      "ids " + std::to_string(counts.begin()->first) + " to " + std::to_string(counts.rbegin()->first);
  if (classes.empty()) {
    finding.belief = "labels without a class table: ids are taken as they are";
    finding.evidence = range;
    return finding;
  }
  const std::array<int, 3> offsets = {0, -1, 1};
  std::array<Fit, 3> fits;
  for (size_t i = 0; i < 3; ++i) fits[i] = fit_of(counts, classes, offsets[i]);
  // A class counts for as much as it covers: few named pixels that happen to lie well prove little.
  const auto value = [](const Fit& fit) { return fit.named * (fit.lies_well - 0.5) - 2 * fit.unknown; };
  const size_t best = size_t(
      std::max_element(fits.begin(), fits.end(), [&](const Fit& a, const Fit& b) { return value(a) < value(b); }) -
      fits.begin());
  const auto percent = [](double share) { return number_text(100 * share, "%.1f") + " %"; };
  const auto text = [&](const Fit& fit) {
    return percent(fit.unknown) + " of pixels are of no class of the table, " +
           (fit.named > 0 ? percent(fit.lies_well) + " of floors, walls and ceilings lie as such"
                          : "none is a floor or wall");
  };
  finding.evidence = range + "; " + text(fits[0]);
  const double gain = value(fits[best]) - value(fits[0]);
  // That other names would lie as such too accuses nobody: the own names must lie badly, or be none.
  const bool tells = fits[0].unknown > 0.01 || (fits[0].named > 0.02 && fits[0].lies_well < fits[best].lies_well - 0.1);
  if (best != 0 && gain > 0.05 && tells) {
    finding.faulty = true;
    finding.confidence = std::min(0.99, 0.6 + gain);
    finding.belief = std::string("labels as read now are one ") + (offsets[best] < 0 ? "above" : "below") +
                     " the ids of the class table";
    finding.evidence += "; moved by " + std::to_string(offsets[best]) + ": " + text(fits[best]);
    const int mended = label_offset + offsets[best];
    finding.remedy = mended == 0 ? "leave out --label-offset" : "--label-offset " + std::to_string(mended);
  } else if (fits[0].unknown > 0.01) {
    std::vector<std::string> ids;
    for (const auto& [stored, c] : counts)
      if (!classes.known(uint16_t(stored))) ids.push_back(std::to_string(stored));
    finding.faulty = true;
    finding.confidence = 0.9;
    finding.belief = "labels hold ids that the class table lacks: " + listed(ids);
    finding.remedy = "--classes with a table that names them";
  } else {
    finding.belief = "labels are ids of the class table";
    finding.confidence = fits[0].named > 0.05 ? std::clamp(fits[0].lies_well, 0.5, 0.99) : 0.7;
  }
  return finding;
}

}  // namespace felt
