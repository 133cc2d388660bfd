#pragma once

#include <filesystem>
#include <map>
#include <string>

namespace felt::test {

/// The content of every file below a folder, by its path from there.
std::map<std::string, std::string> files_of(const std::filesystem::path& folder);

}  // namespace felt::test
