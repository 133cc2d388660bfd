#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "core/camera.h"
#include "core/image.h"
#include "io/sequence/sequence_options.h"

namespace felt {

/// One way to read a sequence's numbers: what the doctor compares. The defaults are the sequence as it is read now.
struct Reading {
  PoseConvention convention;
  double depth_factor = 1;      ///< on the depth as read
  bool ray_length = false;      ///< depth lies along the pixel's ray
  double focal_factor = 1;      ///< on fx and fy as read
  bool swapped_camera = false;  ///< fx, cx exchanged with fy, cy
  double pose_delay = 0;        ///< pose of a frame is the trajectory's at stamp + this: seconds, or frames
  bool w_first = false;         ///< quaternions of the poses, read as x y z w, are written w x y z
  bool operator==(const Reading&) const = default;
};

/// A decoded frame as the doctor keeps it: depth before any ray-length conversion, the pose before any convention.
struct SampledFrame {
  int64_t position = 0;  ///< in recorded order
  int64_t index = 0;     ///< frame number
  double stamp = 0;      ///< seconds, or the frame number
  DepthImage depth_m;
  ColorImage color;
  LabelImage labels;
  struct Point {
    float u, v, depth_m;
  };
  std::vector<Point> points;  ///< a few hundred measured pixels spread over the image
};

/// Poses of all frames of the sequence that have one, ascending stamps.
struct RecordedTrajectory {
  std::vector<int64_t> position, index;
  std::vector<double> stamp;
  std::vector<Eigen::Isometry3d> recorded;                          ///< before any convention
  Eigen::Isometry3d T_body_camera = Eigen::Isometry3d::Identity();  ///< where they are those of a body
  double spacing = 0;                                               ///< median difference of stamps
};

struct Pair {
  int a = 0, b = 0;  ///< of the sampled frames
};

/// How well a pair's surfaces meet under a reading.
struct PairScore {
  /// Mean over all of a's points of the logarithm of how much better they meet b's surface than a random depth would;
  /// points outside b's view count 0. About 3 for exact data, below 0 where surfaces contradict each other.
  double score = 0;
  double in_view = 0;   ///< share of a's points that fall on measured pixels of b
  double meets = 0;     ///< share of those within 4 % of b's depth
  double residual = 0;  ///< median |z / depth - 1| of those that meet
};

/// Projects each pair's points of `a` into `b`. `camera` as read now. Pairs whose pose cannot be had (delay beyond the
/// trajectory) score 0. `every`: only each n-th point, for a search.
std::vector<PairScore> cross_project(const std::vector<SampledFrame>& frames, const std::vector<Pair>& pairs,
                                     const RecordedTrajectory& trajectory, const PinholeCamera& camera,
                                     const Reading& reading, int every = 1);

/// The camera's pose that a recorded one means under a reading.
Eigen::Isometry3d pose_under(const Reading& reading, Eigen::Isometry3d recorded,
                             const Eigen::Isometry3d& T_body_camera);

/// The camera as a reading changes it.
PinholeCamera camera_of(const PinholeCamera& camera, const Reading& reading);

}  // namespace felt
