#include "io/images/image_encode.h"

#include <libdeflate.h>
#include <turbojpeg.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>
#include <stdexcept>

#include "core/error.h"

namespace felt {
namespace {

void append_32(std::vector<uint8_t>& bytes, uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8) bytes.push_back(uint8_t(value >> shift));
}

void append_chunk(std::vector<uint8_t>& png, const char* name, const uint8_t* data, size_t size) {
  append_32(png, uint32_t(size));
  const size_t start = png.size();
  png.insert(png.end(), name, name + 4);
  png.insert(png.end(), data, data + size);
  append_32(png, libdeflate_crc32(0, png.data() + start, png.size() - start));
}

/// `rows`: height rows of `row_bytes`, channels big-endian. Every row is stored as differences to the pixel on its left
/// (filter 1), which is cheap to undo and suits depth and labels.
std::vector<uint8_t> png_of_rows(const std::vector<uint8_t>& rows, int width, int height, int bits, int color_type,
                                 int pixel_bytes) {
  const size_t row_bytes = size_t(width) * pixel_bytes;
  std::vector<uint8_t> filtered;
  filtered.reserve((row_bytes + 1) * height);
  for (int v = 0; v < height; ++v) {
    const uint8_t* row = rows.data() + v * row_bytes;
    filtered.push_back(1);
    for (size_t i = 0; i < row_bytes; ++i)
      filtered.push_back(uint8_t(row[i] - (i < size_t(pixel_bytes) ? 0 : row[i - pixel_bytes])));
  }
  const std::unique_ptr<libdeflate_compressor, decltype(&libdeflate_free_compressor)> compressor(
      libdeflate_alloc_compressor(5), libdeflate_free_compressor);
  std::vector<uint8_t> packed(libdeflate_zlib_compress_bound(compressor.get(), filtered.size()));
  packed.resize(
      libdeflate_zlib_compress(compressor.get(), filtered.data(), filtered.size(), packed.data(), packed.size()));

  std::vector<uint8_t> header;
  append_32(header, uint32_t(width));
  append_32(header, uint32_t(height));
  header.insert(header.end(), {uint8_t(bits), uint8_t(color_type), 0, 0, 0});
  std::vector<uint8_t> png = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  append_chunk(png, "IHDR", header.data(), header.size());
  append_chunk(png, "IDAT", packed.data(), packed.size());
  append_chunk(png, "IEND", nullptr, 0);
  return png;
}

}  // namespace

std::vector<uint8_t> encode_png(const Image<uint16_t>& image) {
  std::vector<uint8_t> rows;
  rows.reserve(image.size() * 2);
  for (const uint16_t value : image) rows.insert(rows.end(), {uint8_t(value >> 8), uint8_t(value)});
  return png_of_rows(rows, image.width(), image.height(), 16, 0, 2);
}

std::vector<uint8_t> encode_png(const Image<uint8_t>& image) {
  return png_of_rows({image.begin(), image.end()}, image.width(), image.height(), 8, 0, 1);
}

std::vector<uint8_t> encode_png(const ColorImage& image) {
  const bool whole = std::all_of(image.begin(), image.end(), [](Rgba8 c) { return c.a != 0; });
  std::vector<uint8_t> rows;
  rows.reserve(image.size() * 4);
  for (const Rgba8& c : image) {
    rows.insert(rows.end(), {c.r, c.g, c.b});
    if (!whole) rows.push_back(c.a);
  }
  return png_of_rows(rows, image.width(), image.height(), 8, whole ? 2 : 6, whole ? 3 : 4);
}

std::vector<uint8_t> encode_jpeg(const ColorImage& image, int quality) {
  const std::unique_ptr<void, int (*)(void*)> handle(tjInitCompress(), tjDestroy);
  unsigned char* data = nullptr;
  unsigned long size = 0;
  const int fault = tjCompress2(handle.get(), reinterpret_cast<const uint8_t*>(image.data()), image.width(), 0,
                                image.height(), TJPF_RGBA, &data, &size, TJSAMP_420, quality, 0);
  const std::unique_ptr<unsigned char, void (*)(unsigned char*)> owner(data, tjFree);
  if (fault != 0) throw std::runtime_error(std::string("JPEG encoder: ") + tjGetErrorStr2(handle.get()));
  return {data, data + size};
}

void write_bytes(const std::filesystem::path& path, const std::vector<uint8_t>& bytes) {
  std::FILE* file = std::fopen(path.c_str(), "wb");
  if (file == nullptr) throw IoError(path.string() + ": cannot be opened for writing: " + std::strerror(errno));
  const bool whole = std::fwrite(bytes.data(), 1, bytes.size(), file) == bytes.size();
  const bool closed = std::fclose(file) == 0;
  if (!whole || !closed) throw IoError(path.string() + ": writing failed: " + std::strerror(errno));
}

}  // namespace felt
