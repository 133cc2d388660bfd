#include "io/sequence/listed_sequence.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/error.h"
#include "core/text.h"
#include "io/images/depth_decode.h"
#include "io/images/image_decode.h"
#include "io/sequence/camera_file.h"
#include "io/sequence/depth_camera.h"
#include "io/sequence/frame_selection.h"
#include "io/sequence/image_source.h"
#include "io/sequence/lidar_scan.h"
#include "io/sequence/probability_images.h"
#include "io/sequence/recorded_pose.h"
#include "io/sequence/registration.h"
#include "io/sequence/sequence_fingerprint.h"
#include "io/sequence/skip_reasons.h"

namespace felt {
namespace fs = std::filesystem;
namespace {

/// No sensor sees as far; what floating-point depth holds beyond it means nothing measured.
constexpr float kFarthestMetres = 10000;

class ListedSequence final : public SequenceReader {
public:
  ListedSequence(const fs::path& path, const SequenceOptions& options, SequenceListing listing);

  const SequenceInfo& info() const override { return info_; }
  int64_t size() const override { return int64_t(listing_.frames.size()); }
  FrameName name(int64_t i) const override {
    return {listing_.frames[size_t(i)].index, listing_.frames[size_t(i)].stamp_s};
  }
  ReadResult read(int64_t i) const override;

private:
  /// Throws FormatError where the first colour image cannot be the stated camera's.
  void check_color_camera(const fs::path& path) const;
  int probability_ranks() const;
  Eigen::Isometry3d read_pose(const FrameRecord& frame) const;
  DepthImage read_depth(const ImageSource& source) const;
  template <typename Stored>
  DepthImage metres_of(const Image<Stored>& stored, const ImageSource& source) const;
  ColorImage read_color(const ImageSource& source, const DepthImage& depth_m) const;
  /// Ids on the depth grid. An image of another size than depth's must have that of the colour image, where one is
  /// named, else only its shape.
  Image<uint16_t> read_ids(const ImageSource& source, const std::string& kind, const DepthImage& depth_m,
                           const ImageSource* color) const;
  LabelImage read_labels(const FrameRecord& frame, const DepthImage& depth_m) const;
  Image<uint16_t> read_masks(const std::vector<ImageSource>& masks, const DepthImage& depth_m) const;
  Image<uint16_t> read_probability_planes(const ImageSource& source, float& scale) const;
  ProbabilityImage read_probabilities(const ImageSource& source, const LabelImage& labels) const;
  ProbabilityImage read_class_maps(const FrameRecord& frame) const;
  /// A network's id by --label-offset; kNoLabel where it leaves 16 bits.
  uint16_t moved(uint16_t id) const {
    const int to = id + label_offset_;
    return id != kNoLabel && to >= 0 && to < kNoLabel ? uint16_t(to) : kNoLabel;
  }
  PinholeCamera camera_of_color_grid(int width, int height) const;
  bool on_depth_grid(int width, int height) const;
  /// Colour without a camera of its own comes through the depth camera's lens.
  const Distortion& color_distortion() const {
    return listing_.color_intrinsics ? listing_.color_distortion : listing_.distortion;
  }

