#include "tests/support/waiting.h"

#include <chrono>
#include <system_error>
#include <thread>

#include "tests/support/data.h"

namespace felt::test {
namespace fs = std::filesystem;

namespace {

/// Processes that end meanwhile, or that belong to others, count as having nothing open.
bool feltmap_has_open(const fs::path& path) {
  const fs::path program = fs::canonical(command());
  std::error_code gone;
  for (const auto& process : fs::directory_iterator("/proc", gone)) {
    if (fs::read_symlink(process.path() / "exe", gone) != program) continue;
    for (fs::directory_iterator file(process.path() / "fd", gone), end; !gone && file != end; file.increment(gone))
      if (fs::read_symlink(file->path(), gone) == path) return true;
  }
  return false;
}

}  // namespace

bool wait_until_feltmap_has_open(const fs::path& path) {
  using Clock = std::chrono::steady_clock;
  const fs::path canonical = fs::canonical(path);
  for (const auto end = Clock::now() + std::chrono::seconds(30); Clock::now() < end;) {
    if (feltmap_has_open(canonical)) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return false;
}

}  // namespace felt::test
