// Faults put into recordings one at a time, and what the doctor says of each: a table of hits. `bench_doctor [NAME...]`
// takes recordings below FELTMAP_DATA; exits 1 where a sound sequence is accused or less than 95 % of faults are named.
#include <chrono>
#include <cstdio>

#include "bench/support/bench.h"
#include "bench/support/corrupt.h"
#include "io/doctor.h"

namespace fs = std::filesystem;
using namespace felt;

namespace {

std::string accused_topics(const Examination& examination) {
  std::string topics;
  for (const Finding& finding : examination.findings)
    if (finding.faulty) topics += (topics.empty() ? "" : " ") + finding.topic;
  return topics;
}

bool names(const Examination& examination, const std::string& topic) {
  for (const Finding& finding : examination.findings)
    if (finding.faulty && finding.topic == topic) return true;
  return false;
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<std::string> recordings(argv + 1, argv + argc);
  if (recordings.empty())
    recordings = {"7scenes_redkitchen",      "7scenes_redkitchen_png",
                  "apc_shelf_probs",         "house_living_rendered",
                  "icl_livingroom_maskrcnn", "labelfusion_shelf",
                  "open3d_redwood_5",        "scannet_sens_small/house_living.sens",
                  "sun3d_nvblox_5",          "tum_fr1_rpy"};
  const fs::path work = fs::temp_directory_path() / ("feltmap_doctor_" + std::to_string(std::random_device()()));
  int cases = 0, named = 0, sound = 0, accused = 0;
  const auto start = std::chrono::steady_clock::now();
  for (const std::string& name : recordings) {
    const fs::path recording = bench::recorded(name), base = work / "base";
    fs::remove_all(work);
    const Examination whole = examine_sequence(recording);
    const corrupt::Copy copy = corrupt::sound_copy(recording, base, 40);
    for (const Examination& clean : {whole, examine_sequence(base)}) {
      ++sound;
      accused += clean.faulty();
      std::printf("%-26.26s %-28s %s\n", name.c_str(), "(sound)",
                  clean.faulty() ? ("ACCUSED of " + accused_topics(clean)).c_str() : "ok");
    }
    for (const corrupt::Fault& fault : corrupt::faults()) {
      corrupt::Copy faulty = copy;
      if (!fault.apply(faulty)) continue;
      const fs::path out = work / "faulty";
      fs::remove_all(out);
      corrupt::write(faulty, out, fault.topic == "stamp-offset");
      ++cases;
      std::string said;
      bool hit = false;
      try {
        const Examination examination = examine_sequence(out);
        hit = names(examination, fault.topic);
        said = accused_topics(examination);
      } catch (const std::exception& error) {
        said = std::string("error: ") + error.what();
      }
      named += hit;
      std::printf("%-26.26s %-28s %-6s %s\n", name.c_str(), fault.name.c_str(), hit ? "named" : "MISSED", said.c_str());
      std::fflush(stdout);
    }
  }
  fs::remove_all(work);
  std::printf("%d of %d faults named (%.1f %%), %d of %d sound sequences accused, %.0f s\n", named, cases,
              100.0 * named / std::max(1, cases), accused, sound,
              std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  return accused > 0 || named < 0.95 * cases;
}
