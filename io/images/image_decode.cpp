#include "io/images/image_decode.h"

#include <spng.h>
#include <turbojpeg.h>

#include <algorithm>
#include <cstring>
#include <memory>

#include "core/text.h"
#include "io/images/exr_decode.h"
#include "io/images/npy_decode.h"
#include "io/images/png_decode.h"
#include "io/images/tiff_decode.h"

namespace felt {
namespace {

constexpr uint8_t kPngSignature[8] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};

bool is_png(std::span<const uint8_t> file) {
  return file.size() >= 8 && std::memcmp(file.data(), kPngSignature, 8) == 0;
}
bool is_jpeg(std::span<const uint8_t> file) { return file.size() >= 2 && file[0] == 0xff && file[1] == 0xd8; }

ImageError truncated(const std::string& where, std::span<const uint8_t> file) {
  return ImageError("truncated",
                    describe_mismatch(where, "image", "a whole image",
                                      "data that ends early, after " + std::to_string(file.size()) + " bytes"));
}

ImageError wrong_type(const std::string& where, const std::string& expected, const ImageHeader& header) {
  return ImageError("wrong type", describe_mismatch(where, "image type", expected,
                                                    std::to_string(header.channels) + " channels of " +
                                                        std::to_string(header.bits) + " bits"));
}

ImageHeader png_header(std::span<const uint8_t> file, const std::string& where) {
  // Signature, then the IHDR chunk: length, name, width, height, bit depth, colour type.
  if (file.size() < 33) throw truncated(where, file);
  if (std::memcmp(file.data() + 12, "IHDR", 4) != 0)
    throw ImageError("unreadable", describe_mismatch(where, "PNG", "IHDR as first chunk", "another one"));
  const uint32_t width = big_endian_32(&file[16]), height = big_endian_32(&file[20]);
  const int bits = file[24], color_type = file[25];
  constexpr int kChannels[7] = {1, 0, 3, 1, 2, 0, 4};
  // Bit i of an entry: the colour type allows depths of 2^i bits.
  constexpr int kDepths[7] = {0b11111, 0, 0b11000, 0b01111, 0b11000, 0, 0b11000};
  const auto has_depth = [&] {
    for (int i = 0; i < 5; ++i)
      if (bits == 1 << i && (kDepths[color_type] >> i & 1) != 0) return true;
    return false;
  };
  if (width == 0 || height == 0 || width > 0x7fffffff || height > 0x7fffffff || color_type > 6 || !has_depth())
    throw ImageError("unreadable", describe_mismatch(where, "PNG header", "a valid size, depth and colour type",
                                                     size_text(width, height) + ", " + std::to_string(bits) +
                                                         " bits, colour type " + std::to_string(color_type)));
  return {ImageFormat::png, int(width), int(height), kChannels[color_type], bits};
}

ImageHeader jpeg_header(std::span<const uint8_t> file, const std::string& where) {
  // Markers with a length each, up to a start of frame: precision, height, width, components.
  for (size_t at = 2; at + 4 <= file.size();) {
    if (file[at] != 0xff) throw ImageError("unreadable", describe_mismatch(where, "JPEG", "a marker", "other bytes"));
    const int marker = file[at + 1];
    if (marker == 0xff) {  // fill byte
      ++at;
      continue;
    }
    const size_t length = size_t(file[at + 2]) << 8 | file[at + 3];
    const bool start_of_frame = marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
    if (start_of_frame) {
      if (at + 10 > file.size()) break;
      const int height = file[at + 5] << 8 | file[at + 6], width = file[at + 7] << 8 | file[at + 8];
      if (width == 0 || height == 0)
        throw ImageError("unreadable",
                         describe_mismatch(where, "JPEG size", "at least 1 x 1", size_text(width, height)));
      return {ImageFormat::jpeg, width, height, file[at + 9], file[at + 4]};
    }
    if (marker == 0xd9 || marker == 0xda || length < 2)
      throw ImageError("unreadable", describe_mismatch(where, "JPEG", "a frame header before the image data", "none"));
    at += 2 + length;
  }
  throw truncated(where, file);
}

/// Checks the claim of a header against what `file` could hold at best before anything of that size is allocated.
void check_size_is_plausible(const ImageHeader& header, std::span<const uint8_t> file, const std::string& where) {
  // Deflate expands at most 1032 times; a JPEG spends at least a bit on every 8 x 8 block of one component.
  const int64_t pixels = int64_t(header.width) * header.height;
  const int64_t bound = header.format == ImageFormat::png
                            ? 1032 * int64_t(file.size()) * 8 / std::max(1, header.channels * header.bits)
                            : 1024 * int64_t(file.size());
  if (pixels > bound) throw truncated(where, file);
}

struct SpngDelete {
  void operator()(spng_ctx* context) const { spng_ctx_free(context); }
};

/// Decodes with libspng, which knows every kind of PNG.
std::vector<uint8_t> spng_decode(std::span<const uint8_t> file, int format, const std::string& where) {
  const std::unique_ptr<spng_ctx, SpngDelete> context(spng_ctx_new(0));
  spng_set_image_limits(context.get(), 1u << 26, 1u << 26);
  spng_set_crc_action(context.get(), SPNG_CRC_USE, SPNG_CRC_USE);
  spng_set_chunk_limits(context.get(), 1 << 20, 1 << 24);
  spng_set_png_buffer(context.get(), file.data(), file.size());
  size_t size = 0;
  int fault = spng_decoded_image_size(context.get(), format, &size);
  if (fault != 0) throw ImageError("unreadable", where + ": PNG: " + spng_strerror(fault));
  std::vector<uint8_t> pixels(size);
  fault = spng_decode_image(context.get(), pixels.data(), pixels.size(), format, 0);
  if (fault == SPNG_EOF || fault == SPNG_IO_EOF || fault == SPNG_EIDAT_TOO_SHORT) throw truncated(where, file);
  if (fault != 0) throw ImageError("unreadable", where + ": PNG: " + spng_strerror(fault));
  return pixels;
}

struct TurboDelete {
  void operator()(void* handle) const { tjDestroy(handle); }
};

ColorImage jpeg_decode(std::span<const uint8_t> file, const ImageHeader& header, const std::string& where) {
  thread_local const std::unique_ptr<void, TurboDelete> handle(tjInitDecompress());
  ColorImage image(header.width, header.height);
  if (tjDecompress2(handle.get(), file.data(), file.size(), reinterpret_cast<uint8_t*>(image.data()), header.width, 0,
                    header.height, TJPF_RGBA, 0) != 0) {
    const std::string message = tjGetErrorStr2(handle.get());
    // libjpeg fills what is missing with grey and only warns; a view with a grey lower half is no view.
    if (message.find("remature end") != std::string::npos) throw truncated(where, file);
    // Bytes between two markers belong to neither; the picture is whole.
    if (tjGetErrorCode(handle.get()) == TJERR_WARNING && message.find("extraneous bytes") != std::string::npos)
      return image;
    throw ImageError("unreadable", where + ": JPEG: " + message);
  }
  return image;
}

/// Alpha says whether there is colour, 0 or 255. Some renderers leave it 0 everywhere: then it says nothing.
ColorImage with_plain_alpha(ColorImage image) {
  const bool says_nothing = std::all_of(image.begin(), image.end(), [](Rgba8 pixel) { return pixel.a == 0; });
  for (Rgba8& pixel : image) pixel.a = says_nothing || pixel.a != 0 ? 255 : 0;
  return image;
}

size_t row_bytes(const ImageHeader& header) { return (size_t(header.width) * header.channels * header.bits + 7) / 8; }

/// One to eight bits a pixel, the first one in the highest bits of a byte.
void unpack_bits(const uint8_t* stored, const ImageHeader& header, uint16_t* pixels) {
  const int per_byte = 8 / header.bits, mask = (1 << header.bits) - 1;
  for (int u = 0; u < header.width; ++u)
    pixels[u] = stored[u / per_byte] >> (8 - header.bits * (u % per_byte + 1)) & mask;
}

/// A one-channel PNG of any kind, interlaced ones too.
Image<uint16_t> gray_of_spng(std::span<const uint8_t> file, const ImageHeader& header, const std::string& where) {
  const std::vector<uint8_t> raw = spng_decode(file, SPNG_FMT_PNG, where);
  Image<uint16_t> image(header.width, header.height);
  if (header.bits == 16)
    std::memcpy(image.data(), raw.data(), image.size() * 2);
  else
    for (int v = 0; v < header.height; ++v)
      unpack_bits(raw.data() + size_t(v) * raw.size() / header.height, header, image.row(v));
  return image;
}

}  // namespace

