#include "io/images/exr_decode.h"

#include <OpenEXR/openexr.h>

#include <algorithm>
#include <cstring>
#include <string_view>

#include "core/text.h"

namespace felt {
namespace {

constexpr uint8_t kSignature[4] = {0x76, 0x2f, 0x31, 0x01};
/// Of the compressions of OpenEXR, what packs an empty image best: PIZ, some thousands of bytes in one.
constexpr uint64_t kMostExpansion = 8192;

/// The file's bytes as the library reads them, and what it complains of first.
struct Source {
  std::span<const uint8_t> bytes;
  std::string complaint;
};

const Source& source_of(void* user_data) { return *static_cast<Source*>(user_data); }

int64_t read_bytes(exr_const_context_t, void* user_data, void* to, uint64_t count, uint64_t offset,
                   exr_stream_error_func_ptr_t) {
  const std::span<const uint8_t> bytes = source_of(user_data).bytes;
  if (offset >= bytes.size()) return 0;
  const uint64_t taken = std::min<uint64_t>(count, bytes.size() - offset);
  std::memcpy(to, bytes.data() + offset, size_t(taken));
  return int64_t(taken);
}

int64_t size_of(exr_const_context_t, void* user_data) { return int64_t(source_of(user_data).bytes.size()); }

void keep_complaint(exr_const_context_t context, exr_result_t, const char* message) {
  void* user_data = nullptr;
  if (exr_get_user_data(context, &user_data) != EXR_ERR_SUCCESS || user_data == nullptr) return;
  auto* source = static_cast<Source*>(user_data);
  if (source->complaint.empty() && message != nullptr) source->complaint = std::string(message).substr(0, 200);
}

/// An opened file of which nothing but the header has been read.
class Exr {
public:
  Exr(std::span<const uint8_t> file, const std::string& where) : source_{file, {}}, where_(where) {
    exr_context_initializer_t setup = EXR_DEFAULT_CONTEXT_INITIALIZER;
    setup.user_data = &source_;
    setup.read_fn = read_bytes;
    setup.size_fn = size_of;
    setup.error_handler_fn = keep_complaint;
    // The name is only for the library's own messages.
    check(exr_start_read(&context_, "depth", &setup), "a header");
    try {
      read_header();
    } catch (...) {
      exr_finish(&context_);
      throw;
    }
  }
  ~Exr() { exr_finish(&context_); }
  Exr(const Exr&) = delete;
  Exr& operator=(const Exr&) = delete;

  const ImageHeader& header() const { return header_; }

  Image<float> read() {
    if (storage_ != EXR_STORAGE_SCANLINE)
      throw ImageError("wrong type", describe_mismatch(where_, "EXR", "scan lines", "tiles or deep pixels"));
    const std::string channel = depth_channel();
    const uint64_t bytes = uint64_t(header_.width) * uint64_t(header_.height) * sizeof(float);
    if (bytes > kMostExpansion * source_.bytes.size())
      throw ImageError("truncated", describe_mismatch(where_, "EXR", std::to_string(bytes) + " bytes of pixels",
                                                      "a file of " + std::to_string(source_.bytes.size())));
    Image<float> image(header_.width, header_.height);
    Pipeline pipeline{context_};
    int32_t lines = 0;
    check(exr_get_scanlines_per_chunk(context_, 0, &lines), "scan lines");
    for (int v = 0; v < header_.height; v += lines) {
      exr_chunk_info_t chunk{};
      check(exr_read_scanline_chunk_info(context_, 0, window_.min.y + v, &chunk), "scan lines");
      if (lines < 1 || chunk.height < 1 || chunk.height > header_.height - v || chunk.width != header_.width)
        throw unreadable("chunks of whole scan lines", "others");
      check(v == 0 ? exr_decoding_initialize(context_, 0, &chunk, &pipeline.decode)
                   : exr_decoding_update(context_, 0, &chunk, &pipeline.decode),
            "scan lines");
      for (int c = 0; c < pipeline.decode.channel_count; ++c) {
        exr_coding_channel_info_t& info = pipeline.decode.channels[c];
        info.decode_to_ptr = nullptr;
        if (info.channel_name != channel) continue;
        info.decode_to_ptr = reinterpret_cast<uint8_t*>(image.row(v));
        info.user_bytes_per_element = sizeof(float);
        info.user_data_type = EXR_PIXEL_FLOAT;
        info.user_pixel_stride = sizeof(float);
        info.user_line_stride = int32_t(sizeof(float)) * header_.width;
      }
      if (v == 0) check(exr_decoding_choose_default_routines(context_, 0, &pipeline.decode), "scan lines");
      check(exr_decoding_run(context_, 0, &pipeline.decode), "whole scan lines");
    }
    return image;
  }

private:
  struct Pipeline {
    exr_const_context_t context;
    exr_decode_pipeline_t decode{};
    ~Pipeline() { exr_decoding_destroy(context, &decode); }
  };

