#include "io/files/folder_in_progress.h"

#include <catch2/catch.hpp>
#include <set>
#include <string>

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

}  // namespace

TEST_CASE("a folder takes the place of another one whole, and nothing of either stays beside it") {
  const TemporaryDirectory around;
  write_text(around.path() / "out" / "old.txt", "old");
  {
    FolderInProgress folder(around.path() / "out");
    write_text(folder.path() / "new.txt", "new");
    CHECK(names_in(around.path() / "out") == std::set<std::string>{"old.txt"});
    folder.commit();
  }
  CHECK(names_in(around.path()) == std::set<std::string>{"out"});
  CHECK(names_in(around.path() / "out") == std::set<std::string>{"new.txt"});
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
