#include "tests/support/folder_content.h"

#include <fstream>
#include <iterator>

namespace felt::test {
namespace fs = std::filesystem;

std::map<std::string, std::string> files_of(const fs::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file()) {
      std::ifstream in(entry.path(), std::ios::binary);
      files[fs::relative(entry.path(), folder)] = {std::istreambuf_iterator<char>(in), {}};
    }
  return files;
}

}  // namespace felt::test
