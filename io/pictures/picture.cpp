#include "io/pictures/picture.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "io/files/atomic_file.h"
#include "io/images/depth_encode.h"
#include "io/images/image_encode.h"
#include "mapping/surface/mesh_raster.h"

namespace felt {
namespace fs = std::filesystem;
namespace {

/// 0 at `low` to 1 at `high`, cut at both; 0 where both are the same.
double share_of(double value, double low, double high) {
  return high > low ? std::clamp((value - low) / (high - low), 0.0, 1.0) : 0.0;
}

void paste(const ColorImage& panel, ColorImage& picture, int u0, int v0) {
  for (int v = 0; v < panel.height(); ++v) std::copy_n(panel.row(v), panel.width(), picture.row(v0 + v) + u0);
}

}  // namespace

void write_png(const fs::path& path, const ColorImage& image) { write_file_atomically(path, encode_png(image)); }

int64_t write_depth_png(const fs::path& path, const DepthImage& depth_m, double metres_per_step) {
  int64_t too_far = 0;
  write_file_atomically(path, encode_png(stored_depth(depth_m, 1 / metres_per_step, too_far)));
  return too_far;
}

void write_label_png(const fs::path& path, const LabelImage& labels) {
  write_file_atomically(path, encode_png(labels));
}

void write_level_png(const fs::path& path, const Image<float>& values, double low, double high) {
  Image<uint16_t> levels(values.width(), values.height());
  for (size_t i = 0; i < levels.size(); ++i) {
    const double value = double(values.data()[i]);
    levels.data()[i] =
        std::isfinite(value) ? uint16_t(std::lround(1 + 65534 * share_of(value, low, high))) : uint16_t(0);
  }
  write_file_atomically(path, encode_png(levels));
}

ColorImage colored(const Image<float>& values, double low, double high) {
  // Lightness grows evenly, so that the picture also reads in grey and for colour-blind eyes.
  constexpr double kStops[][3] = {{68, 1, 84}, {59, 82, 139}, {33, 145, 140}, {94, 201, 98}, {253, 231, 37}};
  constexpr int kLast = int(std::size(kStops)) - 1;
  ColorImage picture(values.width(), values.height(), {255, 255, 255, 255});
  for (size_t i = 0; i < values.size(); ++i) {
    const double value = double(values.data()[i]);
    if (!std::isfinite(value)) continue;
    const double at = share_of(value, low, high) * kLast;
    const int stop = std::min(int(at), kLast - 1);
    const auto channel = [&](int c) {
      return uint8_t(std::lround(kStops[stop][c] + (at - stop) * (kStops[stop + 1][c] - kStops[stop][c])));
    };
    picture.data()[i] = {channel(0), channel(1), channel(2), 255};
  }
  return picture;
}

ColorImage colored(const LabelImage& labels, const ClassTable& classes) {
  ColorImage picture(labels.width(), labels.height(), {255, 255, 255, 255});
  for (size_t i = 0; i < labels.size(); ++i)
    if (const uint16_t slot = classes.slot_of_id(labels.data()[i]); slot != ClassTable::kNoSlot)
      picture.data()[i] = classes.at_slot(slot).color;
  return picture;
}

ColorImage colored(const Image<Eigen::Vector3f>& normals) {
  ColorImage picture(normals.width(), normals.height(), {255, 255, 255, 255});
  for (size_t i = 0; i < normals.size(); ++i) {
    const Eigen::Vector3f& n = normals.data()[i];
    if (n.isZero()) continue;
    const Eigen::Vector3f level = (n + Eigen::Vector3f::Ones()) * 127.5f + Eigen::Vector3f::Constant(0.5f);
    picture.data()[i] = {uint8_t(level.x()), uint8_t(level.y()), uint8_t(level.z()), 255};
  }
  return picture;
}

ColorImage overview_picture(const TriangleMesh& mesh, const Eigen::Vector3d& up, int panel_width, int panel_height) {
  struct Direction {
    double azimuth_deg, elevation_deg;
  };
  constexpr Direction kDirections[] = {{-60, 40}, {120, 40}, {-90, 90}};
  std::vector<Shading> shadings = {Shading::clay, Shading::normal};
  if (!mesh.colors.empty()) shadings.insert(shadings.begin(), Shading::color);
  ColorImage picture(panel_width * int(std::size(kDirections)), panel_height * int(shadings.size()));
  for (int column = 0; column < int(std::size(kDirections)); ++column) {
    const auto [azimuth, elevation] = kDirections[column];
    const RasterView view = overview(mesh, up, azimuth, elevation, panel_width, panel_height);
    for (int row = 0; row < int(shadings.size()); ++row)
      paste(draw_mesh(mesh, view, shadings[size_t(row)]), picture, column * panel_width, row * panel_height);
  }
  return picture;
}

}  // namespace felt
