#include "apps/output/output_files.h"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <iterator>
#include <limits>
#include <set>

#include "core/error.h"
#include "core/text.h"
#include "io/files/atomic_file.h"
#include "io/map_file/map_file.h"
#include "mapping/grids/leaf_mask.h"
#include "mapping/labels/class_belief.h"
#include "mapping/maps/table_difference.h"

namespace felt::apps {
namespace fs = std::filesystem;
namespace {

/// Frames of a run that the journal does not hold with the same settings.
size_t frames_missing_from(const FrameJournal& journal, const FusedFrames& run) {
  std::set<int64_t> missing(run.frames.begin(), run.frames.end());
  for (const FusedFrames& other : journal.runs)
    if (other.sequence == run.sequence && other.settings == run.settings)
      for (const int64_t frame : other.frames) missing.erase(frame);
  return missing.size();
}

/// Observed voxels of an older map that are not observed in the new one.
size_t voxels_missing_from(const Map& map, const Map& older) {
  size_t missing = 0;
  for (const Block& block : older.store.blocks()) {
    const Block* kept = map.store.get(block.coord);
    missing += size_t((observed_voxels(block) - (kept ? observed_voxels(*kept) : BlockMask{})).count());
  }
  return missing;
}

/// Pairs of a voxel and a class with evidence in an older map and none in the new one: its images were labelled
/// otherwise.
size_t evidence_missing_from(const Map& map, const Map& older) {
  size_t missing = 0;
  for (const Block& block : older.store.blocks()) {
    const Block* kept = map.store.get(block.coord);
    for (const EvidencePlane& plane : block.evidence) {
      const Plane* counts = kept != nullptr ? evidence_counts(*kept, plane.slot) : nullptr;
      for (int i = 0; i < kBlockVoxels; ++i)
        missing += plane.counts->value[i] > 0 && !(counts != nullptr && counts->value[i] > 0);
    }
  }
  return missing;
}

/// Voxels that an older map observed more often, or labelled more often, than the new one: a lower cap took that away.
size_t voxels_of_less_weight(const Map& map, const Map& older) {
  constexpr double kRounding = 1e-4;
  size_t less = 0;
  for (const Block& block : older.store.blocks()) {
    const Block* kept = map.store.get(block.coord);
    for (int i = 0; i < kBlockVoxels && kept != nullptr; ++i)
      less += double(kept->geometry->weight[i]) < double(block.geometry->weight[i]) * (1 - kRounding) ||
              total_evidence(*kept, i) < total_evidence(block, i) * (1 - kRounding);
  }
  return less;
}

/// Touches that count in an older map and not in the new one.
struct MissingTouches {
  size_t unknown = 0;  ///< to the new one
  size_t undone = 0;   ///< in the new one
};

MissingTouches touches_missing_from(const TouchJournal& journal, const TouchJournal& older) {
  MissingTouches missing;
  for (const Touch& touch : older.touches) {
    if (touch.undone) continue;
    const Touch* kept = journal.find(touch.id);
    missing.unknown += kept == nullptr;
    missing.undone += kept != nullptr && kept->undone;
  }
  return missing;
}

/// What an older map holds that the new one does not, in words; empty where there is nothing.
std::string missing_from(const Map& map, const Map& older, LostTouches touches) {
  if (older.voxel_size_m != map.voxel_size_m)
    return "a map of " + number_text(older.voxel_size_m, "%.15g") + " m voxels";
  if (!older.classes.empty() && !(older.classes == map.classes)) return "a map of other classes";
  if (!continues(map.properties, older.properties)) return "a map of other properties";
  if (older.frames.runs.empty() && !map.frames.runs.empty()) return "a map that does not say of what it was made";
  size_t lost_frames = 0;
  for (const FusedFrames& run : older.frames.runs) lost_frames += frames_missing_from(map.frames, run);
  const MissingTouches lost_touches =
      touches == LostTouches::refuse ? touches_missing_from(map.touches, older.touches) : MissingTouches();
  if (lost_frames > 0 || lost_touches.unknown > 0)
    return "a map with " + std::to_string(lost_frames) + " frames and " + std::to_string(lost_touches.unknown) +
           " touches that the new one does not hold";
  if (lost_touches.undone > 0)
    return "a map where " + std::to_string(lost_touches.undone) + " touches count that are undone in the new one";
  // A part that was cut out has the whole journal of frames.
  if (const size_t voxels = voxels_missing_from(map, older); voxels > 0)
    return "a map with " + std::to_string(voxels) + " observed voxels that the new one does not hold";
  // Which images held the labels is not in the journal.
  if (const size_t labels = evidence_missing_from(map, older); labels > 0)
    return "a map with class evidence that the new one does not hold (" + std::to_string(labels) + " counts)";
  if (const size_t voxels = voxels_of_less_weight(map, older); voxels > 0)
    return "a map with " + std::to_string(voxels) +
           " voxels of more weight or class evidence than in the new one (--max-weight and --label-cap of merge)";
  return "";
}

/// Where a file lies or will lie, also where it is named without a folder. Throws IoError where it cannot.
fs::path folder_of_output(const fs::path& destination) {
  require_file_place(destination);
  const fs::path file = linked_file(destination);
  return file.has_parent_path() ? file.parent_path() : fs::path(".");
}

/// Whether anybody may write to it, by its mode: `access` says yes to the superuser whatever that is.
bool is_made_read_only(const fs::path& file) {
  constexpr fs::perms kWrite = fs::perms::owner_write | fs::perms::group_write | fs::perms::others_write;
  return (fs::status(file).permissions() & kWrite) == fs::perms::none;
}

}  // namespace

void prepare_output_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (!fs::is_directory(folder))
    throw IoError(describe_mismatch(folder.string(), "output folder", "a folder that exists or can be made",
                                    error ? error.message() : "something that is no folder"));
  if (access(folder.c_str(), W_OK | X_OK) != 0)
    throw IoError(
        describe_mismatch(folder.string(), "output folder", "a folder that can be written", std::strerror(errno)));
}

