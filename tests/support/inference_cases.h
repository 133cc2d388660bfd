#pragma once

#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "inference/nig.h"
#include "tests/support/data.h"

namespace felt::test {

/// One JSON document a line; the test fails where there are not `count` of them.
inline std::vector<nlohmann::json> read_json_lines(const std::filesystem::path& path, size_t count) {
  std::vector<nlohmann::json> lines;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) lines.push_back(nlohmann::json::parse(line));
  INFO(path);
  REQUIRE(lines.size() == count);
  return lines;
}

/// Blocks of `{"tau": [...], "kappa": [...], "beta": [...], "gamma": [...]}`.
inline std::vector<Nig> nigs_of(const nlohmann::json& j) {
  std::vector<Nig> result(j["tau"].size());
  for (size_t c = 0; c < result.size(); ++c) {
    result[c] = {j["tau"][c], j["kappa"][c], j["beta"][c], j["gamma"][c]};
  }
  return result;
}

/// What tau is measured against: the largest of the plug-in standard deviations and the spread of the locations.
inline double class_spread(const std::vector<Nig>& prior) {
  double spread = 0, low = prior[0].tau, high = prior[0].tau;
  for (const Nig& p : prior) {
    spread = std::max(spread, std::sqrt(plug_in_variance(p)));
    low = std::min(low, p.tau);
    high = std::max(high, p.tau);
  }
  return std::max(spread, high - low);
}

inline double relative_error(double found, double expected) { return std::abs(found - expected) / std::abs(expected); }

}  // namespace felt::test
