#include "io/images/tiff_decode.h"

#include <tiffio.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <memory>
#include <vector>

#include "core/text.h"

namespace felt {
namespace {

/// LZW: a code of 12 bits stands for at most 4096 bytes. The other compressions that are read expand less.
constexpr uint64_t kMostExpansion = 2731;

/// The file's bytes as libtiff reads them, and what it complains of first.
struct Source {
  std::span<const uint8_t> bytes;
  uint64_t at = 0;
  std::string complaint;
};

tmsize_t read_bytes(thandle_t handle, void* to, tmsize_t count) {
  auto* source = static_cast<Source*>(handle);
  const uint64_t left = source->bytes.size() - std::min<uint64_t>(source->at, source->bytes.size());
  const size_t taken = size_t(std::min<uint64_t>(left, uint64_t(std::max<tmsize_t>(0, count))));
  if (taken > 0) std::memcpy(to, source->bytes.data() + source->at, taken);
  source->at += taken;
  return tmsize_t(taken);
}

tmsize_t write_nothing(thandle_t, void*, tmsize_t) { return 0; }

toff_t seek(thandle_t handle, toff_t offset, int whence) {
  auto* source = static_cast<Source*>(handle);
  const uint64_t from = whence == SEEK_CUR ? source->at : whence == SEEK_END ? source->bytes.size() : 0;
  return source->at = from + offset;
}

int close(thandle_t) { return 0; }
toff_t size_of(thandle_t handle) { return static_cast<Source*>(handle)->bytes.size(); }

int keep_complaint(TIFF*, void* user_data, const char*, const char* format, va_list arguments) {
  auto* source = static_cast<Source*>(user_data);
  char text[200];
  std::vsnprintf(text, sizeof text, format, arguments);
  if (source->complaint.empty()) source->complaint = text;
  return 1;  // said
}

int keep_quiet(TIFF*, void*, const char*, const char*, va_list) { return 1; }

struct TiffDelete {
  void operator()(TIFF* tiff) const { TIFFClose(tiff); }
  void operator()(TIFFOpenOptions* options) const { TIFFOpenOptionsFree(options); }
};

/// An opened file of which nothing but the header has been read.
class Tiff {
public:
  Tiff(std::span<const uint8_t> file, const std::string& where) : source_{file, 0, {}}, where_(where) {
    const std::unique_ptr<TIFFOpenOptions, TiffDelete> options(TIFFOpenOptionsAlloc());
    TIFFOpenOptionsSetErrorHandlerExtR(options.get(), keep_complaint, &source_);
    TIFFOpenOptionsSetWarningHandlerExtR(options.get(), keep_quiet, nullptr);
    // Lists of strips and compressed strips lie in the file; nothing that libtiff makes for itself is much larger.
    TIFFOpenOptionsSetMaxSingleMemAlloc(options.get(), tmsize_t((1 << 20) + 16 * file.size()));
    // m: no memory mapping.
    tiff_.reset(TIFFClientOpenExt(where.c_str(), "rm", &source_, read_bytes, write_nothing, seek, close, size_of,
                                  nullptr, nullptr, options.get()));
    if (!tiff_) throw unreadable("a file that libtiff opens");
    uint16_t channels = 1, bits = 1, format = SAMPLEFORMAT_UINT;
    uint32_t width = 0, height = 0;
    TIFFGetField(tiff_.get(), TIFFTAG_IMAGEWIDTH, &width);
    TIFFGetField(tiff_.get(), TIFFTAG_IMAGELENGTH, &height);
    TIFFGetFieldDefaulted(tiff_.get(), TIFFTAG_SAMPLESPERPIXEL, &channels);
    TIFFGetFieldDefaulted(tiff_.get(), TIFFTAG_BITSPERSAMPLE, &bits);
    TIFFGetFieldDefaulted(tiff_.get(), TIFFTAG_SAMPLEFORMAT, &format);
    if (width == 0 || height == 0 || width > 0x7fffffff || height > 0x7fffffff)
      throw ImageError("unreadable",
                       describe_mismatch(where_, "TIFF size", "1 x 1 to 2^31 - 1", size_text(width, height)));
    header_ = {ImageFormat::tiff, int(width), int(height), channels, bits, format == SAMPLEFORMAT_IEEEFP};
    integer_ = format == SAMPLEFORMAT_UINT;
  }

