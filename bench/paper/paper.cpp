// The experiments of Ewen et al. (RSS 2024) with our engine, and the claims that they support (docs/results.md).
//
//   bench_paper [labels|maps|situations|sequences]... [--quick] [--out FOLDER]
//
// Without a name all of them. Exits with 1 where a claim fails. Pictures and plots go to FOLDER.
#include <cstring>
#include <set>
#include <string>

#include "bench/paper/experiments.h"
#include "core/simd.h"

int main(int argc, char** argv) {
  using namespace felt;
  apply_simd_choice();
  paper::Options options;
  std::set<std::string> chosen;
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--quick") == 0) {
      options.quick = true;
    } else if (std::strcmp(argv[i], "--out") == 0 && i + 1 < argc) {
      options.out = argv[++i];
    } else {
      chosen.insert(argv[i]);
    }
  }
  const std::pair<const char*, void (*)(const paper::Options&, paper::Checks&)> experiments[] = {
      {"labels", paper::material_labels},
      {"maps", paper::room_maps},
      {"situations", paper::situations},
      {"sequences", paper::recorded_sequences}};
  for (const std::string& name : chosen) {
    bool known = false;
    for (const auto& [experiment, run] : experiments) known = known || name == experiment;
    if (!known) {
      std::fprintf(stderr,
                   "usage: bench_paper [labels|maps|situations|sequences]... [--quick] [--out FOLDER]; found '%s'\n",
                   name.c_str());
      return 2;
    }
  }
  if (!options.out.empty()) std::filesystem::create_directories(options.out);
  paper::Checks checks;
  for (const auto& [name, run] : experiments)
    if (chosen.empty() || chosen.contains(name)) run(options, checks);
  std::printf("\n## Claims\n");
  return checks.report() ? 0 : 1;
}
