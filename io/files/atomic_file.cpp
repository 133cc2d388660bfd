#include "io/files/atomic_file.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cctype>
#include <cerrno>
#include <cstring>
#include <string>
#include <utility>

#include "core/error.h"
#include "io/files/file_lock.h"

namespace felt {
namespace fs = std::filesystem;
namespace {

/// Temporary files of a destination begin with this, then come process and serial number and its extension.
std::string part_prefix(const fs::path& destination) { return destination.stem().string() + ".part-"; }

/// Whether a name is of that form: nothing that a person would call a file of their own.
bool is_part_of(const fs::path& name, const fs::path& destination) {
  const std::string stem = name.stem().string(), prefix = part_prefix(destination);
  if (name.extension() != destination.extension() || !stem.starts_with(prefix)) return false;
  const size_t dash = stem.find('-', prefix.size());
  const auto digits = [&](size_t from, size_t to) {
    return from < to && std::all_of(stem.begin() + ptrdiff_t(from), stem.begin() + ptrdiff_t(to),
                                    [](unsigned char c) { return std::isdigit(c) != 0; });
  };
  return dash != std::string::npos && digits(prefix.size(), dash) && digits(dash + 1, stem.size());
}

bool gone(int descriptor) {
  struct stat status {};
  return fstat(descriptor, &status) == 0 && status.st_nlink == 0;
}

}  // namespace

void AtomicFile::fail(const char* step, int error) const {
  throw IoError(shown_.string() + ": cannot " + step + ": " + std::strerror(error));
}

fs::path linked_file(fs::path path) {
  constexpr int kMostLinks = 40;
  std::error_code error;
  for (int links = 0; links < kMostLinks && fs::is_symlink(path, error); ++links) {
    const fs::path target = fs::read_symlink(path, error);
    if (error) break;
    path = target.is_absolute() ? target : path.parent_path() / target;
  }
  return path;
}

void require_file_place(const fs::path& destination) {
  const fs::path file = linked_file(destination);
  const auto refuse = [&](const char* found) {
    throw IoError(describe_mismatch(destination.string(), "output", "a regular file or a new name", found));
  };
  if (std::error_code error; fs::is_symlink(file, error)) refuse(std::strerror(ELOOP));
  struct stat existing {};
  if (stat(file.c_str(), &existing) == 0 && !S_ISREG(existing.st_mode))
    refuse(S_ISDIR(existing.st_mode) ? "a folder" : "a special file");
  if (destination.filename().empty()) refuse("the name of a folder");
}

AtomicFile::AtomicFile(const fs::path& destination) : shown_(destination), destination_(linked_file(destination)) {
  require_file_place(destination);
  struct stat existing {};
  const bool replaces = stat(destination_.c_str(), &existing) == 0;
  static std::atomic<unsigned> serial = 0;
  do {
    fs::path name = part_prefix(destination_);
    name += std::to_string(getpid());
    name += "-";
    name += std::to_string(serial++);
    name += destination_.extension();
    temporary_ = destination_.parent_path() / name;
    descriptor_ = open(temporary_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    // Whoever tidied up between these two calls took the file: another one, then.
    if (descriptor_ >= 0 && (flock(descriptor_, LOCK_EX | LOCK_NB), gone(descriptor_))) {
      close(descriptor_);
      descriptor_ = -1;
      errno = EEXIST;
    }
  } while (descriptor_ < 0 && errno == EEXIST);
  if (descriptor_ < 0) fail("create a file beside it", errno);
  // A replaced file keeps its permissions; where that is not allowed the new file has the default ones.
  if (replaces) (void)!fchmod(descriptor_, existing.st_mode & 07777);
}

AtomicFile::~AtomicFile() {
  if (descriptor_ < 0) return;
  close(descriptor_);
  unlink(temporary_.c_str());
}

void AtomicFile::write(const void* data, size_t bytes) {
  const char* from = static_cast<const char*>(data);
  while (bytes > 0) {
    const ssize_t written = ::write(descriptor_, from, bytes);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) fail("write", errno);
    from += written;
    bytes -= size_t(written);
  }
}

void AtomicFile::commit() {
  if (fsync(descriptor_) != 0) fail("flush to the disk", errno);
  if (rename(temporary_.c_str(), destination_.c_str()) != 0) fail("rename into place", errno);
  // From here on the temporary name is gone: nothing is left to remove.
  const int file = std::exchange(descriptor_, -1);
  if (close(file) != 0) fail("close", errno);
  // Not every file system lets a folder be flushed; the rename itself is done.
  const fs::path folder = destination_.has_parent_path() ? destination_.parent_path() : fs::path(".");
  if (const int directory = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC); directory >= 0) {
    (void)!fsync(directory);
    close(directory);
  }
}

void remove_abandoned_parts(const fs::path& destination) {
  const fs::path folder = destination.has_parent_path() ? destination.parent_path() : fs::path(".");
  std::error_code fault;
  for (const auto& entry : fs::directory_iterator(folder, fault))
    if (is_part_of(entry.path().filename(), destination) && entry.is_regular_file(fault))
      remove_unless_locked(entry.path());
}

void write_file_atomically(const fs::path& destination, std::string_view bytes) {
  AtomicFile file(destination);
  file.write(bytes);
  file.commit();
}

void write_file_atomically(const fs::path& destination, std::span<const uint8_t> bytes) {
  write_file_atomically(destination, std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
}

}  // namespace felt
