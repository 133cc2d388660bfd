#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "mapping/map.h"

namespace felt::apps {

/// Makes `folder` ready before any work is done, so that nothing is lost to a full or read-only disk at the end:
/// creates it, checks that it can be written, and that none of the files `names` exists unless `overwrite`. Throws
/// IoError that names every file in the way. Half-written files of runs that were killed are removed.
void prepare_output_folder(const std::filesystem::path& folder, const std::vector<std::string>& names, bool overwrite);

/// The same for one file: throws IoError where it exists unless `overwrite`.
void require_no_file(const std::filesystem::path& file, bool overwrite);

/// The same for a file that may be replaced by a map which holds all its frames and touches: throws IoError where it
/// is no map, or one that holds more, unless `overwrite`.
void require_nothing_lost(const std::filesystem::path& file, const Map& replacement, bool overwrite);

}  // namespace felt::apps
