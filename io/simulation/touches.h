#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/property_table.h"
#include "io/simulation/label_network.h"
#include "io/simulation/render_sequence.h"

namespace felt {

/// One simulated contact and the truth about it.
struct SimulatedTouch {
  int64_t frame = 0;                                     ///< it happens when this frame is taken
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();  ///< on the surface, world frame
  double value = 0;                                      ///< the reading
  double sigma = 0;                                      ///< standard deviation of its measurement noise
  uint16_t instance = 0, material = 0;
};

struct TouchOptions {
  int count = 0;
  double sigma = 0;
  uint64_t seed = 1;
  /// Where given, only places are touched whose material this network, run with `seed`, mistakes in that frame.
  std::optional<LabelNetwork> mistaken_by = std::nullopt;
};

/// Touches spread evenly over the sequence, each on a surface that its frame sees: on the thing and material touched
/// least often so far (drawn among equals), at a pixel away from its border. Only materials with a prior are touched. A
/// reading is drawn from the prior's mean and sd, of which the share `rho` of the variance is common to all touches of
/// one thing, plus measurement noise, and kept in the property's support. Fewer than `count` where nothing can be
/// touched.
std::vector<SimulatedTouch> simulate_touches(const Scene& scene, const Trajectory& trajectory,
                                             const PinholeCamera& camera, const Property& property,
                                             const TouchOptions& options);

/// `frame,x,y,z,property,value,sigma` with one line a touch.
std::string touches_csv(const std::vector<SimulatedTouch>& touches, const std::string& property);

/// Friction against rubber of the materials of Table I of Ewen et al. 2024.
PropertyTable simulated_properties();

}  // namespace felt
