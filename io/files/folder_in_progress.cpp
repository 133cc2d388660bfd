#include "io/files/folder_in_progress.h"

#include <stdlib.h>

#include <cerrno>
#include <cstring>
#include <string>
#include <utility>

#include "core/error.h"

namespace felt {
namespace fs = std::filesystem;

FolderInProgress::FolderInProgress(fs::path destination) : destination_(std::move(destination)) {
  if (destination_.filename().empty()) destination_ = destination_.parent_path();  // "name/" is "name"
  const fs::path parent = destination_.has_parent_path() ? destination_.parent_path() : ".";
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
