#include "mapping/fusion/view_novelty.h"

#include <algorithm>
#include <cmath>

namespace felt {

double ViewNovelty::add(const Eigen::Isometry3d& T_world_camera, double full_m, double full_deg) {
  if (full_m <= 0 && full_deg <= 0) return 1;
  double novelty = 1;
  for (const Eigen::Isometry3d& other : seen_) {
    double apart = 0;
    if (full_m > 0) apart = (T_world_camera.translation() - other.translation()).norm() / full_m;
    if (full_deg > 0 && apart < novelty) {
      const Eigen::AngleAxisd turn(T_world_camera.linear().transpose() * other.linear());
      apart = std::max(apart, std::abs(turn.angle()) * (180 / M_PI) / full_deg);
    }
    novelty = std::min(novelty, apart);
  }
  seen_.push_back(T_world_camera);
  return novelty;
}

}  // namespace felt
