#include "tests/support/recorded_sequence.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>
#include <fstream>

#include "io/images/image_encode.h"

namespace felt::test {
namespace fs = std::filesystem;
namespace {

std::string number(const char* format, int frame) {
  char text[64];
  std::snprintf(text, sizeof text, format, frame);
  return text;
}

}  // namespace

double depth_m_at(int frame, int u) { return 1 + 0.01 * u + 0.1 * frame; }

Eigen::Isometry3d pose_at(int frame) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = Eigen::AngleAxisd(0.2 + 0.1 * frame, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  T.translation() = Eigen::Vector3d(0.5 * frame, -1, 2);
  return T;
}

Image<uint16_t> stored_depth(int frame, double scale) {
  Image<uint16_t> image(kWidth, kHeight);
  for (int v = 0; v < kHeight; ++v)
    for (int u = 0; u < kWidth; ++u) image(u, v) = uint16_t(std::lround(depth_m_at(frame, u) * scale));
  return image;
}

ColorImage color_image(int frame) {
  ColorImage image(kWidth, kHeight);
  for (int v = 0; v < kHeight; ++v)
    for (int u = 0; u < kWidth; ++u) image(u, v) = {uint8_t(10 * u), uint8_t(10 * v), uint8_t(frame), 255};
  return image;
}

Image<uint16_t> label_image() {
  Image<uint16_t> image(kWidth, kHeight);
  for (int v = 0; v < kHeight; ++v)
    for (int u = 0; u < kWidth; ++u) image(u, v) = uint16_t(1 + u % 3);
  return image;
}

void write_text(const fs::path& path, const std::string& text) {
  fs::create_directories(path.parent_path());
  std::ofstream(path, std::ios::binary) << text;
}

std::string matrix_text(const Eigen::Matrix4d& matrix, const std::string& separator) {
  std::string text;
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 4; ++column) {
      char word[40];
      std::snprintf(word, sizeof word, "%.17g", matrix(row, column));
      text += std::string(row + column == 0 ? "" : column == 0 ? separator : " ") + word;
    }
  return text;
}

std::string translation_quaternion_text(const Eigen::Isometry3d& T) {
  const Eigen::Quaterniond q(T.linear());
  const Eigen::Vector3d& t = T.translation();
  char text[240];
  std::snprintf(text, sizeof text, "%.17g %.17g %.17g %.17g %.17g %.17g %.17g", t.x(), t.y(), t.z(), q.x(), q.y(),
                q.z(), q.w());
  return text;
}

void write_seven_scenes(const fs::path& folder, int frames) {
  const fs::path images = folder / "seq-01";
  fs::create_directories(images);
  write_text(folder / "camera-intrinsics.txt", "20 0 11.5\n0 20 7.5\n0 0 1\n");
  for (int i = 0; i < frames; ++i) {
    write_bytes(images / number("frame-%06d.depth.png", i), encode_png(stored_depth(i, 1000)));
    write_bytes(images / number("frame-%06d.color.png", i), encode_png(color_image(i)));
    write_text(images / number("frame-%06d.pose.txt", i), matrix_text(pose_at(i).matrix(), "\n"));
  }
}

void write_tum(const fs::path& folder, int frames) {
  fs::create_directories(folder / "depth");
  fs::create_directories(folder / "rgb");
  write_text(folder / "camera-intrinsics.txt", "20 20 11.5 7.5\n");
  std::string depth = "# depth maps\n", rgb = "# color images\n", poses = "# timestamp tx ty tz qx qy qz qw\n";
  for (int i = 0; i < frames; ++i) {
    // Colour 3 ms after depth, poses 100 times a second.
    const std::string depth_stamp = number("100.%d00000", i), color_stamp = number("100.%d03000", i);
    write_bytes(folder / "depth" / (depth_stamp + ".png"), encode_png(stored_depth(i, 5000)));
    write_bytes(folder / "rgb" / (color_stamp + ".png"), encode_png(color_image(i)));
    depth += depth_stamp + " depth/" + depth_stamp + ".png\n";
    rgb += color_stamp + " rgb/" + color_stamp + ".png\n";
    poses += number("100.%d04000 ", i) + translation_quaternion_text(pose_at(i)) + "\n";
    poses += number("100.%d14000 ", i) + translation_quaternion_text(pose_at(i + 7)) + "\n";
  }
  write_text(folder / "depth.txt", depth);
  write_text(folder / "rgb.txt", rgb);
  write_text(folder / "groundtruth.txt", poses);
}

void write_replica(const fs::path& folder, int frames) {
  for (const char* name : {"results", "semantic", "instance"}) fs::create_directories(folder / name);
  write_text(folder / "cam_params.json",
             R"({"camera": {"w": 24, "h": 16, "fx": 20.0, "fy": 20.0, "cx": 11.5, "cy": 7.5, "scale": 6553.5}})");
  write_text(folder / "classes_semantic.csv",
             "id,name,pixel_share\n0,unlabelled,0.1\n1,wall,0.3\n2,floor,0.3\n3,sofa,0.3\n");
  std::string trajectory;
  for (int i = 0; i < frames; ++i) {
    write_bytes(folder / "results" / number("depth%06d.png", i), encode_png(stored_depth(i, 6553.5)));
    write_bytes(folder / "results" / number("frame%06d.jpg", i), encode_jpeg(color_image(i), 100));
    write_bytes(folder / "semantic" / number("semantic%06d.png", i), encode_png(label_image()));
    write_bytes(folder / "instance" / number("instance%06d.png", i), encode_png(label_image()));
    trajectory += matrix_text(pose_at(i).matrix(), " ") + "\n";
  }
  write_text(folder / "traj.txt", trajectory);
}

