#include "io/images/depth_decode.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <opencv2/imgcodecs.hpp>

#include "io/images/image_decode.h"
#include "io/images/image_encode.h"
#include "io/sequence/open_sequence.h"
#include "tests/support/data.h"
#include "tests/support/image_fault.h"
#include "tests/support/recorded_sequence.h"

using namespace felt;
using namespace felt::test;
namespace fs = std::filesystem;

namespace {

using Bytes = std::vector<uint8_t>;

/// An array of NumPy, version 1, with its values as they lie in memory.
Bytes npy(const std::string& header, const Bytes& values) {
  std::string text = "\x93NUMPY\x01";
  text += '\0';
  text += char(header.size() & 255);
  text += char(header.size() >> 8);
  text += header;
  Bytes bytes(text.begin(), text.end());
  bytes.insert(bytes.end(), values.begin(), values.end());
  return bytes;
}

std::string npy_header_text(const std::string& type, const std::string& shape, bool fortran = false) {
  return "{'descr': '" + type + "', 'fortran_order': " + (fortran ? "True" : "False") + ", 'shape': " + shape + ", }\n";
}

template <typename Value>
Bytes memory_of(const std::vector<Value>& values, bool big_endian = false) {
  Bytes bytes(values.size() * sizeof(Value));
  std::memcpy(bytes.data(), values.data(), bytes.size());
  if (big_endian)
    for (size_t i = 0; i < bytes.size(); i += sizeof(Value))
      std::reverse(bytes.begin() + long(i), bytes.begin() + long(i + sizeof(Value)));
  return bytes;
}

/// Encoded by OpenCV, which is not ours.
Bytes encoded(const cv::Mat& image, const char* ending) {
  setenv("OPENCV_IO_ENABLE_OPENEXR", "1", 1);
  Bytes bytes;
  REQUIRE(cv::imencode(ending, image, bytes));
  return bytes;
}

cv::Mat float_ramp(int width, int height) {
  cv::Mat image(height, width, CV_32F);
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u) image.at<float>(v, u) = 0.5f + 0.01f * float(u) + 0.1f * float(v);
  return image;
}

template <typename Value>
void check_ramp(const StoredDepth& stored, double scale) {
  REQUIRE(std::holds_alternative<Image<Value>>(stored));
  const auto& image = std::get<Image<Value>>(stored);
  REQUIRE(image.width() == 7);
  REQUIRE(image.height() == 5);
  for (int v = 0; v < 5; ++v)
    for (int u = 0; u < 7; ++u) CHECK(double(image(u, v)) == Approx(scale * (0.5 + 0.01 * u + 0.1 * v)).epsilon(1e-6));
}

std::vector<double> ramp_values(double scale, bool fortran = false) {
  std::vector<double> values;
  for (int i = 0; i < 35; ++i) {
    const int u = fortran ? i / 5 : i % 7, v = fortran ? i % 5 : i / 7;
    values.push_back(scale * (0.5 + 0.01 * u + 0.1 * v));
  }
  return values;
}

template <typename Value>
std::vector<Value> as(const std::vector<double>& values) {
  std::vector<Value> converted;
  for (const double value : values)
    converted.push_back(std::is_integral_v<Value> ? Value(std::lround(value)) : Value(value));
  return converted;
}

/// Depth of frame `i` of the made-up recording, metres.
cv::Mat depth_image(int frame) {
  cv::Mat image(kHeight, kWidth, CV_32F);
  for (int v = 0; v < kHeight; ++v)
    for (int u = 0; u < kWidth; ++u) image.at<float>(v, u) = float(depth_m_at(frame, u));
  return image;
}

Bytes depth_file(int frame, const std::string& ending) {
  const cv::Mat image = depth_image(frame);
  if (ending != ".npy") return encoded(image, ending.c_str());
  const auto* const values = image.ptr<float>();
  return npy(npy_header_text("<f4", "(16, 24)"), memory_of(std::vector<float>(values, values + image.total())));
}

}  // namespace

