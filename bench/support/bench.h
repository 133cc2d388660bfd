#pragma once

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "core/median.h"
#include "core/stopwatch.h"
#include "io/sequence/open_sequence.h"

namespace felt::bench {

/// Folder of a recorded sequence below FELTMAP_DATA (default ../shared/data); ends the program with a clear message
/// where it is absent.
inline std::filesystem::path recorded(const std::string& name) {
  const char* set = std::getenv("FELTMAP_DATA");
  const std::filesystem::path folder = std::filesystem::path(set != nullptr ? set : "../shared/data") / name;
  if (std::filesystem::exists(folder)) return folder;
  std::printf("skipped: no recorded data '%s'; set FELTMAP_DATA to its folder\n", folder.c_str());
  std::exit(0);
}

/// Every usable frame of a sequence, decoded.
inline std::vector<Frame> decoded(const std::string& name, const SequenceOptions& options = {}) {
  const std::unique_ptr<SequenceReader> reader = open_sequence(recorded(name), options);
  std::vector<Frame> frames;
  for (int64_t i = 0; i < reader->size(); ++i) {
    ReadResult result = reader->read(i);
    if (Frame* frame = std::get_if<Frame>(&result)) frames.push_back(std::move(*frame));
  }
  return frames;
}

using felt::median;

template <typename F>
double seconds(F&& work) {
  const Stopwatch watch;
  work();
  return watch.seconds();
}

}  // namespace felt::bench
