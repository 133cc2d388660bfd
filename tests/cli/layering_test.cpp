#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include "tests/support/data.h"

namespace felt::test {
namespace {
namespace fs = std::filesystem;

struct Include {
  std::string file;  ///< relative to the root, for messages
  std::string header;
  bool in_header = false;
};

std::vector<Include> includes_below(const std::string& module) {
  static const std::regex directive(R"re(^\s*#\s*include\s*[<"]([^>"]+)[>"])re");
  const fs::path root = felt::test::source_dir();
  std::vector<Include> found;
  for (const auto& entry : fs::recursive_directory_iterator(root / module)) {
    const std::string extension = entry.path().extension();
    if (extension != ".h" && extension != ".cpp") continue;
    std::ifstream file(entry.path());
    std::smatch match;
    for (std::string line; std::getline(file, line);) {
      if (!std::regex_search(line, match, directive)) continue;
      found.push_back({fs::relative(entry.path(), root).string(), match[1].str(), extension == ".h"});
    }
  }
  return found;
}

/// The files of `module` that include a header whose name matches `pattern`.
std::set<std::string> files_including(const std::string& module, const std::string& pattern,
                                      bool headers_only = false) {
  const std::regex forbidden(pattern);
  std::set<std::string> files;
  for (const Include& include : includes_below(module)) {
    if (headers_only && !include.in_header) continue;
    if (std::regex_search(include.header, forbidden)) files.insert(include.file + " includes " + include.header);
  }
  return files;
}

const std::vector<std::string> kModules = {"core", "inference", "mapping", "io", "apps"};
const std::set<std::string> kNone;

}  // namespace

TEST_CASE("a module includes only itself and the modules below it") {
  REQUIRE_FALSE(includes_below("core").empty());
  for (size_t i = 0; i < kModules.size(); ++i) {
    for (size_t above = i + 1; above < kModules.size(); ++above) {
      INFO(kModules[i] << " must not know " << kModules[above]);
      CHECK(files_including(kModules[i], "^" + kModules[above] + "/") == kNone);
    }
    CHECK(files_including(kModules[i], "^(tests|bench)/") == kNone);
    CHECK(files_including(kModules[i], R"(^\.\.?/)") == kNone);
  }
}

TEST_CASE("a folder of a module includes only those before it") {
  const std::map<std::string, std::vector<std::string>> folders = {
      {"inference", {"batch"}},
      {"mapping", {"store", "labels", "fusion", "regions", "touch", "surface", "grids", "maps", "evaluation"}},
      {"io",
       {"files", "images", "tables", "meshes", "sequence", "segmentation", "settings", "pictures", "readings",
        "map_file", "doctor", "simulation"}},
      {"apps", {"options", "output", "fusion", "commands"}}};
  for (const auto& [module, order] : folders) {
    std::set<std::string> listed(order.begin(), order.end()), there;
    for (const auto& entry : fs::directory_iterator(felt::test::source_dir() / module))
      if (entry.is_directory()) there.insert(entry.path().filename());
    CHECK(there == listed);
    for (size_t i = 0; i < order.size(); ++i)
      for (size_t later = i + 1; later < order.size(); ++later) {
        INFO(module << "/" << order[i] << " must not know " << order[later]);
        CHECK(files_including(module + "/" + order[i], "^" + module + "/" + order[later] + "/") == kNone);
      }
  }
  CHECK(files_including("mapping/store", "^mapping/map") == kNone);  // which holds the store
  for (const std::string& file : files_including("inference", "^inference/batch/")) {
    INFO(file << ": the specification must not know the kernels that follow it");
    CHECK(file.starts_with("inference/batch/"));
  }
}

TEST_CASE("core and inference know neither OpenVDB nor OpenCV, and mapping does not know OpenCV") {
  for (const char* module : {"core", "inference"}) CHECK(files_including(module, "^(openvdb|opencv2)/") == kNone);
  CHECK(files_including("mapping", "^opencv2/") == kNone);
}

TEST_CASE("only io and apps open files") {
  for (const char* module : {"core", "inference", "mapping"})
    CHECK(files_including(module, R"(^(fstream|filesystem|fcntl\.h|openvdb/io/.*)$)") == kNone);
}

TEST_CASE("headers do not pull in OpenVDB's tools, OpenCV, JSON, YAML or the command line parser") {
  for (const std::string& module : kModules) {
    CHECK(files_including(module, "^openvdb/tools/", true) == kNone);
    CHECK(files_including(module, "^(opencv2|yaml-cpp)/", true) == kNone);
    // Its forward declarations are a page.
    if (module != "apps") CHECK(files_including(module, R"(^(nlohmann/(?!json_fwd\.hpp)|CLI/))", true) == kNone);
  }
}

TEST_CASE("only kernels are compiled for several instruction sets") {
  for (const std::string& module : kModules) {
    for (const std::string& file : files_including(module, R"(^hwy/foreach_target\.h$)")) {
      INFO(file);
      CHECK(file.find("_kernels_simd.cpp") != std::string::npos);
    }
  }
}

}  // namespace felt::test
