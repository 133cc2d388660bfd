#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>

namespace felt {

/// A regular file that is read with plain system calls, so that one that shrinks meanwhile is an error and not a
/// signal, as it would be with a mapping. Every member throws IoError.
class OpenedFile {
public:
  explicit OpenedFile(const std::filesystem::path& path);
  ~OpenedFile();
  OpenedFile(const OpenedFile&) = delete;
  OpenedFile& operator=(const OpenedFile&) = delete;

  uint64_t size() const { return size_; }
  void read(void* to, size_t bytes, uint64_t offset) const;

private:
  [[noreturn]] void fail(const char* step) const;

  std::filesystem::path path_;
  int descriptor_;
  uint64_t size_ = 0;
};

}  // namespace felt