ImageHeader read_image_header(std::span<const uint8_t> file, const std::string& where) {
  ImageHeader header;
  if (is_png(file))
    header = png_header(file, where);
  else if (is_jpeg(file))
    header = jpeg_header(file, where);
  else if (is_tiff(file))
    header = tiff_header(file, where);
  else if (is_exr(file))
    header = exr_header(file, where);
  else if (is_npy(file))
    header = npy_header(file, where);
  else if (file.size() < 8)
    throw truncated(where, file);
  else
    throw ImageError("unknown format",
                     describe_mismatch(where, "image", "PNG, JPEG, TIFF, EXR or NPY", "none of their signatures"));
  if (int64_t(header.width) * header.height > kMaxImagePixels)
    throw ImageError("too large",
                     describe_mismatch(where, "image size", "at most " + std::to_string(kMaxImagePixels) + " pixels",
                                       size_text(header.width, header.height)));
  return header;
}

Image<uint16_t> decode_gray16(std::span<const uint8_t> file, const std::string& where) {
  const ImageHeader header = read_image_header(file, where);
  if (header.format != ImageFormat::png || header.channels != 1)
    throw wrong_type(where, "a PNG with one channel", header);
  check_size_is_plausible(header, file, where);
  if (!has_plain_rows(file)) return gray_of_spng(file, header, where);

  thread_local std::vector<uint8_t> buffer;
  const PngRows rows = decode_png_rows(file, header.height, row_bytes(header), 1 + (header.bits == 16), buffer, where);
  Image<uint16_t> image(header.width, header.height);
  for (int v = 0; v < header.height; ++v) {
    const uint8_t* const stored = rows.data + size_t(v) * rows.stride;
    if (header.bits == 16)
      for (int u = 0; u < header.width; ++u) image.row(v)[u] = uint16_t(stored[2 * u] << 8 | stored[2 * u + 1]);
    else
      unpack_bits(stored, header, image.row(v));
  }
  return image;
}