void require_no_files(const fs::path& folder, const std::vector<std::string>& names, bool overwrite) {
  std::vector<std::string> in_the_way;
  std::ranges::copy_if(names, std::back_inserter(in_the_way),
                       [&](const auto& name) { return fs::exists(folder / name); });
  if (!in_the_way.empty() && !overwrite)
    throw IoError(describe_mismatch(folder.string(), "output exists", "no result there, or --force to replace it",
                                    listed(in_the_way)));
  for (const std::string& name : names) remove_abandoned_parts(folder / name);
}

void require_no_file(const fs::path& file, bool overwrite) {
  require_file_place(file);
  if (!overwrite && fs::exists(file))
    throw IoError(describe_mismatch(file.string(), "output exists", "no file there, or --force to replace it", "one"));
  remove_abandoned_parts(linked_file(file));
}

void require_writable(const fs::path& file, bool overwrite) {
  if (overwrite || !fs::is_regular_file(file)) return;
  std::string reason;
  if (is_made_read_only(file))
    reason = "one that was made read-only";
  else if (access(file.c_str(), W_OK) != 0)
    reason = std::strerror(errno);
  if (!reason.empty())
    throw IoError(describe_mismatch(file.string(), "output exists", "a file that may be written, or --force", reason));
}

void require_nothing_lost(const fs::path& file, const Map& replacement, LostTouches touches, bool overwrite) {
  if (overwrite || !fs::is_regular_file(file)) return;
  std::string lost;
  size_t forgotten_touches = 0;
  try {
    const Map older = load_map(file);
    lost = missing_from(replacement, older, touches);
    forgotten_touches = touches_missing_from(replacement.touches, older.touches).unknown;
  } catch (const Error&) {
    lost = "a file that is no map that can be read";
  }
  if (!lost.empty())
    throw IoError(describe_mismatch(file.string(), "output exists", "no file there, or --force to replace it", lost));
  if (forgotten_touches > 0)
    spdlog::warn("{}: {} touches that count there are not in the map that replaces it", file.string(),
                 forgotten_touches);
}

void require_ending(const fs::path& file, const std::string& ending) {
  if (file.extension() != ending && fs::is_regular_file(file))
    throw ConfigError(describe_mismatch(file.string(), "output exists", "a name that ends with " + ending,
                                        "another file, which would be replaced"));
}

void warn_if_coarse(const TriangleMesh& mesh, const fs::path& file) {
  float farthest = 0;
  for (const Eigen::Vector3f& p : mesh.positions) farthest = std::max(farthest, p.cwiseAbs().maxCoeff());
  const float step_m = std::nextafter(farthest, std::numeric_limits<float>::infinity()) - farthest;
  constexpr float kMillimetre = 0.001f;
  if (step_m > kMillimetre)
    spdlog::warn(
        "{}: coordinates up to {:.0f} m are kept to {:.3g} m in the 32-bit floats of meshes; the map itself is exact. "
        "Subtract an offset from the poses for a mesh that is, too",
        file.string(), farthest, step_m);
}

MapWriting::MapWriting(const fs::path& file, bool overwrite)
    : folder_(folder_of_output(file), FileLock::Kind::shared, 1), file_(file, FileLock::Kind::exclusive, 60) {
  require_writable(file, overwrite);
  remove_abandoned_parts(linked_file(file));
}

}  // namespace felt::apps
