#pragma once

#include <filesystem>

namespace felt::test {

/// Waits until a run of the feltmap command has the file or folder open, as one has that waits for its lock. False
/// where none had for half a minute.
bool wait_until_feltmap_has_open(const std::filesystem::path& path);

}  // namespace felt::test
