#include "bench/peers/engine.h"
#include "mapping/fusion/tsdf_integrator.h"
#include "mapping/surface/marching_cubes.h"

namespace felt::bench {
namespace {

class Feltmap final : public Engine {
public:
  explicit Feltmap(const Settings& s) : map_(s.voxel_size_m, s.truncation_m) {
    config_.max_depth_m = float(s.max_depth_m);
  }
  std::string name() const override { return "feltmap"; }
  void prepare(const Frame& frame) override {
    frames_.push_back(frame);
    frames_.back().color = {};
  }
  void integrate(size_t n) override {
    blocks_ += felt::integrate(map_, frames_[n], config_, scratch_).blocks_in_view;
    ++fused_;
  }
  std::vector<Eigen::Vector3f> surface() override {
    return extract_mesh(map_, {.normals = false, .colors = false}).positions;
  }
  std::optional<double> map_bytes() override { return double(map_.store.geometry_bytes()); }
  double blocks_per_frame() const override { return double(blocks_) / double(fused_); }

private:
  Map map_;
  IntegrationConfig config_;
  IntegrationScratch scratch_;
  std::vector<Frame> frames_;
  size_t blocks_ = 0, fused_ = 0;
};

}  // namespace

std::unique_ptr<Engine> feltmap_engine(const Settings& settings) { return std::make_unique<Feltmap>(settings); }

std::unique_ptr<Engine> engine(int number, const Settings& settings) {
  switch (number) {
    case 0:
      return feltmap_engine(settings);
    case 1:
      return open3d_voxel_block_grid(settings, 8);
    case 2:
      return open3d_voxel_block_grid(settings, 16);
    case 3:
      return open3d_scalable_volume(settings);
    default:
      return opencv_hash_tsdf(settings);
  }
}

}  // namespace felt::bench