  void read_header() {
    const exr_attr_chlist_t* channels = nullptr;
    check(exr_get_storage(context_, 0, &storage_), "a kind of image");
    check(exr_get_data_window(context_, 0, &window_), "a size");
    check(exr_get_channels(context_, 0, &channels), "channels");
    const int64_t width = int64_t(window_.max.x) - window_.min.x + 1,
                  height = int64_t(window_.max.y) - window_.min.y + 1;
    if (width < 1 || height < 1 || width > 0x7fffffff || height > 0x7fffffff || channels->num_channels < 1)
      throw unreadable("a size and channels",
                       size_text(width, height) + ", " + std::to_string(channels->num_channels) + " channels");
    const int bits = channels->entries[0].pixel_type == EXR_PIXEL_HALF ? 16 : 32;
    header_ = {ImageFormat::exr, int(width), int(height), channels->num_channels, bits, true};
  }

  std::string depth_channel() const {
    const exr_attr_chlist_t* channels = nullptr;
    check(exr_get_channels(context_, 0, &channels), "channels");
    const auto channel = [&](int i) -> const exr_attr_chlist_entry_t& { return channels->entries[i]; };
    int chosen = channels->num_channels == 1 ? 0 : -1;
    for (const std::string_view name : {"Z", "Y", "R"})
      for (int i = 0; i < channels->num_channels && chosen < 0; ++i) {
        const std::string_view full = channel(i).name.str;
        if (full == name || full.ends_with("." + std::string(name))) chosen = i;
      }
    if (chosen < 0)
      throw ImageError("wrong type",
                       describe_mismatch(where_, "EXR", "one channel, or one of the name Z, Y or R",
                                         std::to_string(channels->num_channels) + " channels of other names"));
    if (channel(chosen).x_sampling != 1 || channel(chosen).y_sampling != 1)
      throw ImageError("wrong type", describe_mismatch(where_, "EXR", "depth of every pixel", "subsampled depth"));
    return channel(chosen).name.str;
  }

  ImageError unreadable(const char* expected, const std::string& found) const {
    return ImageError("unreadable", describe_mismatch(where_, "EXR", expected, found));
  }
  void check(exr_result_t result, const char* expected) const {
    if (result != EXR_ERR_SUCCESS)
      throw unreadable(expected, source_.complaint.empty() ? exr_get_default_error_message(result) : source_.complaint);
  }

  Source source_;
  const std::string& where_;
  exr_context_t context_ = nullptr;
  exr_storage_t storage_ = EXR_STORAGE_SCANLINE;
  exr_attr_box2i_t window_{};
  ImageHeader header_;
};

}  // namespace

bool is_exr(std::span<const uint8_t> file) {
  return file.size() >= sizeof kSignature && std::memcmp(file.data(), kSignature, sizeof kSignature) == 0;
}

ImageHeader exr_header(std::span<const uint8_t> file, const std::string& where) { return Exr(file, where).header(); }

Image<float> decode_exr(std::span<const uint8_t> file, const std::string& where) { return Exr(file, where).read(); }

}  // namespace felt
