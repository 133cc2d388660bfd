#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string_view>

namespace felt {

/// The file that a path names in the end, through symbolic links, whether it exists or not. A link that leads nowhere
/// (a ring) is returned itself.
std::filesystem::path linked_file(std::filesystem::path path);

/// Throws IoError where a file cannot be put: the path ends in no name, names a folder or a device, or links in a ring.
void require_file_place(const std::filesystem::path& destination);

/// A file that appears whole or not at all. It is written beside its destination under a name that ends in the same
/// extension; `commit` flushes it to the disk and renames it over the destination, and destruction without `commit`
/// removes it, so that an older file stays intact until the new one is whole.
///
/// Write with `write`, or hand `path()` to a library that opens files itself (both at once would overwrite each other).
/// Every member throws IoError with the destination, the step that failed and the system's reason ("No space left on
/// device").
class AtomicFile {
public:
  /// Creates the temporary file. The folder must exist, and the destination is one of `require_file_place`; through a
  /// symbolic link the file it names is replaced.
  explicit AtomicFile(const std::filesystem::path& destination);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  /// The temporary file.
  const std::filesystem::path& path() const { return temporary_; }
  /// Appends bytes, unbuffered: pass large pieces.
  void write(const void* data, size_t bytes);
  void write(std::string_view text) { write(text.data(), text.size()); }
  /// fsync, rename, fsync of the folder. At most once.
  void commit();

private:
  [[noreturn]] void fail(const char* step, int error) const;

  std::filesystem::path shown_, destination_, temporary_;
  int descriptor_ = -1;
};

/// Removes what writers that were killed left beside `destination`: temporary files that nobody has open any more. A
/// file that is being written, by whatever process, stays (writers hold a lock on theirs).
void remove_abandoned_parts(const std::filesystem::path& destination);

/// Replaces the content of `destination` by `bytes` in one step.
void write_file_atomically(const std::filesystem::path& destination, std::string_view bytes);
void write_file_atomically(const std::filesystem::path& destination, std::span<const uint8_t> bytes);

}  // namespace felt