Image<uint16_t> decode_u16_values(std::span<const uint8_t> bytes, bool compressed, int width, int height,
                                  const std::string& where) {
  Image<uint16_t> image(width, height);
  if (compressed)
    inflate_zlib(bytes, {reinterpret_cast<uint8_t*>(image.data()), image.size() * 2}, where);
  else if (bytes.size() == image.size() * 2)
    std::memcpy(image.data(), bytes.data(), bytes.size());
  else
    throw truncated(where, bytes);
  return image;
}

ColorImage decode_color(std::span<const uint8_t> file, const std::string& where) {
  const ImageHeader header = read_image_header(file, where);
  if (header.format != ImageFormat::png && header.format != ImageFormat::jpeg)
    throw wrong_type(where, "colour as PNG or JPEG", header);
  check_size_is_plausible(header, file, where);
  if (header.format == ImageFormat::jpeg) return jpeg_decode(file, header, where);
  ColorImage image(header.width, header.height);
  if (header.bits != 8 || header.channels < 3 || !has_plain_rows(file)) {
    const std::vector<uint8_t> raw = spng_decode(file, SPNG_FMT_RGBA8, where);
    std::memcpy(static_cast<void*>(image.data()), raw.data(), raw.size());
    return with_plain_alpha(std::move(image));
  }
  thread_local std::vector<uint8_t> buffer;
  const PngRows rows = decode_png_rows(file, header.height, row_bytes(header), header.channels, buffer, where);
  for (int v = 0; v < header.height; ++v) {
    const uint8_t* stored = rows.data + size_t(v) * rows.stride;
    for (int u = 0; u < header.width; ++u, stored += header.channels)
      image.row(v)[u] = {stored[0], stored[1], stored[2], header.channels == 4 ? stored[3] : uint8_t(255)};
  }
  return header.channels == 4 ? with_plain_alpha(std::move(image)) : image;
}

}  // namespace felt
