#pragma once

#include <filesystem>
#include <string>

namespace felt::test {

/// In single quotes, for the shell.
std::string quoted(const std::filesystem::path& path);

/// Twelve small views of boxes on a floor, made once a process.
const std::filesystem::path& boxes();

/// A recording of `simulate` many times over in `folder`, its images as links, without instances. Returns `folder`.
std::filesystem::path repeated(const std::filesystem::path& recording, const std::filesystem::path& folder, int rounds);

/// `boxes` many times over in `folder`: 12 * rounds frames. Returns `folder`.
std::filesystem::path boxes_repeated(const std::filesystem::path& folder, int rounds);

}  // namespace felt::test
