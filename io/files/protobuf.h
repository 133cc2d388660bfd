#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>

#include "core/error.h"

namespace felt {

/// One field of a protocol buffer message: a number, or a piece of bytes (text or a message within).
struct ProtobufField {
  uint32_t number = 0;
  uint64_t value = 0;  ///< of a varint, or the bits of a fixed-size number
  std::string_view bytes;

  /// The value of a `float` field.
  float as_float() const {
    const auto bits = uint32_t(value);
    float number_read = 0;
    std::memcpy(&number_read, &bits, sizeof number_read);
    return number_read;
  }
};

/// What an error says of bytes that are no message: "<file>: <what>: expected <whole>".
struct ProtobufFile {
  std::string file;
  const char *what, *whole;
};

/// Walks the fields of one message (the wire format: a key with number and type, then the content). Throws FormatError.
class ProtobufMessage {
public:
  ProtobufMessage(std::string_view bytes, const ProtobufFile& file) : rest_(bytes), file_(file) {}

  bool next(ProtobufField& field) {
    if (rest_.empty()) return false;
    const uint64_t key = varint();
    field = {uint32_t(key >> 3), 0, {}};
    switch (key & 7) {
      case 0:
        field.value = varint();
        return true;
      case 1:
        field.value = fixed(8);
        return true;
      case 2:
        field.bytes = take(varint());
        return true;
      case 5:
        field.value = fixed(4);
        return true;
      default:
        fail("a field of unknown type");
    }
  }

private:
  [[noreturn]] void fail(const char* found) const {
    throw FormatError(describe_mismatch(file_.file, file_.what, file_.whole, found));
  }
  std::string_view take(uint64_t bytes) {
    if (bytes > rest_.size()) fail("a file that ends too early or is damaged");
    const std::string_view taken = rest_.substr(0, size_t(bytes));
    rest_.remove_prefix(size_t(bytes));
    return taken;
  }
  uint64_t fixed(size_t bytes) {
    uint64_t value = 0;
    const std::string_view stored = take(bytes);
    for (size_t i = 0; i < bytes; ++i) value |= uint64_t(uint8_t(stored[i])) << (8 * i);
    return value;
  }
  uint64_t varint() {
    uint64_t value = 0;
    for (int shift = 0; shift < 64; shift += 7) {
      const auto byte = uint8_t(take(1)[0]);
      value |= uint64_t(byte & 127) << shift;
      if (byte < 128) return value;
    }
    fail("a number of too many bytes");
  }

  std::string_view rest_;
  const ProtobufFile& file_;
};

/// Calls `visit` for each field of a message with this number.
template <typename Visit>
void for_each_field(std::string_view bytes, uint32_t number, const ProtobufFile& file, const Visit& visit) {
  ProtobufMessage message(bytes, file);
  for (ProtobufField field; message.next(field);)
    if (field.number == number) visit(field);
}

}  // namespace felt
