#include "apps/output_folder.h"

#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "core/error.h"
#include "io/files/atomic_file.h"

namespace felt::apps {
namespace fs = std::filesystem;

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

}  // namespace felt::apps
