#include <opencv2/core.hpp>
#include <opencv2/rgbd/volume.hpp>

#include "bench/peers/engine.h"

namespace felt::bench {
namespace {

class HashTsdf final : public Engine {
public:
  explicit HashTsdf(const Settings& s) {
    // The overload that the library exports; step, cap and unit size are its defaults.
    const auto params = cv::kinfu::VolumeParams::defaultParams(cv::kinfu::VolumeType::HASHTSDF);
    volume_ = cv::kinfu::makeVolume(cv::kinfu::VolumeType::HASHTSDF, float(s.voxel_size_m), cv::Matx44f::eye(),
                                    params->raycastStepFactor, float(s.truncation_m), params->maxWeight,
                                    float(s.max_depth_m), cv::Vec3i::all(params->unitResolution));
  }
  std::string name() const override { return "OpenCV HASHTSDF"; }
  void prepare(const Frame& frame) override {
    const cv::Mat view(frame.depth_m.height(), frame.depth_m.width(), CV_32F, const_cast<float*>(frame.depth_m.data()));
    depth_.push_back(view.clone());
    cv::Matx44f pose;
    for (int r = 0; r < 4; ++r)
      for (int c = 0; c < 4; ++c) pose(r, c) = float(frame.T_world_camera.matrix()(r, c));
    pose_.push_back(pose);
    intrinsics_ =
        cv::kinfu::Intr(float(frame.camera.fx), float(frame.camera.fy), float(frame.camera.cx), float(frame.camera.cy));
  }
  void integrate(size_t frame) override {
    volume_->integrate(depth_[frame], 1.0f, pose_[frame], intrinsics_, int(frame));
  }
  std::vector<Eigen::Vector3f> surface() override {
    cv::Mat points, normals;
    volume_->fetchPointsNormals(points, normals);
    std::vector<Eigen::Vector3f> out;
    for (int i = 0; i < points.rows * points.cols; ++i) {
      const cv::Vec4f p = points.at<cv::Vec4f>(i);
      out.emplace_back(p[0], p[1], p[2]);
    }
    return out;
  }
  std::optional<double> map_bytes() override { return {}; }

private:
  cv::Ptr<cv::kinfu::Volume> volume_;
  cv::kinfu::Intr intrinsics_;
  std::vector<cv::Mat> depth_;
  std::vector<cv::Matx44f> pose_;
};

}  // namespace

std::unique_ptr<Engine> opencv_hash_tsdf(const Settings& settings) { return std::make_unique<HashTsdf>(settings); }
void opencv_threads(int threads) { cv::setNumThreads(threads); }

}  // namespace felt::bench