TEST_CASE("arrays of NumPy give the values they were made of, in every order and type") {
  check_ramp<float>(decode_depth(npy(npy_header_text("<f4", "(5, 7)"), memory_of(as<float>(ramp_values(1)))), "t"), 1);
  check_ramp<float>(decode_depth(npy(npy_header_text("<f8", "(5, 7, 1)"), memory_of(ramp_values(1))), "t"), 1);
  check_ramp<float>(
      decode_depth(npy(npy_header_text(">f4", "(1, 5, 7)"), memory_of(as<float>(ramp_values(1)), true)), "t"), 1);
  check_ramp<float>(
      decode_depth(npy(npy_header_text("<f4", "(5, 7)", true), memory_of(as<float>(ramp_values(1, true)))), "t"), 1);
  check_ramp<uint16_t>(
      decode_depth(npy(npy_header_text("<u2", "(5, 7)"), memory_of(as<uint16_t>(ramp_values(1000)))), "t"), 1000);
  check_ramp<uint16_t>(
      decode_depth(npy(npy_header_text(">i4", "(5,7)"), memory_of(as<int32_t>(ramp_values(1000)), true)), "t"), 1000);
  const auto large = std::get<Image<uint16_t>>(
      decode_depth(npy(npy_header_text("<i8", "(1, 3)"), memory_of(std::vector<int64_t>{-1, 70000, 9})), "t"));
  CHECK(large(0, 0) == 0);
  CHECK(large(1, 0) == 0);
  CHECK(large(2, 0) == 9);
}

TEST_CASE("an array that is no depth image is refused with the reason") {
  const Bytes values = memory_of(as<float>(ramp_values(1)));
  const auto reason = [&](const std::string& header) {
    return reason_of([&] { decode_depth(npy(header, values), "t"); });
  };
  CHECK(reason(npy_header_text("<c8", "(5, 7)")) == "wrong type");
  CHECK(reason(npy_header_text("|O", "(5, 7)")) == "wrong type");
  CHECK(reason(npy_header_text("<f4", "(35,)")) == "wrong type");
  CHECK(reason(npy_header_text("<f4", "(5, 7, 3)")) == "wrong type");
  CHECK(reason(npy_header_text("<f4", "(5, 8)")) == "truncated");
  CHECK(reason(npy_header_text("<f4", "(0, 7)")) == "unreadable");
  CHECK(reason(npy_header_text("<f4", "(-5, 7)")) == "unreadable");
  CHECK(reason(npy_header_text("<f4", "(40000, 40000)")) == "too large");
  CHECK(reason(npy_header_text("<f4", "(4611686018427387904, 4)")) == "unreadable");
  CHECK(reason("{'descr': '<f4', 'shape': (5, 7)}") == "unreadable");
  CHECK(reason("{'descr': '<f4', 'fortran_order': False, 'shape': (5, 7") == "unreadable");
  CHECK(reason("__import__('os')") == "unreadable");
  const Bytes whole = npy(npy_header_text("<f4", "(5, 7)"), values);
  for (size_t size = 6; size < whole.size(); ++size) {
    INFO(size);
    CHECK_FALSE(reason_of([&] { decode_depth(std::span(whole).first(size), "t"); }).empty());
  }
}

TEST_CASE("TIFF and EXR as another library writes them give its values") {
  const cv::Mat ramp = float_ramp(7, 5);
  check_ramp<float>(decode_depth(encoded(ramp, ".tiff"), "t"), 1);
  check_ramp<float>(decode_depth(encoded(ramp, ".exr"), "t"), 1);
  cv::Mat counts, wide, colors;
  ramp.convertTo(counts, CV_16U, 1000);
  check_ramp<uint16_t>(decode_depth(encoded(counts, ".tiff"), "t"), 1000);
  ramp.convertTo(wide, CV_64F);
  check_ramp<float>(decode_depth(encoded(wide, ".tiff"), "t"), 1);
  // Three equal channels, as renderers save depth: the red one is taken.
  cv::merge(std::vector<cv::Mat>{ramp, ramp, ramp}, colors);
  check_ramp<float>(decode_depth(encoded(colors, ".exr"), "t"), 1);
  CHECK(reason_of([&] { decode_depth(encoded(colors, ".tiff"), "t"); }) == "wrong type");
  // Larger than one chunk of scan lines.
  const cv::Mat large = float_ramp(320, 240);
  for (const char* ending : {".tiff", ".exr"}) {
    const auto image = std::get<Image<float>>(decode_depth(encoded(large, ending), "t"));
    CHECK(std::memcmp(image.data(), large.data, image.size() * sizeof(float)) == 0);
  }
}

