#pragma once

#include <Eigen/Geometry>
#include <utility>
#include <vector>

namespace felt {

/// How new a viewpoint is against all earlier ones, in [0, 1]: the smallest over them of max(distance / `full_m`, angle
/// / `full_deg`), at most 1; a limit of 0 is left out, and with both 0 every view is new. What a camera adds follows
/// the way it went and not its frame rate, and standing still adds nothing.
class ViewNovelty {
public:
  /// Novelty of a view, which is then one of the earlier ones.
  double add(const Eigen::Isometry3d& T_world_camera, double full_m, double full_deg);
  /// Earlier views, which a run that goes on begins with.
  const std::vector<Eigen::Isometry3d>& seen() const { return seen_; }
  void set_seen(std::vector<Eigen::Isometry3d> views) { seen_ = std::move(views); }

private:
  std::vector<Eigen::Isometry3d> seen_;
};

}  // namespace felt
