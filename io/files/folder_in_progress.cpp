#include "io/files/folder_in_progress.h"

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
  std::string pattern =
      (parent / fs::path(".").concat(destination_.filename().string()).concat(".partial-XXXXXX")).string();
  if (mkdtemp(pattern.data()) == nullptr)
    throw IoError(parent.string() + ": a folder cannot be made in it: " + std::strerror(errno));
  path_ = pattern;
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
  } else {
    // The old folder keeps its place until the new one is whole, and gets it back if the new one cannot take it.
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