TEST_CASE("every cut of a TIFF or EXR is refused, and a size that the file cannot hold") {
  for (const char* ending : {".tiff", ".exr"}) {
    const Bytes whole = encoded(float_ramp(40, 30), ending);
    for (size_t size = 0; size < whole.size(); size += size < 600 ? 1 : 37) {
      INFO(ending << " " << size);
      CHECK_FALSE(reason_of([&] { decode_depth(std::span(whole).first(size), "t"); }).empty());
    }
  }
  // The data window of an EXR: its right and lower edges, 39 and 29, made 8000.
  Bytes exr = encoded(float_ramp(40, 30), ".exr");
  const std::string name = "dataWindow";
  const auto at = std::search(exr.begin(), exr.end(), name.begin(), name.end());
  REQUIRE(at != exr.end());
  uint8_t* const box = &*at + name.size() + 1 + 6 + 4;  // name, "box2i", size
  REQUIRE(box[8] == 39);
  const int32_t edge = 8000;
  std::memcpy(box + 8, &edge, 4);
  std::memcpy(box + 12, &edge, 4);
  CHECK_FALSE(reason_of([&] { decode_depth(exr, "t"); }).empty());
}

TEST_CASE("floating-point depth is in metres in every layout, and huge or odd numbers mean nothing measured") {
  const auto ending = GENERATE(".tiff", ".exr", ".npy");
  INFO(ending);
  TemporaryDirectory folder;
  struct Written {
    const char* name;
    void (*write)(const fs::path&, int);
    const char* depth;  ///< of frame 0
  };
  for (const Written& w :
       {Written{"generic", write_generic, "depth/0.png"}, Written{"icl", write_icl, "depth/0.png"},
        Written{"scannet", write_scannet, "depth/0.png"}, Written{"redwood", write_redwood, "depth/00000.png"},
        Written{"replica", write_replica, "results/depth000000.png"},
        Written{"7scenes", write_seven_scenes, "seq-01/frame-000000.depth.png"},
        Written{"tum", write_tum, "depth/100.000000.png"}}) {
    INFO(w.name);
    const fs::path path = folder.path() / w.name;
    w.write(path, 1);
    fs::path depth = path / w.depth;
    fs::remove(depth);
    write_bytes(depth.replace_extension(ending), depth_file(0, ending));
    if (w.write == write_tum)
      write_text(path / "depth.txt", std::string("100.000000 depth/100.000000") + ending + "\n");
    if (w.write == write_generic)
      write_text(path / "sequence.yaml", "camera: {fx: 20, fy: 20, cx: 11.5, cy: 7.5, width: 24, height: 16}\n");
    const auto reader = open_sequence(path);
    CHECK(reader->info().depth_scale == 1);
    const ReadResult read = reader->read(0);
    REQUIRE(std::holds_alternative<Frame>(read));
    for (int u = 0; u < kWidth; ++u) CHECK(std::get<Frame>(read).depth_m(u, 3) == float(depth_m_at(0, u)));
  }
  // Told, the scale holds for floating-point numbers too.
  CHECK(std::get<Frame>(open_sequence(folder.path() / "icl", {.depth_scale = 2})->read(0)).depth_m(4, 3) ==
        Approx(depth_m_at(0, 4) / 2));
}

TEST_CASE("what no sensor measures is nothing: not a number, infinity, the far plane of a renderer") {
  TemporaryDirectory folder;
  write_icl(folder.path(), 1);
  cv::Mat depth = depth_image(0);
  const float odd[] = {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), 1e10f, -1, 0};
  for (int i = 0; i < 5; ++i) depth.at<float>(2, i) = odd[i];
  fs::remove(folder.path() / "depth" / "0.png");
  write_bytes(folder.path() / "depth" / "0.tiff", encoded(depth, ".tiff"));
  const auto frame = std::get<Frame>(open_sequence(folder.path())->read(0));
  for (int i = 0; i < 5; ++i) CHECK(frame.depth_m(i, 2) == 0);
  CHECK(frame.depth_m(5, 2) == float(depth_m_at(0, 5)));
}
