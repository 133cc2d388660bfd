#include "io/files/folder_in_progress.h"

#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>

#include <cerrno>
#include <cstring>
#include <optional>
#include <string>

#include "core/error.h"

namespace felt {
namespace fs = std::filesystem;

namespace {

std::optional<dev_t> device_of(const fs::path& path) {
  struct stat status {};
  if (stat(path.c_str(), &status) != 0) return std::nullopt;
  return status.st_dev;
}

constexpr const char* kAnyName = "XXXXXX";  // mkdtemp puts as many other characters there

/// Folders in progress of a destination begin with this, then come six characters that nobody else has.
std::string partial_prefix(const fs::path& destination) { return "." + destination.filename().string() + ".partial-"; }

/// Removes what processes that were killed left beside `destination`: who is still at work in a folder holds its lock.
void remove_abandoned_folders(const fs::path& destination) {
  const std::string prefix = partial_prefix(destination);
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(destination.parent_path(), ignored)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with(prefix) && name.size() == prefix.size() + std::strlen(kAnyName))
      remove_unless_locked(entry.path());
  }
}

/// Two folders change places in one step. False where that cannot be done, and nothing changed.
bool exchange(const fs::path& a, const fs::path& b) {
  return renameat2(AT_FDCWD, a.c_str(), AT_FDCWD, b.c_str(), RENAME_EXCHANGE) == 0;
}

}  // namespace

FolderInProgress::FolderInProgress(const fs::path& destination)
    : destination_(fs::absolute(destination).lexically_normal()) {
  // "name/" is "name", and "." has a name, too.
  if (destination_.filename().empty()) destination_ = destination_.parent_path();
  const fs::path parent = destination_.parent_path();
  // Such a folder cannot be replaced by another one; better said before the work than after.
  if (const auto here = device_of(destination_), around = device_of(parent); here && around && *here != *around)
    throw IoError(describe_mismatch(destination.string(), "output folder", "one that can be made or replaced",
                                    "a mount point (a folder within it will do)"));
  remove_abandoned_folders(destination_);
  do {
    std::string pattern = (parent / (partial_prefix(destination_) + kAnyName)).string();
    if (mkdtemp(pattern.data()) == nullptr)
      throw IoError(parent.string() + ": a folder cannot be made in it: " + std::strerror(errno));
    path_ = pattern;
    constexpr double kPatience_s = 60;
    lock_.emplace(path_, FileLock::Kind::exclusive, kPatience_s);
    // Whoever tidied up before it was locked took the folder: another one, then.
  } while (!fs::exists(path_));
  std::error_code ignored;
  fs::permissions(path_, fs::perms(0755), ignored);
}

FolderInProgress::~FolderInProgress() {
  std::error_code ignored;
  if (!path_.empty()) fs::remove_all(path_, ignored);
}

void FolderInProgress::commit() {
  std::error_code fault, ignored;
  if (!fs::exists(destination_, ignored)) {
    fs::rename(path_, destination_, fault);
  } else if (exchange(path_, destination_)) {
    fs::remove_all(path_, ignored);
  } else {
    // A file system that cannot exchange: the old folder gets its place back if the new one cannot take it.
    const fs::path old = fs::path(path_).concat(".old");
    fs::rename(destination_, old, fault);
    if (!fault) {
      fs::rename(path_, destination_, fault);
      if (fault)
        fs::rename(old, destination_, ignored);
      else
        fs::remove_all(old, ignored);
    }
  }
  if (fault) throw IoError(destination_.string() + ": cannot be made: " + fault.message());
  path_.clear();
}

}  // namespace felt
