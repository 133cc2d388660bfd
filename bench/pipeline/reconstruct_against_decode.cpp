// The whole command, files to map and mesh, against decoding the same files alone with the same decoder and threads.
//
//   bench_reconstruct_against_decode FELTMAP SEQUENCE [threads=2] [rounds=7]
//
// Both alternate within one run; medians and their ratio are printed. Fails where the command did not read every frame.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/median.h"
#include "core/stopwatch.h"
#include "io/files/system_memory.h"
#include "io/sequence/decode_ahead.h"
#include "io/sequence/open_sequence.h"

namespace {
namespace fs = std::filesystem;

double decode_alone_s(const std::string& sequence, int threads, int64_t& frames) {
  const felt::Stopwatch watch;
  const auto reader = felt::open_sequence(sequence);
  felt::DecodeAhead ahead(*reader, {.threads = threads});
  for (frames = 0; ahead.next(); ++frames) {
  }
  return watch.seconds();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "usage: bench_reconstruct_against_decode FELTMAP SEQUENCE [threads] [rounds]\n");
    return 2;
  }
  felt::keep_freed_memory();  // as the command does
  const std::string sequence = argv[2];
  const int threads = argc > 3 ? std::atoi(argv[3]) : 2, rounds = argc > 4 ? std::atoi(argv[4]) : 7;
  const fs::path out = fs::temp_directory_path() / "feltmap-bench-reconstruct";
  const std::string command = std::string("'") + argv[1] + "' reconstruct '" + sequence + "' --out '" + out.string() +
                              "' --force --quiet --threads " + std::to_string(threads);
  int64_t frames = 0;
  decode_alone_s(sequence, threads, frames);  // the files are in the page cache from here on
  std::vector<double> alone_s, whole_s;
  nlohmann::json report;
  for (int round = 0; round < rounds; ++round) {
    alone_s.push_back(decode_alone_s(sequence, threads, frames));
    const felt::Stopwatch watch;
    if (std::system(command.c_str()) != 0) return 1;
    whole_s.push_back(watch.seconds());
    report = nlohmann::json::parse(std::ifstream(out / "report.json"));
    if (report["frames"]["read"] != frames) {
      std::fprintf(stderr, "the command read %s frames of %lld\n", report["frames"]["read"].dump().c_str(),
                   static_cast<long long>(frames));
      return 1;
    }
  }
  std::printf("%lld frames, %d threads, medians of %d: decoding alone %.3f s, whole command %.3f s, ratio %.2f\n",
              static_cast<long long>(frames), threads, rounds, felt::median(alone_s), felt::median(whole_s),
              felt::median(whole_s) / felt::median(alone_s));
  std::printf("least: decoding alone %.3f s, whole command %.3f s, ratio %.2f\n",
              *std::min_element(alone_s.begin(), alone_s.end()), *std::min_element(whole_s.begin(), whole_s.end()),
              *std::min_element(whole_s.begin(), whole_s.end()) / *std::min_element(alone_s.begin(), alone_s.end()));
  std::printf("time_s of the last: %s\n", report["time_s"].dump().c_str());
  fs::remove_all(out);
  return 0;
}
