#include <catch2/catch.hpp>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <map>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <sstream>
#include <string>

#include "tests/support/data.h"
#include "tests/support/folder_content.h"

namespace fs = std::filesystem;
using felt::test::files_of;

namespace {

/// Greatest difference of two images of one kind and size, in steps of a channel; infinite where they are not.
double pixel_difference(const std::string& a, const std::string& b) {
  const auto decoded = [](const std::string& file) {
    return cv::imdecode(cv::Mat(1, int(file.size()), CV_8U, const_cast<char*>(file.data())), cv::IMREAD_UNCHANGED);
  };
  const cv::Mat image = decoded(a), other = decoded(b);
  const bool alike = !image.empty() && image.size() == other.size() && image.type() == other.type();
  return alike ? cv::norm(image, other, cv::NORM_INF) : std::numeric_limits<double>::infinity();
}

/// Encoders of another version may compress otherwise: pixels count, and those of JPEG up to the rounding of a
/// coefficient. Everything else is text.
bool same_content(const std::string& name, const std::string& a, const std::string& b) {
  if (name.ends_with(".png")) return pixel_difference(a, b) == 0;
  if (name.ends_with(".jpg")) return pixel_difference(a, b) <= 8;
  return a == b;
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
    CHECK(same_content(name, stored.at(name), content));
  }
  CHECK(stored.size() == made.size());
}
