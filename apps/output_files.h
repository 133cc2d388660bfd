#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/mesh.h"
#include "io/files/file_lock.h"
#include "mapping/map.h"

namespace felt::apps {

/// Makes `folder` ready before any work is done, so that nothing is lost to a full or read-only disk at the end:
/// creates it, checks that it can be written, and that none of the files `names` exists unless `overwrite`. Throws
/// IoError that names every file in the way. Half-written files of runs that were killed are removed.
void prepare_output_folder(const std::filesystem::path& folder, const std::vector<std::string>& names, bool overwrite);

/// The same for one file: throws IoError where it exists unless `overwrite`.
void require_no_file(const std::filesystem::path& file, bool overwrite);

/// The same for a file that may be replaced by a map with the same voxels and tables which holds all its frames, fused
/// with the same settings, and (`touches_too`) its touches that count: throws IoError where it is no map, or one that
/// holds more, unless `overwrite`.
void require_nothing_lost(const std::filesystem::path& file, const Map& replacement, bool touches_too, bool overwrite);

/// For pictures and tables, which may be replaced: throws ConfigError where the file exists and its name does not end
/// so.
void require_ending(const std::filesystem::path& file, const std::string& ending);

/// Warns where the coordinates of a mesh are so large that 32-bit floats lose more than a millimetre.
void warn_if_coarse(const TriangleMesh& mesh, const std::filesystem::path& file);

/// Keeps other commands from a map file, and runs of reconstruct from its folder, while it is replaced by what is made
/// of it. Waits for other commands up to a minute. Half-written files of commands that were killed are removed. Throws
/// IoError.
class MapWriting {
public:
  explicit MapWriting(const std::filesystem::path& file);

private:
  FileLock folder_, file_;
};

}  // namespace felt::apps
