#include "io/doctor/cross_projection.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "core/median.h"
#include "io/sequence/recorded_pose.h"
#include "io/sequence/trajectory_file.h"

namespace felt {
namespace {

/// Relative residual that counts as a match as good as a random one, and the one below which nothing is gained.
constexpr double kNeutral = 0.15, kFloor = 0.002;

/// Logarithm of the density of a relative residual against that of a random depth.
double point_score(double residual) {
  const double score = -std::log((std::abs(residual) + kFloor) / kNeutral);
  // Behind b's surface a point may be hidden; in front of it b looks through it.
  return std::max(score, residual > 0 ? -0.4 : -1.4);
}

/// Pose of the trajectory at the frame's stamp + delay, before any convention.
std::optional<Eigen::Isometry3d> recorded_at(const RecordedTrajectory& trajectory, const SampledFrame& frame,
                                             double delay) {
  const auto at = std::lower_bound(trajectory.position.begin(), trajectory.position.end(), frame.position);
  if (at == trajectory.position.end() || *at != frame.position) return std::nullopt;
  const size_t own = size_t(at - trajectory.position.begin());
  if (delay == 0) return trajectory.recorded[own];
  const double stamp = frame.stamp + delay;
  const auto after = std::upper_bound(trajectory.stamp.begin(), trajectory.stamp.end(), stamp);
  // Outside the trajectory its first or last step is prolonged, by at most its own length.
  const size_t count = trajectory.stamp.size();
  if (count < 2) return std::nullopt;
  const size_t b = std::clamp(size_t(after - trajectory.stamp.begin()), size_t(1), count - 1);
  const double from = trajectory.stamp[b - 1], step = trajectory.stamp[b] - from, share = (stamp - from) / step;
  if (!(step > 0) || step > 3.5 * trajectory.spacing || share < -1.5 || share > 2.5) return std::nullopt;
  return interpolated_pose(trajectory.recorded[b - 1], trajectory.recorded[b], share);
}

/// Depth along the axis per depth along the ray.
double axis_share(const PinholeCamera& camera, double u, double v) { return 1 / camera.ray(u, v).norm(); }

/// Depth of the surface that b saw at the real pixel (x, y), 0 where nothing was measured. Between four pixels of one
/// surface inverse depth is linear, which is exact for planes: the nearest pixel alone is wrong by more than a sensor
/// where floors run away from the camera, and readings that move the camera less would win for needing it less.
double depth_between(const DepthImage& depth_m, double x, double y) {
  const double nearest = depth_m(int(std::floor(x + 0.5)), int(std::floor(y + 0.5)));
  const int u = int(std::floor(x)), v = int(std::floor(y));
  if (u < 0 || v < 0 || u + 1 >= depth_m.width() || v + 1 >= depth_m.height()) return nearest;
  const float *above = depth_m.row(v) + u, *below = depth_m.row(v + 1) + u;
  const auto [least, most] = std::minmax({above[0], above[1], below[0], below[1]});
  constexpr float kOneSurface = 1.1f;
  if (!(least > 0) || most > kOneSurface * least) return nearest;
  const double a = x - u, b = y - v;
  return 1 / ((1 - b) * ((1 - a) / above[0] + a / above[1]) + b * ((1 - a) / below[0] + a / below[1]));
}

PairScore score_pair(const SampledFrame& a, const SampledFrame& b, const Eigen::Isometry3d& T_b_a,
                     const PinholeCamera& camera, const Reading& reading, size_t every) {
  PairScore result;
  std::vector<double> residuals;
  size_t in_view = 0;
  double sum = 0;
  size_t total = 0;
  for (size_t i = 0; i < a.points.size(); i += every) {
    const SampledFrame::Point& point = a.points[i];
    ++total;
    double z = point.depth_m * reading.depth_factor;
    if (reading.ray_length) z *= axis_share(camera, point.u, point.v);
    const Eigen::Vector3d p = T_b_a * (z * camera.ray(point.u, point.v));
    if (p.z() <= 0) continue;
    const Eigen::Vector2d pixel = camera.project(p);
    const double x = pixel.x(), y = pixel.y();
    if (!(x >= -0.5 && y >= -0.5 && x < camera.width - 0.5 && y < camera.height - 0.5)) continue;
    double depth = depth_between(b.depth_m, x, y) * reading.depth_factor;
    if (depth <= 0) continue;
    if (reading.ray_length) depth *= axis_share(camera, x, y);
    const double residual = p.z() / depth - 1;
    ++in_view;
    sum += point_score(residual);
    if (std::abs(residual) < 0.04) residuals.push_back(std::abs(residual));
  }
  result.score = sum / double(std::max<size_t>(1, total));
  result.in_view = double(in_view) / double(std::max<size_t>(1, total));
  if (in_view > 0) result.meets = double(residuals.size()) / double(in_view);
  if (!residuals.empty()) result.residual = median(std::move(residuals));
  return result;
}

}  // namespace

Eigen::Isometry3d pose_under(const Reading& reading, Eigen::Isometry3d recorded,
                             const Eigen::Isometry3d& T_body_camera) {
  if (reading.w_first) {
    // What was taken for x, y, z, w was w, x, y, z. Poses that were interpolated meanwhile are the same: the exchange
    // turns the space of quaternions.
    const Eigen::Quaterniond taken(recorded.linear());
    recorded.linear() = Eigen::Quaterniond(taken.x(), taken.y(), taken.z(), taken.w()).toRotationMatrix();
  }
  return camera_pose(recorded, reading.convention, T_body_camera);
}

PinholeCamera camera_of(const PinholeCamera& camera, const Reading& reading) {
  PinholeCamera c = camera;
  if (reading.swapped_camera) {
    std::swap(c.fx, c.fy);
    std::swap(c.cx, c.cy);
  }
  c.fx *= reading.focal_factor, c.fy *= reading.focal_factor;
  return c;
}

std::vector<PairScore> cross_project(const std::vector<SampledFrame>& frames, const std::vector<Pair>& pairs,
                                     const RecordedTrajectory& trajectory, const PinholeCamera& camera,
                                     const Reading& reading, int every) {
  const PinholeCamera read_camera = camera_of(camera, reading);
  std::vector<std::optional<Eigen::Isometry3d>> poses(frames.size());
  for (size_t i = 0; i < frames.size(); ++i)
    if (const auto recorded = recorded_at(trajectory, frames[i], reading.pose_delay))
      poses[i] = pose_under(reading, *recorded, trajectory.T_body_camera);
  std::vector<PairScore> scores(pairs.size());
  tbb::parallel_for(size_t(0), pairs.size(), [&](size_t i) {
    const auto [a, b] = pairs[i];
    if (poses[size_t(a)] && poses[size_t(b)])
      scores[i] = score_pair(frames[size_t(a)], frames[size_t(b)], poses[size_t(b)]->inverse() * *poses[size_t(a)],
                             read_camera, reading, size_t(every));
  });
  return scores;
}

}  // namespace felt
