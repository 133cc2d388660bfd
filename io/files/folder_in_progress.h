#pragma once

#include <filesystem>
#include <optional>

#include "io/files/file_lock.h"

namespace felt {

/// A folder that takes its final name when it is whole, and disappears otherwise. Until then it lies beside its
/// destination under a name that nobody else has; what a process that was killed left there is removed by the next one.
class FolderInProgress {
public:
  /// Throws IoError where no folder can be made beside `destination`, such as where that place does not exist, and
  /// where the destination is a mount point.
  explicit FolderInProgress(const std::filesystem::path& destination);
  ~FolderInProgress();
  FolderInProgress(const FolderInProgress&) = delete;
  FolderInProgress& operator=(const FolderInProgress&) = delete;

  const std::filesystem::path& path() const { return path_; }
  /// What lies at the destination is replaced; whether it may be is the caller's to ask before. Throws IoError, and
  /// what lay there stays.
  void commit();

private:
  std::filesystem::path destination_, path_;
  std::optional<FileLock> lock_;  ///< says that somebody is at work there
};

}  // namespace felt
