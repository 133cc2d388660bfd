#include "io/readings/mask_image.h"

#include <algorithm>
#include <span>
#include <string>

#include "core/pose.h"
#include "core/text.h"
#include "io/files/text_input.h"
#include "io/images/image_decode.h"
#include "io/sequence/camera_file.h"

namespace felt {
namespace {

/// 255 where any channel of the image is not zero.
Image<uint8_t> set_pixels(const std::filesystem::path& file) {
  const std::string content = read_whole_file(file);
  const std::span<const uint8_t> bytes(reinterpret_cast<const uint8_t*>(content.data()), content.size());
  const ImageHeader header = read_image_header(bytes, file.string());
  Image<uint8_t> set(header.width, header.height);
  if (header.format == ImageFormat::png && header.channels == 1) {
    const Image<uint16_t> values = decode_gray16(bytes, file.string());
    std::transform(values.begin(), values.end(), set.begin(), [](uint16_t v) { return v != 0 ? 255 : 0; });
  } else {
    const ColorImage colors = decode_color(bytes, file.string());
    std::transform(colors.begin(), colors.end(), set.begin(), [](Rgba8 c) { return c.r | c.g | c.b ? 255 : 0; });
  }
  return set;
}

}  // namespace

ViewMask read_view_mask(const std::filesystem::path& file, const std::vector<double>& intrinsics,
                        const std::vector<double>& pose) {
  const Image<uint8_t> image = set_pixels(file);
  const auto size_of = [](double w, double h) { return number_text(w) + " x " + number_text(h); };
  if (intrinsics.size() == 6 && (intrinsics[4] != image.width() || intrinsics[5] != image.height()))
    throw FormatError(describe_mismatch(file.string(), "size of the mask",
                                        size_of(intrinsics[4], intrinsics[5]) + " as its camera",
                                        size_text(image.width(), image.height())));
  ViewMask view;
  view.camera = {intrinsics.at(0), intrinsics.at(1), intrinsics.at(2), intrinsics.at(3), image.width(), image.height()};
  check_camera_fits_image(view.camera, file.string());
  const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> recorded(pose.data());
  if (pose.size() != 16 || rigid_pose(recorded, view.T_world_camera) != PoseFault::none)
    throw ConfigError(describe_mismatch("--pose", "matrix", "a rigid transform", "another"));
  view.mask = image;
  return view;
}

}  // namespace felt
