#include "io/files/file_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <system_error>
#include <thread>

#include "core/error.h"

namespace felt {
namespace {

/// Whether the path still names the opened file.
bool is_at(int descriptor, const std::filesystem::path& path) {
  struct stat opened {
  }, named{};
  return fstat(descriptor, &opened) == 0 && stat(path.c_str(), &named) == 0 && opened.st_ino == named.st_ino &&
         opened.st_dev == named.st_dev;
}

}  // namespace

FileLock::FileLock(const std::filesystem::path& path, Kind kind, double patience_s) {
  using Clock = std::chrono::steady_clock;
  const auto end = Clock::now() + std::chrono::duration<double>(patience_s);
  const int operation = (kind == Kind::exclusive ? LOCK_EX : LOCK_SH) | LOCK_NB;
  for (;;) {
    if (descriptor_ < 0) descriptor_ = open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    if (descriptor_ < 0) return;
    const bool held = flock(descriptor_, operation) == 0;
    if (!held && errno != EWOULDBLOCK && errno != EINTR) return;
    if (held && is_at(descriptor_, path)) return;
    if (held) {  // replaced by whom we waited for: the new one, then
      close(descriptor_);
      descriptor_ = -1;
      continue;
    }
    if (Clock::now() >= end) {
      close(descriptor_);
      throw IoError(describe_mismatch(path.string(), "output", "nobody else at work on it", "another feltmap"));
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

FileLock::~FileLock() {
  if (descriptor_ >= 0) close(descriptor_);
}

void remove_unless_locked(const std::filesystem::path& path) {
  const int descriptor = open(path.c_str(), O_RDONLY | O_NONBLOCK | O_NOFOLLOW | O_CLOEXEC);
  if (descriptor < 0) return;
  std::error_code ignored;
  if (flock(descriptor, LOCK_EX | LOCK_NB) == 0) std::filesystem::remove_all(path, ignored);
  close(descriptor);
}

}  // namespace felt