  SequenceListing listing_;
  SequenceInfo info_;
  bool with_color_, with_instances_, bgr_;
  int label_offset_;
  Image<int32_t> undistortion_;    ///< of the depth grid; empty where the lens does not distort
  Image<float> z_per_ray_length_;  ///< empty where depth lies along the optical axis
};

ListedSequence::ListedSequence(const fs::path& path, const SequenceOptions& options, SequenceListing listing)
    : listing_(std::move(listing)) {
  info_.layout = listing_.layout;
  info_.path = path;
  info_.depth_scale = listing_.depth_scale;
  info_.pose_convention = to_string(listing_.pose_convention);
  info_.classes = listing_.classes;
  info_.notes = listing_.notes;
  info_.voxel_size_m = listing_.voxel_size_m, info_.max_depth_m = listing_.max_depth_m;
  info_.properties_file = listing_.properties_file;
  info_.touches_file = listing_.touches_file;
  info_.recorded_frames = int64_t(listing_.frames.size());
  info_.fingerprint = fingerprint(listing_);
  info_.content = frames_content(listing_);
  info_.camera = find_depth_camera(listing_, path);
  info_.reading = reading_text(listing_, info_.camera);

  select_frames(options.frames, listing_);
  const auto any = [&](auto test) { return std::any_of(listing_.frames.begin(), listing_.frames.end(), test); };
  bgr_ = options.bgr;
  label_offset_ = options.label_offset;
  with_color_ = options.read_color && any([](const FrameRecord& f) { return !f.color.empty(); });
  info_.has_color = with_color_;
  if (with_color_ && listing_.color_intrinsics) check_color_camera(path);
  info_.has_labels = any([](const FrameRecord& f) { return !f.labels.empty(); });
  info_.has_probabilities = any([](const FrameRecord& f) { return !f.probabilities.empty() || !f.class_maps.empty(); });
  if (info_.has_probabilities) info_.probability_ranks = probability_ranks();
  with_instances_ = options.read_instances;
  info_.has_instances = any([](const FrameRecord& f) { return !f.instances.empty() || !f.masks.empty(); });

  if (!listing_.distortion.none()) undistortion_ = undistortion_map(info_.camera, listing_.distortion);
  if (listing_.depth_is_ray_length) {
    z_per_ray_length_ = Image<float>(info_.camera.width, info_.camera.height);
    for (int v = 0; v < info_.camera.height; ++v)
      for (int u = 0; u < info_.camera.width; ++u) z_per_ray_length_(u, v) = float(1 / info_.camera.ray(u, v).norm());
  }
}

void ListedSequence::check_color_camera(const fs::path& path) const {
  for (const FrameRecord& frame : listing_.frames) {
    if (frame.color.empty() || !frame.fault.empty()) continue;
    ImageHeader header;
    try {
      header = decoded(frame.color, "colour", read_image_header);
    } catch (const SkipFrame&) {
      continue;  // that frame is skipped and counted when it is read
    }
    if (listing_.color_width > 0 && (header.width != listing_.color_width || header.height != listing_.color_height))
      throw FormatError(describe_mismatch(
          path.string(), "size of colour images",
          size_text(listing_.color_width, listing_.color_height) + " as their camera says (--no-color does without)",
          size_text(header.width, header.height) + " in the first one"));
    return check_camera_fits_image(camera_of_color_grid(header.width, header.height),
                                   path.string() + ": colour camera");
  }
}

/// Of the first frame that has any; the others are made alike.
int ListedSequence::probability_ranks() const {
  for (const FrameRecord& frame : listing_.frames) {
    if (!frame.class_maps.empty()) return kMostClassMaps + 1;
    if (frame.probabilities.empty()) continue;
    try {
      const ImageHeader header = decoded(frame.probabilities, "probability", read_image_header);
      return std::max(1, header.height / (2 * info_.camera.height));
    } catch (const SkipFrame&) {
    }
  }
  return 1;
}

ReadResult ListedSequence::read(int64_t i) const {
  const FrameRecord& record = listing_.frames[size_t(i)];
  if (!record.fault.empty()) return SkippedFrame{record.index, record.fault, record.fault_detail};
  try {
    Frame frame;
    frame.index = record.index;
    frame.stamp_s = record.stamp_s;
    frame.camera = info_.camera;
    frame.T_world_camera = read_pose(record);
    frame.depth_m = read_depth(record.depth);
    if (with_color_) frame.color = read_color(record.color, frame.depth_m);
    if (!record.labels.empty()) frame.labels = read_labels(record, frame.depth_m);
    if (with_instances_ && !record.instances.empty())
      frame.instances = read_ids(record.instances, "instance", frame.depth_m, &record.color);
    if (with_instances_ && !record.masks.empty()) frame.instances = read_masks(record.masks, frame.depth_m);
    if (!record.probabilities.empty())
      frame.probabilities = read_probabilities(record.probabilities, frame.labels);
    else if (!record.class_maps.empty())
      frame.probabilities = read_class_maps(record);
    return frame;
  } catch (const SkipFrame& skip) {
    return SkippedFrame{record.index, skip.reason, "frame " + std::to_string(record.index) + ": " + skip.detail};
  }
}

Eigen::Isometry3d ListedSequence::read_pose(const FrameRecord& frame) const {
  const auto recorded = recorded_pose(frame);
  if (const auto* problem = std::get_if<PoseProblem>(&recorded)) throw SkipFrame{problem->reason, problem->detail};
  return camera_pose(std::get<Eigen::Isometry3d>(recorded), listing_.pose_convention, listing_.T_body_camera);
}

template <typename Stored>
DepthImage ListedSequence::metres_of(const Image<Stored>& stored, const ImageSource& source) const {
  if (stored.width() != info_.camera.width || stored.height() != info_.camera.height)
    throw SkipFrame{"wrong-size depth image",
                    describe_mismatch(source.path.string(), "size", size_text(info_.camera.width, info_.camera.height),
                                      size_text(stored.width(), stored.height()))};
  DepthImage depth_m(stored.width(), stored.height());
  const bool rotated = listing_.depth_encoding == DepthEncoding::rotated3;
  const float scale = float(listing_.depth_scale);
  for (size_t p = 0; p < stored.size(); ++p) {
    Stored value = stored.data()[p];
    if constexpr (std::is_integral_v<Stored>) {
      if (rotated) value = Stored(value >> 3 | value << 13);
      if (value != 0 && value != 0xffff) depth_m.data()[p] = float(value) / scale;
    } else {
      // Renderers write a huge number where a ray meets nothing; NaN fails both comparisons.
      if (const float metres = value / scale; metres > 0 && metres < kFarthestMetres) depth_m.data()[p] = metres;
    }
  }
  return depth_m;
}

DepthImage ListedSequence::read_depth(const ImageSource& source) const {
  if (source.codec == ImageSource::Codec::scan) {
    DepthImage depth_m = decoded(source, "depth", [&](std::span<const uint8_t> bytes, const std::string& where) {
      return depth_of_scan(decode_scan(bytes, where), source.face);
    });
    if (std::none_of(depth_m.begin(), depth_m.end(), [](float depth) { return depth > 0; }))
      throw SkipFrame{kDepthAllZero, source.path.string()};
    return depth_m;
  }
  const StoredDepth stored = decoded(source, "depth", [&](std::span<const uint8_t> bytes, const std::string& where) {
    if (source.codec == ImageSource::Codec::image_file) return decode_depth(bytes, where);
    return StoredDepth(decode_u16_values(bytes, source.codec == ImageSource::Codec::zlib_u16, info_.camera.width,
                                         info_.camera.height, where));
  });
  DepthImage depth_m = std::visit([&](const auto& image) { return metres_of(image, source); }, stored);
  if (std::none_of(depth_m.begin(), depth_m.end(), [](float depth) { return depth > 0; }))
    throw SkipFrame{kDepthAllZero, source.path.string()};
  if (!undistortion_.empty()) depth_m = undistorted(depth_m, undistortion_, 0.0f);
  for (size_t p = 0; p < z_per_ray_length_.size(); ++p) depth_m.data()[p] *= z_per_ray_length_.data()[p];
  return depth_m;
}

bool ListedSequence::on_depth_grid(int width, int height) const {
  return width == info_.camera.width && height == info_.camera.height && !listing_.color_intrinsics &&
         listing_.T_color_depth.isIdentity(0);
}

PinholeCamera ListedSequence::camera_of_color_grid(int width, int height) const {
  if (!listing_.color_intrinsics) return resized(info_.camera, width, height);
  const Intrinsics& k = *listing_.color_intrinsics;
  return {k.fx, k.fy, k.cx, k.cy, width, height};
}

ColorImage ListedSequence::read_color(const ImageSource& source, const DepthImage& depth_m) const {
  ColorImage image = decoded(source, "colour", decode_color);
  if (bgr_)
    for (Rgba8& pixel : image) std::swap(pixel.r, pixel.b);
  const Rgba8 outside{0, 0, 0, 0};
  if (on_depth_grid(image.width(), image.height())) {
    if (!undistortion_.empty()) image = undistorted(image, undistortion_, outside);
    return image;
  }
  return registered_to_depth(image, camera_of_color_grid(image.width(), image.height()), depth_m, info_.camera,
                             listing_.T_color_depth, outside, color_distortion());
}

Image<uint16_t> ListedSequence::read_ids(const ImageSource& source, const std::string& kind, const DepthImage& depth_m,
                                         const ImageSource* color) const {
  Image<uint16_t> image = decoded(source, kind, decode_gray16);
  if (image.width() == info_.camera.width && image.height() == info_.camera.height) {
    if (!undistortion_.empty()) image = undistorted(image, undistortion_, kNoLabel);
    return image;
  }
  std::string expected = size_text(info_.camera.width, info_.camera.height);
  bool fits = false;
  if (color == nullptr) {
    const double shape = double(image.width()) * info_.camera.height / (double(image.height()) * info_.camera.width);
    fits = listing_.color_intrinsics || std::abs(shape - 1) <= 0.02;
  } else if (!color->empty()) {  // networks label the colour image
    const ImageHeader header = decoded(*color, "colour", read_image_header);
    fits = image.width() == header.width && image.height() == header.height;
    expected += ", or the colour image's " + size_text(header.width, header.height);
  }
  if (!fits)
    throw SkipFrame{"wrong-size " + kind + " image", describe_mismatch(source.path.string(), "size", expected,
                                                                       size_text(image.width(), image.height()))};
  return registered_to_depth<uint16_t>(image, camera_of_color_grid(image.width(), image.height()), depth_m,
                                       info_.camera, listing_.T_color_depth, kNoLabel, color_distortion());
}

LabelImage ListedSequence::read_labels(const FrameRecord& frame, const DepthImage& depth_m) const {
  LabelImage labels = read_ids(frame.labels, "label", depth_m, &frame.color);
  if (label_offset_ != 0)
    for (uint16_t& id : labels) id = moved(id);
  return labels;
}

Image<uint16_t> ListedSequence::read_masks(const std::vector<ImageSource>& masks, const DepthImage& depth_m) const {
  // Where masks overlap the smaller one is on top: a cup on its table. A soft mask counts from half of its peak.
  struct Mask {
    Image<uint16_t> image;
    uint16_t least, number;
    int64_t area;
  };
  std::vector<Mask> all;
  for (const ImageSource& source : masks) {
    if (all.size() + 1 == kNoLabel) throw SkipFrame{"too many masks", source.path.parent_path().string()};
    Mask mask{read_ids(source, "mask", depth_m, nullptr), 1, uint16_t(all.size() + 1), 0};
    for (uint16_t& value : mask.image)
      if (value == kNoLabel) value = 0;  // outside the labelled image
    mask.least = uint16_t(std::max(1, (*std::max_element(mask.image.begin(), mask.image.end()) + 1) / 2));
    mask.area =
        std::count_if(mask.image.begin(), mask.image.end(), [&](uint16_t value) { return value >= mask.least; });
    all.push_back(std::move(mask));
  }
  std::stable_sort(all.begin(), all.end(), [](const Mask& a, const Mask& b) { return a.area > b.area; });
  Image<uint16_t> instances(info_.camera.width, info_.camera.height, 0);
  for (const Mask& mask : all)
    for (size_t p = 0; p < instances.size(); ++p)
      if (mask.image.data()[p] >= mask.least) instances.data()[p] = mask.number;
  return instances;
}

/// What the values of a probability image are out of: 255 or 65535.
float full_scale(std::span<const uint8_t> bytes, const std::string& where) {
  return read_image_header(bytes, where).bits > 8 ? 65535.0f : 255.0f;
}

Image<uint16_t> ListedSequence::read_probability_planes(const ImageSource& source, float& scale) const {
  Image<uint16_t> planes =
      decoded(source, "probability", [&](std::span<const uint8_t> bytes, const std::string& where) {
        scale = full_scale(bytes, where);
        return decode_gray16(bytes, where);
      });
  const int width = info_.camera.width, height = info_.camera.height;
  if (undistortion_.empty() || planes.width() != width || planes.height() % height != 0) return planes;
  // Every plane came through the depth camera's lens, as labels do; what it did not see has no probability.
  Image<uint16_t> straight(width, planes.height());
  for (int top = 0; top < planes.height(); top += height) {
    uint16_t* const to = straight.row(top);
    const uint16_t* const from = planes.row(top);
    for (size_t p = 0; p < undistortion_.size(); ++p)
      if (const int32_t pixel = undistortion_.data()[p]; pixel >= 0) to[p] = from[pixel];
  }
  return straight;
}

ProbabilityImage ListedSequence::read_probabilities(const ImageSource& source, const LabelImage& labels) const {
  const int width = info_.camera.width, height = info_.camera.height;
  float scale = 1;
  const Image<uint16_t> stack = read_probability_planes(source, scale);
  if (stack.width() == width && stack.height() == height && !labels.empty())
    return probabilities_of_confidence(labels, stack, scale);
  if (stack.width() != width || stack.height() % (2 * height) != 0)
    throw SkipFrame{
        "wrong-size probability image",
        describe_mismatch(source.path.string(), "size",
                          std::to_string(width) + " x 2 m " + std::to_string(height) + " for the m best, or " +
                              size_text(width, height) + " for the confidence of label images",
                          size_text(stack.width(), stack.height()))};
  ProbabilityImage image = probabilities_of_stack(stack, height, scale);
  for (uint16_t& id : image.class_id) id = moved(id);
  return image;
}

ProbabilityImage ListedSequence::read_class_maps(const FrameRecord& frame) const {
  std::vector<DecodedClassMap> maps;
  for (const ClassMap& map : frame.class_maps) {
    float scale = 1;
    Image<uint16_t> values = read_probability_planes(map.image, scale);
    if (values.width() != info_.camera.width || values.height() != info_.camera.height)
      throw SkipFrame{
          "wrong-size probability image",
          describe_mismatch(map.image.path.string(), "size", size_text(info_.camera.width, info_.camera.height),
                            size_text(values.width(), values.height()))};
    const uint16_t id = map.from_network ? moved(map.class_id) : map.class_id;
    if (id != kNoLabel) maps.push_back({id, std::move(values), map.score / scale});
  }
  return joined_class_maps(maps, listing_.classes.known(0));
}

}  // namespace

std::unique_ptr<SequenceReader> make_listed_sequence(const fs::path& path, const SequenceOptions& options,
                                                     SequenceListing listing) {
  return std::make_unique<ListedSequence>(path, options, std::move(listing));
}

}  // namespace felt
