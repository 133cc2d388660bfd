#include "io/images/npy_decode.h"

#include <bit>
#include <cstring>
#include <string_view>
#include <vector>

#include "io/files/text_input.h"

namespace felt {
namespace {

static_assert(std::endian::native == std::endian::little);

constexpr std::string_view kSignature = "\x93NUMPY";

ImageError unreadable(const std::string& where, const std::string& expected, const std::string& found) {
  return ImageError("unreadable", describe_mismatch(where, "NPY header", expected, found));
}

/// What the header says; `data` begins where the values do.
struct Npy {
  char order = '|', kind = 0;  ///< '<', '>' or '|'; 'f', 'u' or 'i'
  int bytes = 0;               ///< of a value
  bool fortran_order = false;
  std::vector<int64_t> shape;
  size_t data = 0;
};

/// Reads the header's text: a dictionary as Python writes it, of a text, a truth value and a list of whole numbers.
class HeaderText {
public:
  HeaderText(std::string_view text, const std::string& where) : rest_(text), where_(where) {}

  Npy read() {
    Npy npy;
    bool descr = false, order = false, shape = false;
    expect('{');
    while (!accept('}')) {
      const std::string_view key = quoted();
      expect(':');
      if (key == "descr")
        read_type(quoted(), npy), descr = true;
      else if (key == "fortran_order")
        npy.fortran_order = truth(), order = true;
      else if (key == "shape")
        npy.shape = numbers(), shape = true;
      else
        throw unreadable(where_, "descr, fortran_order and shape", "'" + std::string(key.substr(0, 40)) + "'");
      if (!accept(',') && !peek('}')) throw unreadable(where_, "',' or '}' after a value", "another character");
    }
    if (!descr || !order || !shape) throw unreadable(where_, "descr, fortran_order and shape", "fewer");
    return npy;
  }

private:
  void skip_blanks() {
    const size_t first = rest_.find_first_not_of(" \t\n\r");
    rest_.remove_prefix(first == std::string_view::npos ? rest_.size() : first);
  }
  bool peek(char c) {
    skip_blanks();
    return !rest_.empty() && rest_.front() == c;
  }
  bool accept(char c) {
    if (!peek(c)) return false;
    rest_.remove_prefix(1);
    return true;
  }
  void expect(char c) {
    if (!accept(c)) throw unreadable(where_, std::string("'") + c + "'", "another character");
  }
  std::string_view quoted() {
    skip_blanks();
    const char quote = rest_.empty() ? '\0' : rest_.front();
    const size_t end = quote == '\'' || quote == '"' ? rest_.find(quote, 1) : std::string_view::npos;
    if (end == std::string_view::npos) throw unreadable(where_, "a text in quotes", "something else");
    const std::string_view text = rest_.substr(1, end - 1);
    rest_.remove_prefix(end + 1);
    return text;
  }
  std::string_view word() {
    skip_blanks();
    const std::string_view word = rest_.substr(0, std::min(rest_.find_first_of(" \t\n\r,:)}"), rest_.size()));
    rest_.remove_prefix(word.size());
    return word;
  }
  bool truth() {
    const std::string_view said = word();
    if (said != "True" && said != "False") throw unreadable(where_, "True or False", "something else");
    return said == "True";
  }
  std::vector<int64_t> numbers() {
    std::vector<int64_t> list;
    expect('(');
    while (!accept(')')) {
      const auto number = parse_integer(word());
      if (!number || *number < 0 || list.size() == 8) throw unreadable(where_, "a shape", "something else");
      list.push_back(*number);
      if (!accept(',') && !peek(')')) throw unreadable(where_, "',' or ')' after a number", "another character");
    }
    return list;
  }
  void read_type(std::string_view descr, Npy& npy) {
    const auto bytes = descr.size() == 3 ? parse_integer(descr.substr(2)) : std::nullopt;
    const std::string_view orders = "<>|", kinds = "fui";
    if (bytes && orders.find(descr[0]) != std::string_view::npos && kinds.find(descr[1]) != std::string_view::npos)
      npy.order = descr[0], npy.kind = descr[1], npy.bytes = int(*bytes);
    const bool known = npy.kind == 'f' ? npy.bytes == 4 || npy.bytes == 8
                                       : npy.bytes == 1 || npy.bytes == 2 || npy.bytes == 4 || npy.bytes == 8;
    if (npy.kind == 0 || !known)
      throw ImageError("wrong type", describe_mismatch(where_, "type of the array", "float32, float64 or integers",
                                                       "'" + std::string(descr.substr(0, 40)) + "'"));
  }

