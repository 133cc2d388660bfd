#include "apps/output_files.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <set>

#include "core/error.h"
#include "io/files/atomic_file.h"
#include "io/map_file/map_file.h"

namespace felt::apps {
namespace fs = std::filesystem;
namespace {

/// What of the journals the map does not hold, in words; empty where there is nothing.
std::string missing_from(const Map& map, const MapJournals& journals) {
  std::set<uint64_t> touches;
  for (const Touch& touch : map.touches.touches) touches.insert(touch.id);
  const size_t lost_frames =
      shared_frames(journals.frames, journals.frames).size() - shared_frames(journals.frames, map.frames).size();
  const auto lost_touches = std::count_if(journals.touches.touches.begin(), journals.touches.touches.end(),
                                          [&](const Touch& touch) { return !touches.contains(touch.id); });
  if (lost_frames == 0 && lost_touches == 0) return "";
  return "a map with " + std::to_string(lost_frames) + " frames and " + std::to_string(lost_touches) +
         " touches that the new one does not hold";
}

}  // namespace

void prepare_output_folder(const fs::path& folder, const std::vector<std::string>& names, bool overwrite) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (!fs::is_directory(folder))
    throw IoError(describe_mismatch(folder.string(), "output folder", "a folder that exists or can be made",
                                    error ? error.message() : "something that is no folder"));
  if (access(folder.c_str(), W_OK | X_OK) != 0)
    throw IoError(
        describe_mismatch(folder.string(), "output folder", "a folder that can be written", std::strerror(errno)));
  for (const std::string& name : names) remove_abandoned_parts(folder / name);
  std::string in_the_way;
  for (const std::string& name : names)
    if (fs::exists(folder / name)) in_the_way += (in_the_way.empty() ? "" : ", ") + name;
  if (!in_the_way.empty() && !overwrite)
    throw IoError(
        describe_mismatch(folder.string(), "output exists", "no result there, or --force to replace it", in_the_way));
}

void require_no_file(const fs::path& file, bool overwrite) {
  if (!overwrite && fs::exists(file))
    throw IoError(describe_mismatch(file.string(), "output exists", "no file there, or --force to replace it", "one"));
}

void require_nothing_lost(const fs::path& file, const Map& replacement, bool overwrite) {
  if (overwrite || !fs::is_regular_file(file)) return;
  std::string lost;
  try {
    lost = missing_from(replacement, load_journals(file));
  } catch (const Error&) {
    lost = "a file that is no map that can be read";
  }
  if (!lost.empty())
    throw IoError(describe_mismatch(file.string(), "output exists", "no file there, or --force to replace it", lost));
}

}  // namespace felt::apps
