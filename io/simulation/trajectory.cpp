#include "io/simulation/trajectory.h"

#include <algorithm>
#include <cmath>

namespace felt {
namespace {

using Eigen::Vector3d;

/// Uniform Catmull-Rom spline through way-points, end points repeated; s in [0, path.size() - 1].
WayPoint spline(std::span<const WayPoint> path, double s) {
  const int last = int(path.size()) - 1, i = std::clamp(int(std::floor(s)), 0, std::max(last - 1, 0));
  const double t = s - i, t2 = t * t, t3 = t2 * t;
  const WayPoint &a = path[std::max(i - 1, 0)], &b = path[i], &c = path[std::min(i + 1, last)],
                 &d = path[std::min(i + 2, last)];
  const auto blend = [&](const Vector3d& p0, const Vector3d& p1, const Vector3d& p2, const Vector3d& p3) -> Vector3d {
    return 0.5 * (2 * p1 + (p2 - p0) * t + (2 * p0 - 5 * p1 + 4 * p2 - p3) * t2 + (3 * p1 - p0 - 3 * p2 + p3) * t3);
  };
  return {blend(a.position_m, b.position_m, c.position_m, d.position_m),
          blend(a.look_at_m, b.look_at_m, c.look_at_m, d.look_at_m)};
}

}  // namespace

Eigen::Isometry3d look_at(const Vector3d& position_m, const Vector3d& target_m) {
  const Vector3d forward = (target_m - position_m).normalized(), right = forward.cross(Vector3d::UnitZ()).normalized();
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() << right, forward.cross(right), forward;
  T.translation() = position_m;
  return T;
}

Trajectory walk_through(std::span<const WayPoint> path, int frames) {
  // Length by fine sampling of position and gaze together, so that turning on the spot takes its share of frames too.
  constexpr int kSamples = 64;
  const int count = std::max(int(path.size()) - 1, 0) * kSamples;
  std::vector<double> length_m(count + 1, 0.0);
  for (int i = 1; i <= count; ++i) {
    const WayPoint a = spline(path, double(i - 1) / kSamples), b = spline(path, double(i) / kSamples);
    length_m[i] = length_m[i - 1] + (b.position_m - a.position_m).norm() + 0.3 * (b.look_at_m - a.look_at_m).norm();
  }
  Trajectory trajectory;
  for (int frame = 0; frame < frames; ++frame) {
    const double wanted_m = frames > 1 ? length_m.back() * frame / (frames - 1) : 0;
    const int i = std::clamp(int(std::lower_bound(length_m.begin(), length_m.end(), wanted_m) - length_m.begin()), 1,
                             std::max(count, 1));
    double s = 0;
    if (count > 0) {
      const double step_m = length_m[i] - length_m[i - 1];
      s = (i - 1 + (step_m > 0 ? (wanted_m - length_m[i - 1]) / step_m : 0)) / kSamples;
    }
    const WayPoint w = spline(path, s);
    trajectory.push_back(look_at(w.position_m, w.look_at_m));
  }
  return trajectory;
}

Trajectory orbit(const Vector3d& center_m, double radius_m, double height_m, double turn_rad, int frames) {
  Trajectory trajectory;
  for (int frame = 0; frame < frames; ++frame) {
    const double angle = turn_rad * frame / frames;
    trajectory.push_back(
        look_at(center_m + Vector3d(radius_m * std::cos(angle), radius_m * std::sin(angle), height_m), center_m));
  }
  return trajectory;
}

Trajectory sweep(const Vector3d& position_m, double yaw_rad, double turn_rad, double pitch_rad, int frames) {
  Trajectory trajectory;
  for (int frame = 0; frame < frames; ++frame) {
    const double yaw = yaw_rad + (frames > 1 ? turn_rad * frame / (frames - 1) : 0);
    const Vector3d gaze(std::cos(yaw) * std::cos(pitch_rad), std::sin(yaw) * std::cos(pitch_rad), std::sin(pitch_rad));
    trajectory.push_back(look_at(position_m, position_m + gaze));
  }
  return trajectory;
}

Trajectory standard_trajectory(const Scene& scene, int frames) { return walk_through(scene.path, frames); }

double clearance_m(const Scene& scene, const Trajectory& trajectory) {
  double smallest_m = HUGE_VAL;
  for (const auto& T : trajectory) smallest_m = std::min(smallest_m, signed_distance_m(scene, T.translation()));
  return smallest_m;
}

}  // namespace felt
