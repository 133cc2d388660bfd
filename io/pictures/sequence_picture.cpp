#include "io/pictures/sequence_picture.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "io/sequence/recorded_pose.h"

namespace felt {
namespace {

/// Nearest pixels of `image`, `width` wide, at (u0, v0) of the sheet.
template <typename ColorOf>
void paste_scaled(ColorImage& sheet, int u0, int v0, int width, int height, int from_width, int from_height,
                  ColorOf color_of) {
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u) sheet(u0 + u, v0 + v) = color_of(u * from_width / width, v * from_height / height);
}

/// Depth at which 95 % of a frame's pixels are nearer.
float far_depth(const DepthImage& depth_m) {
  std::vector<float> measured;
  for (size_t p = 0; p < depth_m.size(); p += 7)
    if (depth_m.data()[p] > 0) measured.push_back(depth_m.data()[p]);
  if (measured.empty()) return 1;
  const auto at = measured.begin() + long(measured.size() * 95 / 100);
  std::nth_element(measured.begin(), at, measured.end());
  return *at;
}

struct Drawing {
  ColorImage image;
  void dot(double x, double y, Rgba8 color) {
    const double u = std::floor(x + 0.5), v = std::floor(y + 0.5);
    if (u >= 0 && v >= 0 && u < image.width() && v < image.height()) image(int(u), int(v)) = color;
  }
  void line(Eigen::Vector2d a, Eigen::Vector2d b, Rgba8 color) {
    const double length = (b - a).norm();
    if (!(length < 1e5)) return;
    for (double s = 0; s <= length; s += 0.5) {
      const Eigen::Vector2d p = length > 0 ? Eigen::Vector2d(a + (b - a) * (s / length)) : a;
      dot(p.x(), p.y(), color);
    }
  }
};

}  // namespace

ColorImage thumbnail_sheet(const SequenceReader& reader, int count, int columns, int width) {
  const PinholeCamera& camera = reader.info().camera;
  const int shown = int(std::min<int64_t>(count, reader.size())), rows = (shown + columns - 1) / columns,
            height = std::max(1, width * camera.height / camera.width);
  ColorImage sheet(std::min(shown, columns) * width, rows * 2 * height, Rgba8{80, 0, 0, 255});
  for (int i = 0; i < shown; ++i) {
    const ReadResult result = reader.read(i * reader.size() / shown);
    const auto* frame = std::get_if<Frame>(&result);
    if (frame == nullptr) continue;
    const int u0 = i % columns * width, v0 = i / columns * 2 * height;
    if (!frame->color.empty())
      paste_scaled(sheet, u0, v0, width, height, camera.width, camera.height,
                   [&](int u, int v) { return frame->color(u, v); });
    const float far_m = far_depth(frame->depth_m);
    paste_scaled(sheet, u0, v0 + height, width, height, camera.width, camera.height, [&](int u, int v) {
      const float depth = frame->depth_m(u, v);
      const auto grey = uint8_t(depth > 0 ? 255 - 215 * std::min(1.0f, depth / far_m) : 0);
      return Rgba8{grey, grey, grey, 255};
    });
  }
  return sheet;
}

ColorImage trajectory_picture(const SequenceListing& listing, int width, int height) {
  std::vector<Eigen::Isometry3d> poses;
  for (const FrameRecord& frame : listing.frames) {
    const auto recorded = recorded_pose(frame);
    if (const auto* T = std::get_if<Eigen::Isometry3d>(&recorded))
      poses.push_back(camera_pose(*T, listing.pose_convention, listing.T_body_camera));
  }
  if (poses.empty()) throw FormatError(describe_mismatch("trajectory", "poses", "at least one", "none"));
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const auto& T : poses) mean += T.translation() / double(poses.size());
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const auto& T : poses) spread += (T.translation() - mean) * (T.translation() - mean).transpose();
  // Columns by ascending spread: the picture's plane is that of the two largest.
  const Eigen::Matrix3d axes = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvectors();
  const auto flat = [&](const Eigen::Vector3d& p) -> Eigen::Vector2d {
    return {axes.col(2).dot(p - mean), axes.col(1).dot(p - mean)};
  };
  double reach = 0.05;
  for (const auto& T : poses) reach = std::max(reach, flat(T.translation()).cwiseAbs().maxCoeff());
  const double pixels_per_m = 0.44 * std::min(width, height) / reach;
  const auto pixel = [&](const Eigen::Vector2d& p) -> Eigen::Vector2d {
    return {width / 2.0 + pixels_per_m * p.x(), height / 2.0 - pixels_per_m * p.y()};
  };

  Drawing drawing{ColorImage(width, height, Rgba8{255, 255, 255, 255})};
  double step = 1;
  while (reach / step > 20) step *= 10;
  const int lines = int(std::ceil(reach / 0.44 / step)) + 1;
  for (int i = -lines; i <= lines; ++i) {
    const double at = i * step, end = lines * step;
    drawing.line(pixel({at, -end}), pixel({at, end}), Rgba8{220, 220, 220, 255});
    drawing.line(pixel({-end, at}), pixel({end, at}), Rgba8{220, 220, 220, 255});
  }
  for (size_t i = 0; i < poses.size(); ++i) {
    const double share = poses.size() > 1 ? double(i) / double(poses.size() - 1) : 0;
    const Rgba8 color{uint8_t(200 * share), uint8_t(150 * (1 - share)), 40, 255};
    const Eigen::Vector2d here = pixel(flat(poses[i].translation()));
    if (i > 0) drawing.line(pixel(flat(poses[i - 1].translation())), here, Rgba8{60, 60, 60, 255});
    const Eigen::Vector3d ahead = poses[i].linear().col(2);
    const Eigen::Vector2d look(axes.col(2).dot(ahead), -axes.col(1).dot(ahead));
    drawing.line(here, here + 14 * look, color);
    for (int v = -2; v <= 2; ++v)
      for (int u = -2; u <= 2; ++u) drawing.dot(here.x() + u, here.y() + v, color);
  }
  return drawing.image;
}

}  // namespace felt
