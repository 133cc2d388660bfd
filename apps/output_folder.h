#pragma once

#include <filesystem>
#include <span>
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

/// For a map that is made of others: throws IoError where `file` exists and is no map, or one with frames or touches
/// that none of `sources` holds, unless `overwrite`.
void require_nothing_lost(const std::filesystem::path& file, std::span<const Map* const> sources, bool overwrite);

}  // namespace felt::apps