  std::string_view rest_;
  const std::string& where_;
};

Npy read_npy(std::span<const uint8_t> file, const std::string& where) {
  const auto cut = [&] {
    return ImageError("truncated", describe_mismatch(where, "NPY", "a whole header",
                                                     "the end after " + std::to_string(file.size()) + " bytes"));
  };
  if (file.size() < 12) throw cut();
  const int version = file[6];
  if (version < 1 || version > 3) throw unreadable(where, "version 1, 2 or 3", std::to_string(version));
  const size_t begin = version == 1 ? 10 : 12;
  size_t length = size_t(file[8]) | size_t(file[9]) << 8;
  if (version > 1) length |= size_t(file[10]) << 16 | size_t(file[11]) << 24;
  if (length > file.size() - begin) throw cut();
  Npy npy = HeaderText({reinterpret_cast<const char*>(file.data()) + begin, length}, where).read();
  npy.data = begin + length;
  if (npy.shape.size() == 3 && npy.shape.front() == 1)
    npy.shape.erase(npy.shape.begin());
  else if (npy.shape.size() == 3 && npy.shape.back() == 1)
    npy.shape.pop_back();
  if (npy.shape.size() != 2)
    throw ImageError("wrong type", describe_mismatch(where, "shape of the array", "(height, width)",
                                                     std::to_string(npy.shape.size()) + " dimensions"));
  for (const int64_t side : npy.shape)
    if (side < 1 || side > 0x7fffffff) throw unreadable(where, "sides of 1 to 2^31 - 1", std::to_string(side));
  return npy;
}

template <typename Value>
Value value_at(const uint8_t* from, bool swap) {
  uint8_t bytes[sizeof(Value)];
  for (size_t i = 0; i < sizeof(Value); ++i) bytes[i] = from[swap ? sizeof(Value) - 1 - i : i];
  Value value;
  std::memcpy(&value, bytes, sizeof value);
  return value;
}

template <typename Value, typename Pixel>
StoredDepth values_of(const Npy& npy, const uint8_t* data) {
  const int width = int(npy.shape[1]), height = int(npy.shape[0]);
  Image<Pixel> image(width, height);
  const bool swap = npy.order == '>';
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u) {
      const size_t at = npy.fortran_order ? size_t(u) * height + v : size_t(v) * width + u;
      const Value value = value_at<Value>(data + at * sizeof(Value), swap);
      if constexpr (std::is_integral_v<Pixel>)
        image(u, v) = value > 0 && uint64_t(value) <= 0xffff ? Pixel(value) : Pixel(0);
      else
        image(u, v) = Pixel(value);
    }
  return image;
}

}  // namespace

bool is_npy(std::span<const uint8_t> file) {
  return file.size() >= kSignature.size() && std::memcmp(file.data(), kSignature.data(), kSignature.size()) == 0;
}

ImageHeader npy_header(std::span<const uint8_t> file, const std::string& where) {
  const Npy npy = read_npy(file, where);
  return {ImageFormat::npy, int(npy.shape[1]), int(npy.shape[0]), 1, 8 * npy.bytes, npy.kind == 'f'};
}

StoredDepth decode_npy(std::span<const uint8_t> file, const std::string& where) {
  const Npy npy = read_npy(file, where);
  // Sides are below 2^31 and their product is bounded by read_image_header, but this function stands alone.
  const uint64_t pixels = uint64_t(npy.shape[0]) * uint64_t(npy.shape[1]);
  if (pixels > (file.size() - npy.data) / uint64_t(npy.bytes))
    throw ImageError(
        "truncated",
        describe_mismatch(where, "NPY", std::to_string(pixels) + " values of " + std::to_string(npy.bytes) + " bytes",
                          std::to_string(file.size() - npy.data) + " bytes"));
  const uint8_t* const data = file.data() + npy.data;
  if (npy.kind == 'f') return npy.bytes == 4 ? values_of<float, float>(npy, data) : values_of<double, float>(npy, data);
  const bool is_signed = npy.kind == 'i';
  switch (npy.bytes) {
    case 1:
      return is_signed ? values_of<int8_t, uint16_t>(npy, data) : values_of<uint8_t, uint16_t>(npy, data);
    case 2:
      return is_signed ? values_of<int16_t, uint16_t>(npy, data) : values_of<uint16_t, uint16_t>(npy, data);
    case 4:
      return is_signed ? values_of<int32_t, uint16_t>(npy, data) : values_of<uint32_t, uint16_t>(npy, data);
    default:
      return is_signed ? values_of<int64_t, uint16_t>(npy, data) : values_of<uint64_t, uint16_t>(npy, data);
  }
}

}  // namespace felt
