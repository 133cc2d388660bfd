// Sequences as broken disks, other programs and ill-meaning people leave them.
#include <catch2/catch.hpp>
#include <fstream>

#include "core/error.h"
#include "io/images/image_decode.h"
#include "io/images/image_encode.h"
#include "io/sequence/open_sequence.h"
#include "tests/support/data.h"
#include "tests/support/recorded_sequence.h"

using namespace felt;
using namespace felt::test;
namespace fs = std::filesystem;

namespace {

uint32_t crc32(const uint8_t* bytes, size_t count) {
  uint32_t crc = 0xffffffff;
  for (size_t i = 0; i < count; ++i) {
    crc ^= bytes[i];
    for (int bit = 0; bit < 8; ++bit) crc = crc >> 1 ^ (crc & 1 ? 0xedb88320 : 0);
  }
  return ~crc;
}

/// The PNG with another size in its header and the checksum that belongs to it.
std::vector<uint8_t> with_size(std::vector<uint8_t> png, uint32_t width, uint32_t height) {
  const auto put = [&](size_t at, uint32_t value) {
    for (int i = 0; i < 4; ++i) png[at + size_t(i)] = uint8_t(value >> (24 - 8 * i));
  };
  put(16, width), put(20, height);
  put(29, crc32(png.data() + 12, 17));
  return png;
}

std::string reason_of(const std::vector<uint8_t>& image) {
  try {
    decode_gray16(image, "test");
  } catch (const ImageError& fault) {
    return fault.reason();
  }
  return "";
}

std::string skip_reason(const fs::path& folder) {
  const ReadResult result = open_sequence(folder)->read(0);
  const auto* skip = std::get_if<SkippedFrame>(&result);
  return skip != nullptr ? skip->reason : "";
}

/// The file with a byte order mark and Windows line ends.
void make_windows_text(const fs::path& path) {
  std::ifstream in(path);
  std::string text = "\xef\xbb\xbf", line;
  while (std::getline(in, line)) text += line + "\r\n";
  write_text(path, text);
}

}  // namespace

TEST_CASE("a decompression bomb is refused: its rows are decoded into the size that the header states, no further") {
  const std::vector<uint8_t> large = encode_png(Image<uint16_t>(4000, 4000, 9));
  CHECK(large.size() < 100000);
  CHECK(reason_of(with_size(large, 4000, 4000)).empty());
  CHECK_FALSE(reason_of(with_size(large, 24, 16)).empty());
  TemporaryDirectory folder;
  write_generic(folder.path(), 1);
  write_bytes(folder.path() / "color" / "0.png", with_size(encode_png(ColorImage(4000, 4000)), kWidth, kHeight));
  CHECK_THAT(skip_reason(folder.path()), Catch::EndsWith("colour image"));
}

TEST_CASE("a header of gigapixels is refused before anything of its size is made") {
  const std::vector<uint8_t> small = encode_png(Image<uint16_t>(4, 4, 9));
  CHECK(reason_of(with_size(small, 0x7fffffff, 0x7fffffff)) == "too large");
  CHECK(reason_of(with_size(small, 40000, 40000)) == "too large");
  CHECK(reason_of(with_size(small, 8000, 8000)) == "truncated");
}

TEST_CASE("folders and images that are links to themselves are errors and skips, not endless walks") {
  TemporaryDirectory folder;
  write_generic(folder.path(), 2);
  fs::remove(folder.path() / "color" / "0.png");
  fs::create_symlink("0.png", folder.path() / "color" / "0.png");
  CHECK_THAT(skip_reason(folder.path()), Catch::EndsWith("colour image"));
  fs::remove_all(folder.path() / "depth");
  fs::create_symlink("depth", folder.path() / "depth");
  CHECK_THROWS_AS(open_sequence(folder.path()), Error);
  fs::create_directory_symlink(".", folder.path() / "here");
  CHECK_THROWS_AS(open_sequence(folder.path() / "here" / "here" / "here"), Error);
  fs::create_symlink("loop", folder.path() / "loop");
  CHECK_THROWS_AS(open_sequence(folder.path() / "loop"), Error);
}