void write_redwood(const fs::path& folder, int frames) {
  for (const char* name : {"depth", "color"}) fs::create_directories(folder / name);
  write_text(folder / "intrinsic.json",
             R"({"width": 24, "height": 16, "intrinsic_matrix": [20, 0, 0, 0, 20, 0, 11.5, 7.5, 1]})");
  std::string log;
  for (int i = 0; i < frames; ++i) {
    write_bytes(folder / "depth" / number("%05d.png", i), encode_png(stored_depth(i, 1000)));
    write_bytes(folder / "color" / number("%05d.png", i), encode_png(color_image(i)));
    log += number("%d ", i) + number("%d ", i) + number("%d\n", i + 1) + matrix_text(pose_at(i).matrix(), "\n") + "\n";
  }
  write_text(folder / "trajectory.log", log);
}

void write_icl(const fs::path& folder, int frames) {
  for (const char* name : {"depth", "color"}) fs::create_directories(folder / name);
  write_text(folder / "intrinsics.txt", "20 0 11.5\n0 20 7.5\n0 0 1\n");
  for (int i = 0; i < frames; ++i) {
    write_bytes(folder / "depth" / number("%d.png", i), encode_png(stored_depth(i, 1000)));
    write_bytes(folder / "color" / number("%d.png", i), encode_png(color_image(i)));
    write_text(folder / "pose" / number("%d.txt", i), matrix_text(pose_at(i).matrix(), "\n"));
  }
}

void write_scannet(const fs::path& folder, int frames) {
  write_icl(folder, frames);
  fs::remove(folder / "intrinsics.txt");
  const char* camera = "20 0 11.5 0\n0 20 7.5 0\n0 0 1 0\n0 0 0 1\n";
  write_text(folder / "intrinsic" / "intrinsic_depth.txt", camera);
  write_text(folder / "intrinsic" / "intrinsic_color.txt", camera);
}

void write_generic(const fs::path& folder, int frames) {
  for (const char* name : {"depth", "color", "labels"}) fs::create_directories(folder / name);
  write_text(folder / "sequence.yaml",
             "camera: {fx: 20, fy: 20, cx: 11.5, cy: 7.5, width: 24, height: 16}\ndepth_scale: 2000\n");
  write_text(
      folder / "classes.yaml",
      "classes: [{id: 0, name: none, ignore: true}, {id: 1, name: wall, color: [1, 2, 3]}, {id: 2, name: floor}, "
      "{id: 3, name: sofa}]\n");
  std::string poses;
  for (int i = 0; i < frames; ++i) {
    // Not padded with zeros: 10 has to come after 9.
    write_bytes(folder / "depth" / number("%d.png", i), encode_png(stored_depth(i, 2000)));
    write_bytes(folder / "color" / number("%d.png", i), encode_png(color_image(i)));
    write_bytes(folder / "labels" / number("%d.png", i), encode_png(label_image()));
    poses += number("%d ", i) + matrix_text(pose_at(i).matrix(), " ") + "\n";
  }
  write_text(folder / "poses.txt", poses);
}

Frame frame_of(const SequenceReader& reader, int64_t i) {
  ReadResult result = reader.read(i);
  if (const auto* skip = std::get_if<SkippedFrame>(&result)) FAIL(skip->reason << ": " << skip->detail);
  return std::get<Frame>(std::move(result));
}

SkippedFrame skip_of(const SequenceReader& reader, int64_t i) {
  const ReadResult result = reader.read(i);
  REQUIRE(std::holds_alternative<SkippedFrame>(result));
  return std::get<SkippedFrame>(result);
}

void check_frame(const Frame& frame, int number, double depth_unit_m, int color_error) {
  CHECK(frame.index == number);
  CHECK(frame.camera == PinholeCamera{20, 20, 11.5, 7.5, kWidth, kHeight});
  CHECK(frame.T_world_camera.isApprox(pose_at(number), 1e-9));
  REQUIRE(frame.depth_m.width() == kWidth);
  REQUIRE(frame.depth_m.height() == kHeight);
  for (int u = 0; u < kWidth; ++u) CHECK(std::abs(frame.depth_m(u, 3) - depth_m_at(number, u)) <= 0.51 * depth_unit_m);
  REQUIRE(frame.color.width() == kWidth);
  const Rgba8 seen = frame.color(20, 9);
  CHECK(std::abs(seen.r - 200) <= color_error);
  CHECK(std::abs(seen.g - 90) <= color_error);
  CHECK(std::abs(seen.b - number) <= color_error);
  CHECK(seen.a == 255);
}

}  // namespace felt::test
