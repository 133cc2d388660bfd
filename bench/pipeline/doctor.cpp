// Faults put into recordings one at a time, and what the doctor says of each: a table of hits. `bench_doctor [NAME...]`
// takes recordings below FELTMAP_DATA; exits 1 where a sound sequence is accused or less than 95 % of faults are named.
#include <cstdio>
#include <map>
#include <random>

#include "bench/support/bench.h"
#include "bench/support/corrupt.h"
#include "core/stopwatch.h"
#include "io/doctor/doctor.h"

namespace fs = std::filesystem;
using namespace felt;

namespace {

/// Frames of a recording that a fault is put into: as many as the doctor looks at.
constexpr int64_t kFrames = 30;

struct Recording {
  std::string name;
  bool views = false;  ///< taken one by one by a robot's arm at rest
};

const std::vector<Recording> kRecordings = {{"7scenes_redkitchen"},      {"7scenes_redkitchen_png"},
                                            {"apc_shelf_probs", true},   {"house_living_rendered"},
                                            {"icl_livingroom_maskrcnn"}, {"labelfusion_shelf", true},
                                            {"open3d_redwood_5"},        {"scannet_sens_small/house_living.sens"},
                                            {"sun3d_nvblox_5"},          {"tum_fr1_rpy"}};

std::string accused_topics(const Examination& examination) {
  std::string topics;
  for (const Finding& finding : examination.findings)
    if (finding.faulty) topics += (topics.empty() ? "" : " ") + finding.topic;
  return topics;
}

/// What the doctor measured about a topic, for the reader of a miss.
void print_evidence(const Examination& examination, const std::string& topics) {
  for (const Finding& finding : examination.findings)
    if (topics.find(finding.topic) != std::string::npos)
      std::printf("%30s %s: %s; %s\n", "", finding.topic.c_str(), finding.belief.c_str(), finding.evidence.c_str());
}

bool names(const Examination& examination, const std::string& topic) {
  for (const Finding& finding : examination.findings)
    if (finding.faulty && finding.topic == topic) return true;
  return false;
}

/// A folder of its own that goes with the object.
struct Scratch {
  fs::path path = fs::temp_directory_path() / ("feltmap_doctor_" + std::to_string(std::random_device()()));
  ~Scratch() {
    std::error_code fault;
    fs::remove_all(path, fault);
  }
};

struct Tally {
  int cases = 0, named = 0, sound = 0, accused = 0;
  /// By fault, then by recording: "yes", "**no**" or "-" where the fault does not suit it.
  std::map<std::string, std::map<std::string, std::string>> table;
};

void examine_recording(const Recording& recording, Tally& tally) {
  const Stopwatch watch;
  const fs::path path = bench::recorded(recording.name);
  const Scratch work;
  const char* const name = recording.name.c_str();
  const Examination whole = examine_sequence(path);
  corrupt::Copy copy = corrupt::sound_copy(path, work.path / "base", kFrames);
  copy.views = recording.views;
  bool clean = true;
  for (const Examination& sound : {whole, examine_sequence(work.path / "base")}) {
    ++tally.sound;
    tally.accused += sound.faulty();
    clean &= !sound.faulty();
    std::printf("%-26.26s %-28s %s\n", name, "(sound)",
                sound.faulty() ? ("ACCUSED of " + accused_topics(sound)).c_str() : "ok");
    print_evidence(sound, accused_topics(sound));
  }
  tally.table["(sound)"][recording.name] = clean ? "clean" : "**accused**";
  for (const corrupt::Fault& fault : corrupt::faults()) {
    std::string& cell = tally.table[fault.name][recording.name];
    cell = "-";
    corrupt::Copy faulty = copy;
    if (!fault.apply(faulty)) continue;
    const fs::path out = work.path / "faulty";
    fs::remove_all(out);
    corrupt::write(faulty, out, fault.topic == "stamp-offset");
    ++tally.cases;
    std::string said;
    bool hit = false;
    Examination examination;
    try {
      examination = examine_sequence(out);
      hit = names(examination, fault.topic);
      said = accused_topics(examination);
    } catch (const std::exception& error) {
      said = std::string("error: ") + error.what();
    }
    tally.named += hit;
    cell = hit ? "yes" : "**no**";
    std::printf("%-26.26s %-28s %-6s %s\n", name, fault.name.c_str(), hit ? "named" : "MISSED", said.c_str());
    if (!hit) print_evidence(examination, fault.topic + " " + said);
    std::fflush(stdout);
  }
  std::printf("%-26.26s %.1f s\n", name, watch.seconds());
}

void print_table(const Tally& tally) {
  std::vector<std::string> rows = {"(sound)"};
  for (const corrupt::Fault& fault : corrupt::faults()) rows.push_back(fault.name);
  std::printf("\n| fault |");
  for (const auto& [recording, cell] : tally.table.at("(sound)")) std::printf(" %s |", recording.c_str());
  std::printf("\n|---|");
  for (size_t i = 0; i < tally.table.at("(sound)").size(); ++i) std::printf("---|");
  for (const std::string& row : rows) {
    std::printf("\n| %s |", row.c_str());
    for (const auto& [recording, cell] : tally.table.at(row)) std::printf(" %s |", cell.c_str());
  }
  std::printf("\n\n");
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<std::string> asked(argv + 1, argv + argc);
  Tally tally;
  const Stopwatch watch;
  for (const Recording& recording : kRecordings)
    if (asked.empty() || std::count(asked.begin(), asked.end(), recording.name) > 0)
      examine_recording(recording, tally);
  if (tally.sound == 0) {
    std::fprintf(stderr, "no recording of that name\n");
    return 2;
  }
  print_table(tally);
  std::printf("%d of %d faults named (%.1f %%), %d of %d sound sequences accused, %.0f s\n", tally.named, tally.cases,
              100.0 * tally.named / std::max(1, tally.cases), tally.accused, tally.sound, watch.seconds());
  return tally.accused > 0 || tally.named < 0.95 * tally.cases;
}
