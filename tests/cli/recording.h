#pragma once

#include <filesystem>
#include <string>

#include "tests/cli/command.h"
#include "tests/support/data.h"

namespace felt::test {

/// A recording of a wall with classes and a property, and where its map goes.
struct Recording {
  TemporaryDirectory folder;
  std::filesystem::path sequence = folder.path() / "recording", out = folder.path() / "result", map = out / "map.vdb";
  explicit Recording(int frames = 4);
  CommandResult reconstruct(const std::string& options = "") const;
  /// Arguments of a touch of this map, or of another one.
  std::string touch(const std::string& value = "0.4", const std::filesystem::path& of = {}) const;
};

/// Checks that a command ends with this exit code and names this reason.
void refused(const std::string& arguments, int code, const std::string& reason);

}  // namespace felt::test
