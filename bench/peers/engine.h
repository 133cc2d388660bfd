#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/frame.h"

namespace felt::bench {

/// What is compared: depth fusion into a TSDF, and the surface points it gives.
class Engine {
public:
  virtual ~Engine() = default;
  virtual std::string name() const = 0;
  /// Fuses a prepared frame (see `prepare`): this call is what is timed.
  virtual void integrate(size_t frame) = 0;
  /// Converts a frame into the engine's own types, untimed.
  virtual void prepare(const Frame& frame) = 0;
  virtual std::vector<Eigen::Vector3f> surface() = 0;
};

struct Settings {
  double voxel_size_m = 0.02;
  double truncation_m = 0.08;
  double max_depth_m = 4;
};

std::unique_ptr<Engine> open3d_voxel_block_grid(const Settings& settings, int block_resolution);
std::unique_ptr<Engine> open3d_scalable_volume(const Settings& settings);
std::unique_ptr<Engine> opencv_hash_tsdf(const Settings& settings);

/// Limits the threads of each library's own pool.
void open3d_threads(int threads);
void opencv_threads(int threads);

}  // namespace felt::bench
