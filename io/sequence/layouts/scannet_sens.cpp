#include <algorithm>
#include <bit>
#include <cstring>
#include <fstream>

#include "core/error.h"
#include "core/text.h"
#include "io/sequence/camera_file.h"
#include "io/sequence/layouts.h"
#include "io/sequence/layouts/file_names.h"
#include "io/sequence/skip_reasons.h"

// ScanNet's .sens container, version 4 (Dai et al., CVPR 2017; layout as its SensorData reader documents it): a header,
// then per frame a pose, two stamps, two sizes, the compressed colour and depth. Opening walks over the frame headers
// only; images are read when their frame is.
namespace felt {
namespace fs = std::filesystem;
namespace {

static_assert(std::endian::native == std::endian::little, "the container is little-endian");

enum : int32_t { kColorPng = 1, kColorJpeg = 2, kDepthRaw = 0, kDepthZlib = 1 };

/// Reads values one after the other and knows where it is.
class Container {
public:
  explicit Container(const fs::path& path)
      : path_(path), file_(path, std::ios::binary), size_(uint64_t(fs::file_size(path))) {
    if (!file_) throw IoError(describe_mismatch(path.string(), "file", "a readable file", "no permission to open it"));
  }
  template <typename T>
  T value(const char* what) {
    T read{};
    bytes(&read, sizeof read, what);
    return read;
  }
  void bytes(void* to, uint64_t count, const char* what) {
    if (count > left()) throw truncated(what);
    file_.read(static_cast<char*>(to), std::streamsize(count));
    at_ += count;
  }
  void skip(uint64_t count, const char* what) {
    if (count > left()) throw truncated(what);
    at_ += count;
    file_.seekg(std::streamoff(at_));
  }
  uint64_t at() const { return at_; }
  uint64_t left() const { return size_ - at_; }
  FormatError truncated(const char* what) const {
    return FormatError(
        describe_mismatch(path_.string() + " at byte " + std::to_string(at_), what, "more bytes", "the end"));
  }

private:
  fs::path path_;
  std::ifstream file_;
  uint64_t size_, at_ = 0;
};

Eigen::Matrix4d read_matrix(Container& file, const char* what) {
  float numbers[16];
  file.bytes(numbers, sizeof numbers, what);
  Eigen::Matrix4d matrix;
  for (int i = 0; i < 16; ++i) matrix(i / 4, i % 4) = double(numbers[i]);
  return matrix;
}

Intrinsics intrinsics_of(const Eigen::Matrix4d& matrix, const std::string& where) {
  return intrinsics_of_numbers({matrix(0, 0), matrix(1, 1), matrix(0, 2), matrix(1, 2)}, where);
}

/// The file itself, or those directly in a folder.
std::vector<fs::path> containers_at(const fs::path& path) {
  if (!fs::is_directory(path)) return path.extension() == ".sens" ? std::vector{path} : std::vector<fs::path>{};
  std::vector<fs::path> found;
  for (const fs::path& entry : entries_of(path))
    if (entry.extension() == ".sens") found.push_back(entry);
  return found;
}

bool recognises(const fs::path& path) { return !containers_at(path).empty(); }

/// Before the images of a frame: its pose, two stamps, two sizes.
constexpr uint64_t kFrameHeaderBytes = 16 * sizeof(float) + 4 * sizeof(uint64_t);

/// A container cut short keeps its `whole` first frames of `count`. The others are listed all the same, without images:
/// so they are counted wherever frames are.
void list_lost_frames(const fs::path& path, uint64_t whole, uint64_t count, SequenceListing& listing) {
  constexpr uint64_t kMostLost = 10000;  // a wrong count must not make us list a million empty frames
  listing.notes.push_back(describe_mismatch(
      path.string(), "container", std::to_string(count) + " frames",
      "the end after " + std::to_string(whole) + ": it was cut short when it was recorded or copied"));
  std::vector<FrameRecord>& frames = listing.frames;
  const double last_stamp_s = frames.empty() ? 0 : frames.back().stamp_s;
  for (uint64_t i = frames.size(); i < count && i - whole < kMostLost; ++i) {
    FrameRecord frame;
    frame.index = int64_t(i);
    frame.stamp_s = listing.stamped ? last_stamp_s : double(i);
    frame.fault = kMissingDepth;
    frame.fault_detail = path.string() + ": ends before frame " + std::to_string(i);
    frames.push_back(std::move(frame));
  }
}

SequenceListing list(const fs::path& file_or_folder, const SequenceOptions& options) {
  const std::vector<fs::path> containers = containers_at(file_or_folder);
  if (containers.size() != 1)
    throw FormatError(describe_mismatch(file_or_folder.string(), "sequence", "one file *.sens; name the one to read",
                                        std::to_string(containers.size()) + " of them"));
  const fs::path& path = containers.front();
  SequenceListing listing;
  Container file(path);
  const auto version = file.value<uint32_t>("version");
  if (version != 4) throw FormatError(describe_mismatch(path.string(), "version", "4", std::to_string(version)));
  file.skip(file.value<uint64_t>("length of the sensor's name"), "sensor's name");
  const Eigen::Matrix4d color_camera = read_matrix(file, "colour camera"),
                        color_pose = read_matrix(file, "colour pose"), depth_camera = read_matrix(file, "depth camera"),
                        depth_pose = read_matrix(file, "depth pose");
  const auto color_codec = file.value<int32_t>("colour codec"), depth_codec = file.value<int32_t>("depth codec");
  const auto color_width = file.value<uint32_t>("width"), color_height = file.value<uint32_t>("height"),
             depth_width = file.value<uint32_t>("width"), depth_height = file.value<uint32_t>("height");
  const auto depth_shift = file.value<float>("depth shift");
  const auto count = file.value<uint64_t>("number of frames");
  if ((color_codec != kColorPng && color_codec != kColorJpeg) ||
      (depth_codec != kDepthRaw && depth_codec != kDepthZlib))
    throw FormatError(describe_mismatch(path.string(), "codecs", "JPEG or PNG colour and raw or zlib depth",
                                        std::to_string(color_codec) + " and " + std::to_string(depth_codec)));
  if (depth_width == 0 || depth_height == 0 || depth_width > 8192 || depth_height > 8192 || !(depth_shift > 0))
    throw FormatError(describe_mismatch(path.string(), "depth images", "a size up to 8192 x 8192 and a scale above 0",
                                        size_text(depth_width, depth_height)));
  listing.width = int(depth_width), listing.height = int(depth_height);
  listing.depth_scale = double(depth_shift);
  if (!options.intrinsics) listing.intrinsics = intrinsics_of(depth_camera, path.string());
  if (color_width != depth_width || color_height != depth_height || color_camera != depth_camera)
    listing.color_intrinsics = intrinsics_of(color_camera, path.string()), listing.color_width = int(color_width),
    listing.color_height = int(color_height);
  if (color_pose != depth_pose) listing.T_color_depth = color_pose.inverse() * depth_pose;

  const auto codec = depth_codec == kDepthZlib ? ImageSource::Codec::zlib_u16 : ImageSource::Codec::raw_u16;
  uint64_t whole_frames = 0;
  for (uint64_t i = 0; i < count && file.left() >= kFrameHeaderBytes; ++i) {
    FrameRecord frame;
    frame.index = int64_t(i);
    frame.pose = read_matrix(file, "pose");
    file.skip(8, "colour stamp");
    frame.stamp_s = double(file.value<uint64_t>("depth stamp")) * 1e-6;
    const auto color_bytes = file.value<uint64_t>("colour size"), depth_bytes = file.value<uint64_t>("depth size");
    const uint64_t color_at = file.at();
    const bool whole = color_bytes <= file.left() && depth_bytes <= file.left() - color_bytes;
    if (!whole) {
      frame.fault = kTruncatedDepth;
      frame.fault_detail = path.string() + ": ends within frame " + std::to_string(i);
      listing.frames.push_back(std::move(frame));
      break;
    }
    if (color_bytes > 0) frame.color = {path, color_at, color_bytes, ImageSource::Codec::image_file};
    if (depth_bytes > 0) frame.depth = {path, color_at + color_bytes, depth_bytes, codec};
    listing.frames.push_back(std::move(frame));
    file.skip(color_bytes + depth_bytes, "images");
    ++whole_frames;
  }
  // Many containers hold zeros or repeated moments: frame numbers then.
  std::vector<FrameRecord>& frames = listing.frames;
  listing.stamped = std::adjacent_find(frames.begin(), frames.end(), [](const FrameRecord& a, const FrameRecord& b) {
                      return !(a.stamp_s < b.stamp_s);
                    }) == frames.end();
  if (!listing.stamped)
    for (FrameRecord& frame : frames) frame.stamp_s = double(frame.index);
  if (whole_frames < count) list_lost_frames(path, whole_frames, count, listing);
  return listing;
}

}  // namespace

const Layout kSensLayout = {"sens", "a file *.sens, or a folder with one", recognises, list};

}  // namespace felt
