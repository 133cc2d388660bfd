#include "tests/support/data.h"

#include <unistd.h>

#include <cstdlib>
#include <stdexcept>

namespace felt::test {
namespace fs = std::filesystem;

std::optional<fs::path> recorded(const std::string& name) {
  const char* set = std::getenv("FELTMAP_DATA");
  const fs::path folder = fs::path(set != nullptr && *set != 0 ? set : FELTMAP_DATA_DEFAULT) / name;
  if (!fs::exists(folder)) return std::nullopt;
  return folder;
}

fs::path source_dir() { return FELTMAP_SOURCE_DIR; }
fs::path command() { return FELTMAP_COMMAND; }

TemporaryDirectory::TemporaryDirectory() {
  std::string pattern = (fs::temp_directory_path() / "feltmap-test-XXXXXX").string();
  if (mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("cannot make a temporary directory " + pattern);
  path_ = pattern;
}

TemporaryDirectory::~TemporaryDirectory() {
  std::error_code ignored;
  fs::permissions(path_, fs::perms::owner_all, fs::perm_options::add, ignored);
  fs::remove_all(path_, ignored);
}

}  // namespace felt::test
