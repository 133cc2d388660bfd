#pragma once

#include <memory>
#include <optional>
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
  /// Bytes of the distances and weights that the map holds, by its own count; none where it does not tell.
  virtual std::optional<double> map_bytes() = 0;
  /// Blocks (8^3 voxels) that one frame updates on average: feltmap's only, for the machine's bound.
  virtual double blocks_per_frame() const { return 0; }
};

struct Settings {
  double voxel_size_m = 0.02;
  double truncation_m = 0.08;
  double max_depth_m = 4;
};

std::unique_ptr<Engine> feltmap_engine(const Settings& settings);
std::unique_ptr<Engine> open3d_voxel_block_grid(const Settings& settings, int block_resolution);
std::unique_ptr<Engine> open3d_scalable_volume(const Settings& settings);
std::unique_ptr<Engine> opencv_hash_tsdf(const Settings& settings);

constexpr int kEngines = 5;
/// Number 0: feltmap; then VoxelBlockGrid of 8^3 and 16^3, ScalableTSDFVolume, HASHTSDF.
std::unique_ptr<Engine> engine(int number, const Settings& settings);

/// Limits the threads of each library's own pool.
void open3d_threads(int threads);
void opencv_threads(int threads);

}  // namespace felt::bench
