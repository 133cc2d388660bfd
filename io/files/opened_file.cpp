#include "io/files/opened_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "core/error.h"

namespace felt {

OpenedFile::OpenedFile(const std::filesystem::path& path)
    : path_(path), descriptor_(open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC)) {
  if (descriptor_ < 0) fail("open");
  struct stat status {};
  if (fstat(descriptor_, &status) != 0) fail("read the size");
  if (!S_ISREG(status.st_mode)) {
    close(descriptor_);
    throw IoError(describe_mismatch(path.string(), "input", "a regular file",
                                    S_ISDIR(status.st_mode) ? "a folder" : "a special file"));
  }
  size_ = uint64_t(status.st_size);
}

OpenedFile::~OpenedFile() { close(descriptor_); }

void OpenedFile::read(void* to, size_t bytes, uint64_t offset) const {
  auto* out = static_cast<char*>(to);
  while (bytes > 0) {
    const ssize_t n = pread(descriptor_, out, bytes, off_t(offset));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) fail("read");
    if (n == 0) throw IoError(path_.string() + ": cannot read: the file became shorter meanwhile");
    out += n;
    offset += uint64_t(n);
    bytes -= size_t(n);
  }
}

void OpenedFile::fail(const char* step) const {
  throw IoError(path_.string() + ": cannot " + step + ": " + std::strerror(errno));
}

}  // namespace felt
