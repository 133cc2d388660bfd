#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/mesh.h"
#include "io/files/file_lock.h"
#include "mapping/map.h"

namespace felt::apps {

/// Makes `folder` ready before any work is done, so that nothing is lost to a read-only disk at the end: creates it and
/// checks that it can be written. Throws IoError.
void prepare_output_folder(const std::filesystem::path& folder);

/// Checks that none of the files `names` of a folder exists unless `overwrite`: throws IoError that names every file in
/// the way. Half-written files of runs that were killed are removed. Call it with the folder locked, since others may
/// write there while one waits for the lock.
void require_no_files(const std::filesystem::path& folder, const std::vector<std::string>& names, bool overwrite);

/// The same for one file: throws IoError where it exists unless `overwrite`, and where it is no file at all, and
/// removes half-written ones.
void require_no_file(const std::filesystem::path& file, bool overwrite);

/// Throws IoError where the file was made read-only, unless `overwrite`: files are replaced by renaming, which would
/// not ask. For the superuser, too, whom the system would let write.
void require_writable(const std::filesystem::path& file, bool overwrite);

/// What is done about touches that count in a map and not in the one that replaces it.
enum class LostTouches {
  refuse,  ///< the map stays, also where the new journal holds them as undone
  warn     ///< of those that the new journal does not hold at all; what is undone there was undone on purpose
};

/// For a file that may be replaced by a map with voxels of the same size and the same tables which holds all its
/// frames, fused with the same settings, all its observed voxels, and its touches as far as `touches` says: throws
/// IoError where it is no map, or one that holds more, unless `overwrite`.
void require_nothing_lost(const std::filesystem::path& file, const Map& replacement, LostTouches touches,
                          bool overwrite);

/// For pictures and tables, which may be replaced: throws ConfigError where the file exists and its name does not end
/// so.
void require_ending(const std::filesystem::path& file, const std::string& ending);

/// Warns where the coordinates of a mesh are so large that 32-bit floats lose more than a millimetre.
void warn_if_coarse(const TriangleMesh& mesh, const std::filesystem::path& file);

/// Keeps other commands from a map file, and runs of reconstruct from its folder, while it is replaced by what is made
/// of it: make one before the map is read. Waits for other commands up to a minute. Half-written files of commands that
/// were killed are removed. Throws IoError, at once for what is no file, and for one that was made read-only, unless
/// `overwrite`.
class MapWriting {
public:
  MapWriting(const std::filesystem::path& file, bool overwrite);

private:
  FileLock folder_, file_;
};

}  // namespace felt::apps
