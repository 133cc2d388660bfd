#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "tests/support/skip.h"

namespace felt::test {

/// Folder of one recorded sequence below `FELTMAP_DATA` (environment, else the configured default), or nothing where it
/// is absent: use `FELTMAP_REQUIRE_DATA` so that ctest reports the test as skipped.
std::optional<std::filesystem::path> recorded(const std::string& name);

/// Root of the project's sources, and the built `feltmap` command.
std::filesystem::path source_dir();
std::filesystem::path command();

/// An empty directory of this test's own, removed when the object goes.
class TemporaryDirectory {
public:
  TemporaryDirectory();
  ~TemporaryDirectory();
  TemporaryDirectory(const TemporaryDirectory&) = delete;
  TemporaryDirectory& operator=(const TemporaryDirectory&) = delete;
  const std::filesystem::path& path() const { return path_; }

private:
  std::filesystem::path path_;
};

}  // namespace felt::test

/// Declares `variable` as the folder of a recorded sequence, or leaves the test as skipped.
#define FELTMAP_REQUIRE_DATA(variable, name)                                                            \
  const auto variable##_found = felt::test::recorded(name);                                             \
  if (!variable##_found) {                                                                              \
    felt::test::skip(std::string("no recorded data '") + (name) + "'; set FELTMAP_DATA to its folder"); \
    return;                                                                                             \
  }                                                                                                     \
  const std::filesystem::path& variable = *variable##_found
