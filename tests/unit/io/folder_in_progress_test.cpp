#include "io/files/folder_in_progress.h"

#include <sys/syscall.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <cerrno>
#include <cstdio>
#include <set>
#include <string>

#include "core/error.h"
#include "tests/support/data.h"
#include "tests/support/recorded_sequence.h"

using namespace felt;
using namespace felt::test;
namespace fs = std::filesystem;

namespace {

std::set<std::string> names_in(const fs::path& folder) {
  std::set<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) names.insert(entry.path().filename().string());
  return names;
}

bool can_exchange = true;  // what this process makes of file systems
int exchanges = 0;

}  // namespace

/// In place of the C library's, to see what is asked for, and to be a file system that cannot exchange folders.
extern "C" int renameat2(int from_folder, const char* from, int to_folder, const char* to,
                         unsigned int flags) noexcept {
  if ((flags & RENAME_EXCHANGE) != 0 && !can_exchange) {
    errno = EINVAL;
    return -1;
  }
  exchanges += (flags & RENAME_EXCHANGE) != 0;
  return int(syscall(SYS_renameat2, from_folder, from, to_folder, to, flags));
}

TEST_CASE("a folder takes the place of another one whole, and nothing of either stays beside it") {
  for (const bool in_one_step : {true, false}) {
    INFO((in_one_step ? "exchanged" : "a file system that cannot exchange"));
    const TemporaryDirectory around;
    write_text(around.path() / "out" / "old.txt", "old");
    can_exchange = in_one_step;
    exchanges = 0;
    {
      FolderInProgress folder(around.path() / "out");
      write_text(folder.path() / "new.txt", "new");
      CHECK(names_in(around.path() / "out") == std::set<std::string>{"old.txt"});
      folder.commit();
    }
    can_exchange = true;
    CHECK(exchanges == int(in_one_step));
    CHECK(names_in(around.path()) == std::set<std::string>{"out"});
    CHECK(names_in(around.path() / "out") == std::set<std::string>{"new.txt"});
  }
}

TEST_CASE("a folder that cannot take its place leaves the older one there") {
  const TemporaryDirectory around;
  write_text(around.path() / "out" / "old.txt", "old");
  FolderInProgress folder(around.path() / "out");
  fs::remove_all(folder.path());
  CHECK_THROWS_AS(folder.commit(), IoError);
  CHECK(names_in(around.path() / "out") == std::set<std::string>{"old.txt"});
}

TEST_CASE("a folder that a killed process left is removed, one that is in use and any other stay") {
  const TemporaryDirectory around;
  for (const char* name : {".out.partial-Ab3xYz", ".out.partial-Ab3xYz7", ".out.partial-mine",
                           ".out.partial-Qr5tUv.old", ".other.partial-Ab3xYz", "out.partial-Ab3xYz"})
    write_text(around.path() / name / "image.png", "half");
  const FolderInProgress at_work(around.path() / "out");
  std::set<std::string> left = names_in(around.path());
  CHECK(left.size() == 6);
  CHECK_FALSE(left.contains(".out.partial-Ab3xYz"));
  { const FolderInProgress another(around.path() / "out"); }
  CHECK(names_in(around.path()) == left);
  CHECK(fs::exists(at_work.path()));
}
