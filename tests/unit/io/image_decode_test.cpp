#include "io/images/image_decode.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <random>

#include "io/images/image_encode.h"
#include "io/images/png_decode.h"
#include "tests/support/image_fault.h"

using namespace felt;
using felt::test::reason_of;

namespace {

Image<uint16_t> random_gray(int width, int height) {
  std::mt19937 random(uint32_t(width * 31 + height));
  Image<uint16_t> image(width, height);
  for (uint16_t& value : image) value = uint16_t(random());
  return image;
}

}  // namespace

TEST_CASE("what is encoded as PNG is decoded to the same pixels, awkward sizes included") {
  for (const auto& [width, height] : {std::pair{1, 1}, {1, 7}, {7, 1}, {13, 5}, {640, 3}}) {
    const Image<uint16_t> image = random_gray(width, height);
    CHECK(decode_gray16(encode_png(image), "test") == image);
    Image<uint8_t> bytes(width, height);
    ColorImage color(width, height);
    for (size_t i = 0; i < image.size(); ++i) {
      const uint16_t value = image.data()[i];
      bytes.data()[i] = uint8_t(value);
      color.data()[i] = {uint8_t(value), uint8_t(value >> 3), uint8_t(value >> 8), 255};
    }
    const Image<uint16_t> decoded = decode_gray16(encode_png(bytes), "test");
    CHECK(std::equal(decoded.begin(), decoded.end(), bytes.begin()));
    CHECK(decode_color(encode_png(color), "test") == color);
  }
}

TEST_CASE("colour survives JPEG nearly, in its right order") {
  const ColorImage red(32, 16, {250, 20, 10, 255});
  const ColorImage decoded = decode_color(encode_jpeg(red, 95), "test");
  REQUIRE(decoded.width() == 32);
  CHECK(std::abs(decoded(9, 9).r - 250) < 6);
  CHECK(std::abs(decoded(9, 9).b - 10) < 6);
  CHECK(decoded(9, 9).a == 255);
}

TEST_CASE("every cut of an image file is refused, none crashes") {
  const std::vector<uint8_t> png = encode_png(random_gray(20, 10)),
                             jpeg = encode_jpeg(ColorImage(32, 16, {1, 2, 3, 255}));
  for (size_t size = 0; size < png.size(); ++size) {
    INFO(size);
    CHECK(reason_of([&] { decode_gray16(std::span(png).first(size), "test"); }) == "truncated");
  }
  for (size_t size = 0; size + 2 < jpeg.size(); ++size) {
    INFO(size);
    CHECK(!reason_of([&] { decode_color(std::span(jpeg).first(size), "test"); }).empty());
  }
}

TEST_CASE("any damaged byte of a PNG is noticed") {
  const std::vector<uint8_t> png = encode_png(random_gray(20, 10));
  for (size_t i = 0; i < png.size(); ++i) {
    std::vector<uint8_t> damaged = png;
    damaged[i] ^= 0x10;
    INFO(i);
    CHECK(!reason_of([&] { decode_gray16(damaged, "test"); }).empty());
  }
}

TEST_CASE("a header that claims more than the file could hold allocates nothing") {
  std::vector<uint8_t> png = encode_png(Image<uint16_t>(4, 4, 7));
  png[16 + 2] = 0x20, png[20 + 2] = 0x20;  // 8196 x 8196
  CHECK(reason_of([&] { decode_gray16(png, "test"); }) == "too large");
  png[16 + 2] = 0x1f, png[20 + 2] = 0x1f;  // 7940 x 7940 in a hundred bytes
  CHECK(reason_of([&] { decode_gray16(png, "test"); }) == "truncated");
  std::vector<uint8_t> jpeg = encode_jpeg(ColorImage(16, 16));
  const uint8_t marker[] = {0xff, 0xc0};
  const auto frame = std::search(jpeg.begin(), jpeg.end(), std::begin(marker), std::end(marker));
  REQUIRE(frame != jpeg.end());
  frame[5] = frame[7] = 0x1f;
  CHECK(reason_of([&] { decode_color(jpeg, "test"); }) == "truncated");
}

TEST_CASE("colour is no depth, and text is no image") {
  CHECK(reason_of([] { decode_gray16(encode_png(ColorImage(4, 4)), "test"); }) == "wrong type");
  CHECK(reason_of([] { decode_gray16(encode_jpeg(ColorImage(4, 4)), "test"); }) == "wrong type");
  const std::vector<uint8_t> text(100, 'a');
  CHECK(reason_of([&] { decode_color(text, "test"); }) == "unknown format");
}
