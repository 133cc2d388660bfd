#pragma once

#include <filesystem>

namespace felt {

/// Keeps other feltmap programs from a file or folder while the object lives (flock: advisory, and gone with the
/// process however it ends). Where there is nothing at the path, or the file system knows no locks, it keeps nobody.
class FileLock {
public:
  enum class Kind { exclusive, shared };

  /// Waits up to `patience_s` for whoever holds it. The lock is on what the path names when it is got, also where
  /// others replaced the file meanwhile. Throws IoError where it is still held after that.
  FileLock(const std::filesystem::path& path, Kind kind, double patience_s);
  ~FileLock();
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;

private:
  int descriptor_ = -1;
};

/// Removes a file or folder, unless some process holds its lock or that cannot be known.
void remove_unless_locked(const std::filesystem::path& path);

}  // namespace felt
