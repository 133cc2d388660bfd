#include "io/mask_image.h"

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <string>

#include "core/pose.h"
#include "io/camera_file.h"

namespace felt {

ViewMask read_view_mask(const std::filesystem::path& file, const std::vector<double>& intrinsics,
                        const std::vector<double>& pose) {
  if (!std::filesystem::is_regular_file(file))
    throw IoError(describe_mismatch(file.string(), "mask", "a readable image", "none"));
  cv::Mat image;
  try {
    image = cv::imread(file.string(), cv::IMREAD_GRAYSCALE | cv::IMREAD_ANYDEPTH);
  } catch (const cv::Exception&) {
    image.release();
  }
  if (image.empty()) throw FormatError(describe_mismatch(file.string(), "mask", "an image", "something else"));
  const auto size_text = [](double w, double h) {
    char text[64];
    std::snprintf(text, sizeof text, "%.0f x %.0f", w, h);
    return std::string(text);
  };
  if (intrinsics.size() == 6 && (intrinsics[4] != image.cols || intrinsics[5] != image.rows))
    throw FormatError(describe_mismatch(file.string(), "size of the mask",
                                        size_text(intrinsics[4], intrinsics[5]) + " as its camera",
                                        size_text(image.cols, image.rows)));
  ViewMask view;
  view.camera = {intrinsics.at(0), intrinsics.at(1), intrinsics.at(2), intrinsics.at(3), image.cols, image.rows};
  check_camera_fits_image(view.camera, file.string());
  const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> recorded(pose.data());
  if (pose.size() != 16 || rigid_pose(recorded, view.T_world_camera) != PoseFault::none)
    throw ConfigError(describe_mismatch("--pose", "matrix", "a rigid transform", "another"));
  view.mask = Image<uint8_t>(image.cols, image.rows);
  cv::Mat set = image != 0;
  for (int v = 0; v < image.rows; ++v) std::copy_n(set.ptr<uint8_t>(v), image.cols, view.mask.row(v));
  return view;
}

std::vector<Eigen::Vector3d> read_points(const std::filesystem::path& file) {
  std::ifstream stream(file);
  if (!stream) throw IoError(describe_mismatch(file.string(), "points", "a readable file", "none"));
  std::vector<Eigen::Vector3d> points;
  std::string problems;
  int number = 0;
  for (std::string line; std::getline(stream, line);) {
    ++number;
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (line.empty() || line[0] == '#' || (points.empty() && line.rfind("x,y,z", 0) == 0)) continue;
    Eigen::Vector3d p;
    int used = 0;
    if (std::sscanf(line.c_str(), "%lf ,%lf ,%lf %n", &p.x(), &p.y(), &p.z(), &used) == 3 &&
        size_t(used) == line.size())
      points.push_back(p);
    else
      problems.append(problems.empty() ? "" : "\n")
          .append(describe_mismatch(file.string() + ":" + std::to_string(number), "point", "x,y,z",
                                    "'" + line.substr(0, 60) + "'"));
  }
  if (!problems.empty()) throw FormatError(problems);
  return points;
}

}  // namespace felt
