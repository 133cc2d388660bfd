#include "io/doctor/proposal.h"

#include <algorithm>
#include <cmath>

namespace felt {
namespace {

/// Standard deviation of a structured-light camera's depth at z metres (Nguyen, Izadi and Lovell 2012).
double sensor_noise_m(double z) { return 0.0012 + 0.0019 * (z - 0.4) * (z - 0.4); }

/// The largest of 1, 1.5, 2, 3, 4, 5, 6, 8 times a power of ten that is not above `value`.
double round_down(double value) {
  const double decade = std::pow(10, std::floor(std::log10(value) + 1e-9));
  double best = decade;
  for (const double step : {1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0})
    if (step * decade <= value * (1 + 1e-9)) best = step * decade;
  return best;
}

}  // namespace

MapProposal propose(const GeometrySample& sample, const Reading& reading) {
  MapProposal proposal;
  const PinholeCamera camera = camera_of(sample.camera, reading);
  std::vector<double> depths;
  for (const SampledFrame& frame : sample.frames)
    for (const SampledFrame::Point& point : frame.points) {
      const double depth = point.depth_m * reading.depth_factor;
      depths.push_back(reading.ray_length ? depth / camera.ray(point.u, point.v).norm() : depth);
    }
  if (depths.empty()) return proposal;
  std::sort(depths.begin(), depths.end());
  const auto quantile = [&](double q) { return depths[size_t(q * double(depths.size() - 1))]; };
  proposal.median_depth_m = quantile(0.5);
  proposal.far_depth_m = quantile(0.98);
  proposal.pixel_m = proposal.median_depth_m / std::max(camera.fx, camera.fy);
  const double finest = std::max(3 * proposal.pixel_m, 1.5 * sensor_noise_m(proposal.median_depth_m));
  proposal.voxel_size_m = round_down(std::clamp(finest, 0.001, 1.0));
  proposal.max_depth_m = std::ceil(2 * proposal.far_depth_m) / 2;
  const double noise_m = sensor_noise_m(std::min(proposal.far_depth_m, 8.0));
  proposal.truncation_m = std::max(4 * proposal.voxel_size_m, round_down(3 * noise_m));
  return proposal;
}

}  // namespace felt
