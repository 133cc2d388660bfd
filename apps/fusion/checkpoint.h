#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "apps/output/reconstruct_report.h"
#include "io/sequence/reader.h"
#include "mapping/map.h"

namespace felt::apps {

// A reconstruction can go on where an earlier one ended, however that ended: its map file is the checkpoint. The file
// is whole at every moment (io/files/atomic_file.h), and besides the map it holds the settings and how far the sequence
// was read.

/// The part of the settings that shapes what a frame does to a map, as text: what the frame journal notes. Paths and
/// the selection of frames are left out, so that parts of one recording have the same.
std::string fusion_settings(const nlohmann::ordered_json& config);

/// Writes the map with all that `resume` needs, and its views where the run ends. `config`: settings as used.
/// `viewpoints`: ViewNovelty::seen. `complete`: nothing is left to do for this map but to mesh it; its recorded touches
/// are in it, and `touches` (JSON) says what became of each. Returns the map's hash.
std::string save_checkpoint(Map& map, const FusionRecord& record, const std::vector<Eigen::Isometry3d>& viewpoints,
                            bool complete, const std::string& touches, const SequenceInfo& sequence,
                            const nlohmann::ordered_json& config, const std::filesystem::path& path);

using Reading = std::map<std::string, std::string>;  ///< SequenceInfo::reading

/// The recording of a map's run, and how it was understood then.
struct RecordingAsRead {
  std::string content;  ///< SequenceInfo::content
  Reading reading;
};

/// One, or those of all maps that a map was merged of; none where the map does not say.
std::vector<RecordingAsRead> recordings_of(const Map& map);

/// Names of what both readings say, and say differently: camera, depth scale, label images, ...
std::vector<std::string> differences(const Reading& a, const Reading& b);

/// Of a part of a map, or of a merged one: no run can go on with it.
void forget_progress(Map& map);

/// Where an earlier run ended.
struct Checkpoint {
  Map map;
  FusionRecord record;  ///< what was counted; no times
  std::vector<Eigen::Isometry3d> viewpoints;
  bool complete = false;
  std::string touches;  ///< JSON of a complete run that had any, else empty
};

/// What `save_checkpoint` wrote; nothing where there is no such file. Throws ConfigError where the recording is
/// another or has changed since, or naming every setting that is another now, be it the recording's own, and
/// FormatError where the file is no map of one reconstruction.
std::optional<Checkpoint> resume(const std::filesystem::path& path, const SequenceInfo& sequence,
                                 const nlohmann::ordered_json& config);

}  // namespace felt::apps
