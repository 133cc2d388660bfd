#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace felt::apps {

/// Makes `folder` ready before any work is done, so that nothing is lost to a full or read-only disk at the end:
/// creates it, checks that it can be written, and that none of the files `names` exists unless `overwrite`. Throws
/// IoError that names every file in the way. Half-written files of runs that were killed are removed.
void prepare_output_folder(const std::filesystem::path& folder, const std::vector<std::string>& names, bool overwrite);

}  // namespace felt::apps
