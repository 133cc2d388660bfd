#pragma once

#include <filesystem>
#include <string>

namespace felt::test {

/// In single quotes, for the shell.
std::string quoted(const std::filesystem::path& path);

/// Twelve small views of boxes on a floor, made once a process.
const std::filesystem::path& boxes();

/// `boxes` many times over in `folder`, as links: 12 * rounds frames. Returns `folder`.
std::filesystem::path boxes_repeated(const std::filesystem::path& folder, int rounds);

}  // namespace felt::test
