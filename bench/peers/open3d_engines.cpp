#include <omp.h>
#include <open3d/Open3D.h>

#include "bench/peers/engine.h"

namespace felt::bench {
namespace {

namespace o3 = open3d;

class BlockGrid final : public Engine {
public:
  BlockGrid(const Settings& s, int resolution) : settings_(s), resolution_(resolution) {
    grid_ = o3::t::geometry::VoxelBlockGrid({"tsdf", "weight"}, {o3::core::Float32, o3::core::Float32}, {{1}, {1}},
                                            float(s.voxel_size_m), resolution, resolution == 8 ? 60000 : 12000);
  }
  std::string name() const override { return "Open3D VoxelBlockGrid " + std::to_string(resolution_) + "^3"; }
  void prepare(const Frame& frame) override {
    const int w = frame.depth_m.width(), h = frame.depth_m.height();
    depth_.emplace_back(
        o3::core::Tensor(std::vector<float>(frame.depth_m.begin(), frame.depth_m.end()), {h, w, 1}, o3::core::Float32));
    Eigen::Matrix3d K = Eigen::Matrix3d::Identity();
    K(0, 0) = frame.camera.fx, K(1, 1) = frame.camera.fy, K(0, 2) = frame.camera.cx, K(1, 2) = frame.camera.cy;
    intrinsic_ = o3::core::eigen_converter::EigenMatrixToTensor(K);
    extrinsic_.push_back(
        o3::core::eigen_converter::EigenMatrixToTensor(Eigen::Matrix4d(frame.T_world_camera.inverse().matrix())));
  }
  void integrate(size_t n) override {
    const auto multiplier = float(settings_.truncation_m / settings_.voxel_size_m);
    const auto blocks = grid_.GetUniqueBlockCoordinates(depth_[n], intrinsic_, extrinsic_[n], 1.0f,
                                                        float(settings_.max_depth_m), multiplier);
    grid_.Integrate(blocks, depth_[n], intrinsic_, extrinsic_[n], 1.0f, float(settings_.max_depth_m), multiplier);
  }
  std::vector<Eigen::Vector3f> surface() override {
    const auto mesh = grid_.ExtractTriangleMesh(1.0f).ToLegacy();
    std::vector<Eigen::Vector3f> out;
    for (const auto& p : mesh.vertices_) out.push_back(p.cast<float>());
    return out;
  }
  std::optional<double> map_bytes() override {
    // Blocks that it has taken, not those it has room for: that is chosen beforehand.
    return double(grid_.GetHashMap().Size()) * resolution_ * resolution_ * resolution_ * 2 * sizeof(float);
  }

private:
  Settings settings_;
  int resolution_;
  o3::t::geometry::VoxelBlockGrid grid_;
  std::vector<o3::t::geometry::Image> depth_;
  std::vector<o3::core::Tensor> extrinsic_;
  o3::core::Tensor intrinsic_;
};

class ScalableVolume final : public Engine {
public:
  explicit ScalableVolume(const Settings& s)
      : settings_(s),
        volume_(s.voxel_size_m, s.truncation_m, o3::pipelines::integration::TSDFVolumeColorType::NoColor) {}
  std::string name() const override { return "Open3D ScalableTSDFVolume"; }
  void prepare(const Frame& frame) override {
    o3::geometry::RGBDImage image;
    image.depth_.Prepare(frame.depth_m.width(), frame.depth_m.height(), 1, 4);
    for (size_t i = 0; i < frame.depth_m.size(); ++i) {
      const float d = frame.depth_m.data()[i];
      reinterpret_cast<float*>(image.depth_.data_.data())[i] = d <= settings_.max_depth_m ? d : 0;
    }
    images_.push_back(std::move(image));
    extrinsic_.push_back(frame.T_world_camera.inverse().matrix());
    camera_ = o3::camera::PinholeCameraIntrinsic(frame.depth_m.width(), frame.depth_m.height(), frame.camera.fx,
                                                 frame.camera.fy, frame.camera.cx, frame.camera.cy);
  }
  void integrate(size_t n) override { volume_.Integrate(images_[n], camera_, extrinsic_[n]); }
  std::vector<Eigen::Vector3f> surface() override {
    std::vector<Eigen::Vector3f> out;
    for (const auto& p : volume_.ExtractPointCloud()->points_) out.push_back(p.cast<float>());
    return out;
  }
  std::optional<double> map_bytes() override {
    double bytes = 0;
    for (const auto& [index, unit] : volume_.volume_units_)
      if (unit.volume_) bytes += double(unit.volume_->voxels_.size() * sizeof(unit.volume_->voxels_[0]));
    return bytes;
  }

private:
  Settings settings_;
  o3::pipelines::integration::ScalableTSDFVolume volume_;
  std::vector<o3::geometry::RGBDImage> images_;
  std::vector<Eigen::Matrix4d> extrinsic_;
  o3::camera::PinholeCameraIntrinsic camera_;
};

}  // namespace

std::unique_ptr<Engine> open3d_voxel_block_grid(const Settings& settings, int resolution) {
  return std::make_unique<BlockGrid>(settings, resolution);
}
std::unique_ptr<Engine> open3d_scalable_volume(const Settings& settings) {
  return std::make_unique<ScalableVolume>(settings);
}
void open3d_threads(int threads) { omp_set_num_threads(threads); }

}  // namespace felt::bench
