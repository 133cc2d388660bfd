#include <catch2/catch.hpp>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <sstream>

#include "tests/support/data.h"

namespace fs = std::filesystem;

namespace {

std::map<std::string, std::string> files_of(const fs::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file()) {
      std::ifstream in(entry.path(), std::ios::binary);
      files[fs::relative(entry.path(), folder)] = {std::istreambuf_iterator<char>(in), {}};
    }
  return files;
}

}  // namespace

TEST_CASE("the stored scenes are what the simulator writes, and small") {
  const felt::test::TemporaryDirectory directory;
  const fs::path root = felt::test::source_dir();
  std::ostringstream line;
  line << (root / "scripts" / "make_scenes") << " " << felt::test::command() << " " << directory.path()
       << " > /dev/null";
  REQUIRE(std::system(line.str().c_str()) == 0);
  const auto stored = files_of(root / "data" / "scenes"), made = files_of(directory.path());
  CHECK(stored.size() > 100);
  std::map<std::string, size_t> bytes;
  for (const auto& [name, content] : stored) bytes[name.substr(0, name.find('/'))] += content.size();
  for (const auto& [scene, size] : bytes) {
    INFO(scene);
    CHECK(size < 1000000);
  }
  for (const auto& [name, content] : made) {
    INFO(name);
    REQUIRE(stored.count(name) == 1);
    CHECK((stored.at(name) == content));
  }
  CHECK(stored.size() == made.size());
}
