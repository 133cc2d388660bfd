#include "io/files/system_memory.h"

#include <malloc.h>
#include <sys/resource.h>

#include <algorithm>
#include <fstream>
#include <limits>
#include <optional>
#include <string>

namespace felt {
namespace {

constexpr size_t kUnlimited = std::numeric_limits<size_t>::max();

/// Value of a line "<key> <number> kB" of a /proc file, in bytes.
std::optional<size_t> kilobytes_of_key(const char* path, const std::string& key) {
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    if (line.compare(0, key.size(), key) != 0) continue;
    return size_t(std::strtoull(line.c_str() + key.size(), nullptr, 10)) * 1024;
  }
  return std::nullopt;
}

/// The number in a control-group file; none where it is absent or says "max".
std::optional<size_t> number_in(const char* path) {
  std::ifstream file(path);
  size_t value = 0;
  if (file >> value) return value;
  return std::nullopt;
}

size_t left(size_t limit, size_t used) { return limit > used ? limit - used : 0; }

}  // namespace

size_t available_memory_bytes() {
  size_t available = kilobytes_of_key("/proc/meminfo", "MemAvailable:").value_or(kUnlimited);
  // Inside a container its own group is the root of what it sees. Version 2 of control groups, then version 1.
  if (const auto limit = number_in("/sys/fs/cgroup/memory.max"))
    available = std::min(available, left(*limit, number_in("/sys/fs/cgroup/memory.current").value_or(0)));
  if (const auto limit = number_in("/sys/fs/cgroup/memory/memory.limit_in_bytes"))
    available = std::min(available, left(*limit, number_in("/sys/fs/cgroup/memory/memory.usage_in_bytes").value_or(0)));
  rlimit limit{};
  if (getrlimit(RLIMIT_AS, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY)
    available = std::min(available, left(limit.rlim_cur, kilobytes_of_key("/proc/self/status", "VmSize:").value_or(0)));
  return available;
}

size_t peak_resident_bytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return size_t(usage.ru_maxrss) * 1024;
}

void keep_freed_memory() {
#ifdef __GLIBC__
  mallopt(M_MMAP_THRESHOLD, 32 << 20);  // its greatest value; larger blocks go back as they are freed
  mallopt(M_TRIM_THRESHOLD, 256 << 20);
#endif
}

}  // namespace felt