TEST_CASE("texts with a byte order mark and Windows line ends read like any other, in every layout") {
  TemporaryDirectory folder;
  const auto first_pose = [](const fs::path& path) {
    return std::get<Frame>(open_sequence(path)->read(0)).T_world_camera;
  };
  write_tum(folder.path() / "tum", 1);
  write_replica(folder.path() / "replica", 1);
  write_redwood(folder.path() / "redwood", 1);
  write_generic(folder.path() / "generic", 1);
  write_icl(folder.path() / "icl", 1);
  for (const char* file :
       {"tum/depth.txt", "tum/rgb.txt", "tum/groundtruth.txt", "tum/camera-intrinsics.txt", "replica/traj.txt",
        "replica/cam_params.json", "redwood/trajectory.log", "redwood/intrinsic.json", "generic/poses.txt",
        "generic/sequence.yaml", "generic/classes.yaml", "icl/intrinsics.txt", "icl/pose/0.txt"})
    make_windows_text(folder.path() / file);
  for (const char* layout : {"tum", "replica", "redwood", "generic", "icl"}) {
    INFO(layout);
    CHECK(first_pose(folder.path() / layout).isApprox(pose_at(0), 1e-9));
  }
}

TEST_CASE("paths with blanks, quotes and letters of any script are paths like others, in every layout") {
  TemporaryDirectory folder;
  const fs::path odd = folder.path() / "die K\u00fcche (2. Versuch) 'a' \"b\" \u623f\u9593 \U0001f3e0 %d #1";
  struct Layout {
    const char* name;
    void (*write)(const fs::path&, int);
  };
  for (const Layout& layout :
       {Layout{"7scenes", write_seven_scenes}, Layout{"tum", write_tum}, Layout{"replica", write_replica},
        Layout{"redwood", write_redwood}, Layout{"icl", write_icl}, Layout{"scannet", write_scannet},
        Layout{"generic", write_generic}}) {
    INFO(layout.name);
    layout.write(odd / layout.name, 2);
    const auto reader = open_sequence(odd / layout.name);
    CHECK(reader->info().layout == layout.name);
    CHECK(std::holds_alternative<Frame>(reader->read(1)));
  }
  // Names with blanks within a list, and folders that the description names.
  fs::rename(odd / "tum" / "depth", odd / "tum" / "depth of the \u00fc kitchen");
  write_text(odd / "tum" / "depth.txt", "100.000000 depth of the \u00fc kitchen/100.000000.png\n");
  CHECK(std::holds_alternative<Frame>(open_sequence(odd / "tum")->read(0)));
  fs::rename(odd / "generic" / "depth", odd / "generic" / "Tiefe \u00e4");
  write_text(odd / "generic" / "sequence.yaml",
             "camera: {fx: 20, fy: 20, cx: 11.5, cy: 7.5, width: 24, height: 16}\ndepth_scale: 2000\n"
             "paths: {depth: \"Tiefe \u00e4\"}\n");
  CHECK(std::holds_alternative<Frame>(open_sequence(odd / "generic")->read(0)));
}

TEST_CASE("decimal commas are refused with the reason named") {
  TemporaryDirectory folder;
  write_generic(folder.path(), 1);
  write_text(folder.path() / "poses.txt", "0 1,0 0,0 0,0 0,5 0,0 1,0 0,0 0,0 0,0 0,0 1,0 0,0 0,0 0,0 0,0 1,0\n");
  CHECK_THROWS_WITH(open_sequence(folder.path()), Catch::Contains("poses.txt:1") && Catch::Contains("decimal sign"));
}

TEST_CASE("a million poses open within seconds") {
  TemporaryDirectory folder;
  write_tum(folder.path(), 1);
  std::string text;
  for (int i = 0; i < 1000000; ++i) text += std::to_string(i * 0.001) + " 1 2 3 0 0 0 1\n";
  write_text(folder.path() / "groundtruth.txt", text);
  const auto reader = open_sequence(folder.path());
  CHECK(std::get<Frame>(reader->read(0)).T_world_camera.translation() == Eigen::Vector3d(1, 2, 3));
}
