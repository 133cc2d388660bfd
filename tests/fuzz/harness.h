#pragma once

#include <cstddef>
#include <span>
#include <string>

namespace felt::fuzz {

/// One reader of the project under arbitrary bytes. `read` returns where the bytes are accepted and throws felt::Error
/// where they are refused; everything else that it may do (another exception, a crash, a hang, much memory) is a
/// finding.
struct Harness {
  const char* name;  ///< also its folder of seeds, tests/fuzz/corpus/<name>
  void (*read)(const std::string& bytes);
  /// Most memory that reading may take: so much whatever the input, and so much for each byte of it.
  size_t free_bytes, bytes_per_byte;
};

/// Every harness, in ascending order of names.
std::span<const Harness> harnesses();

/// True where the bytes are accepted, false where they are refused with an Error. A finding leaves as it came.
bool accepted(const Harness& harness, const std::string& bytes);

}  // namespace felt::fuzz