  const ImageHeader& header() const { return header_; }

  /// Throws where the image is none that `read_rows` reads.
  void check_type() const {
    uint16_t compression = COMPRESSION_NONE;
    TIFFGetFieldDefaulted(tiff_.get(), TIFFTAG_COMPRESSION, &compression);
    const bool depth = header_.channels == 1 && ((integer_ && header_.bits == 16) ||
                                                 (header_.floating && (header_.bits == 32 || header_.bits == 64)));
    if (!depth)
      throw ImageError("wrong type",
                       describe_mismatch(where_, "TIFF", "one channel of 16-bit integers, or of 32- or 64-bit floats",
                                         std::to_string(header_.channels) + " channels of " +
                                             std::to_string(header_.bits) + " bits"));
    constexpr uint16_t kRead[] = {COMPRESSION_NONE, COMPRESSION_PACKBITS, COMPRESSION_LZW, COMPRESSION_ADOBE_DEFLATE,
                                  COMPRESSION_DEFLATE};
    if (std::find(std::begin(kRead), std::end(kRead), compression) == std::end(kRead))
      throw ImageError("wrong type", describe_mismatch(where_, "TIFF compression", "none, PackBits, LZW or Deflate",
                                                       "number " + std::to_string(compression)));
    if (TIFFIsTiled(tiff_.get()) != 0)
      throw ImageError("wrong type", describe_mismatch(where_, "TIFF", "an image in strips", "one in tiles"));
    const uint64_t bytes = uint64_t(header_.width) * uint64_t(header_.height) * uint64_t(header_.bits / 8);
    if (bytes > kMostExpansion * source_.bytes.size())
      throw ImageError("truncated", describe_mismatch(where_, "TIFF", std::to_string(bytes) + " bytes of pixels",
                                                      "a file of " + std::to_string(source_.bytes.size())));
  }

  /// All rows, in the processor's byte order. `Value`: of the stored pixels.
  template <typename Value>
  Image<Value> read_rows() {
    Image<Value> image(header_.width, header_.height);
    uint32_t rows = 0;
    TIFFGetFieldDefaulted(tiff_.get(), TIFFTAG_ROWSPERSTRIP, &rows);
    const int step = int(std::min<uint32_t>(std::max<uint32_t>(rows, 1), uint32_t(header_.height)));
    uint32_t strip = 0;
    for (int v = 0; v < header_.height; v += step, ++strip) {
      const auto expected = tmsize_t(std::min(step, header_.height - v)) * header_.width * tmsize_t(sizeof(Value));
      if (TIFFReadEncodedStrip(tiff_.get(), strip, image.row(v), expected) != expected)
        throw unreadable("whole strips");
    }
    return image;
  }

private:
  ImageError unreadable(const char* expected) const {
    return ImageError("unreadable", describe_mismatch(where_, "TIFF", expected,
                                                      source_.complaint.empty() ? "none" : source_.complaint));
  }

  Source source_;
  const std::string& where_;
  std::unique_ptr<TIFF, TiffDelete> tiff_;
  ImageHeader header_;
  bool integer_ = false;
};

}  // namespace

bool is_tiff(std::span<const uint8_t> file) {
  if (file.size() < 8) return false;
  const bool little = file[0] == 'I' && file[1] == 'I' && file[3] == 0 && (file[2] == 42 || file[2] == 43),
             big = file[0] == 'M' && file[1] == 'M' && file[2] == 0 && (file[3] == 42 || file[3] == 43);
  return little || big;
}

ImageHeader tiff_header(std::span<const uint8_t> file, const std::string& where) { return Tiff(file, where).header(); }

StoredDepth decode_tiff(std::span<const uint8_t> file, const std::string& where) {
  Tiff tiff(file, where);
  tiff.check_type();
  if (!tiff.header().floating) return tiff.read_rows<uint16_t>();
  if (tiff.header().bits == 32) return tiff.read_rows<float>();
  const Image<double> values = tiff.read_rows<double>();
  Image<float> image(values.width(), values.height());
  std::transform(values.begin(), values.end(), image.begin(), [](double value) { return float(value); });
  return image;
}

}  // namespace felt
