#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <string>
#include <vector>

#include "core/image.h"
#include "io/sequence/reader.h"

namespace felt::test {

/// A small made-up recording, the same in whichever layout it is written: 24 x 16 pixels, camera (20, 20, 11.5, 7.5),
/// depth of pixel (u, v) in frame i is 1 + 0.01 u + 0.1 i metres, its colour (10 u, 10 v, i), its label 1 + u % 3.
inline constexpr int kWidth = 24, kHeight = 16;
double depth_m_at(int frame, int u);
Eigen::Isometry3d pose_at(int frame);
Image<uint16_t> stored_depth(int frame, double scale);
ColorImage color_image(int frame);
Image<uint16_t> label_image();

void write_text(const std::filesystem::path& path, const std::string& text);
/// "16 numbers, row-major" with `separator` between rows.
std::string matrix_text(const Eigen::Matrix4d& matrix, const std::string& separator);
/// "tx ty tz qx qy qz qw"
std::string translation_quaternion_text(const Eigen::Isometry3d& T);

/// Writes `frames` frames below `folder`.
void write_seven_scenes(const std::filesystem::path& folder, int frames);
void write_tum(const std::filesystem::path& folder, int frames);
void write_replica(const std::filesystem::path& folder, int frames);
void write_redwood(const std::filesystem::path& folder, int frames);
void write_icl(const std::filesystem::path& folder, int frames);
void write_scannet(const std::filesystem::path& folder, int frames);
void write_generic(const std::filesystem::path& folder, int frames);

/// What `read(i)` gives; the test fails, with the reason, where it is a skip.
Frame frame_of(const SequenceReader& reader, int64_t i);
/// What `read(i)` says when it is expected to be a skip.
SkippedFrame skip_of(const SequenceReader& reader, int64_t i);
/// Checks that a frame is that of the recording with this number: depth to its unit, colour to `color_error` levels.
void check_frame(const Frame& frame, int number, double depth_unit_m, int color_error);

}  // namespace felt::test
