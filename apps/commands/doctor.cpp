#include <cstdio>
#include <nlohmann/json.hpp>

#include "apps/command.h"
#include "apps/commands/commands.h"
#include "apps/exit_code.h"
#include "apps/options/reading_options.h"
#include "io/doctor/doctor.h"

namespace felt::apps {
namespace {
using Json = nlohmann::ordered_json;

Json to_json(const Examination& examination) {
  Json findings = Json::array();
  for (const Finding& finding : examination.findings)
    findings.push_back({{"topic", finding.topic},
                        {"faulty", finding.faulty},
                        {"confidence", finding.confidence},
                        {"belief", finding.belief},
                        {"evidence", finding.evidence},
                        {"remedy", finding.remedy}});
  const MapProposal& proposal = examination.proposal;
  return {{"layout", examination.layout},
          {"faulty", examination.faulty()},
          {"frames", examination.recorded_frames},
          {"selected_frames", examination.selected_frames},
          {"sampled_frames", examination.sampled_frames},
          {"frame_pairs", examination.frame_pairs},
          {"skipped", examination.skipped},
          {"findings", findings},
          {"proposal",
           {{"voxel_size_m", proposal.voxel_size_m},
            {"truncation_m", proposal.truncation_m},
            {"max_depth_m", proposal.max_depth_m},
            {"median_depth_m", proposal.median_depth_m},
            {"far_depth_m", proposal.far_depth_m},
            {"pixel_m", proposal.pixel_m}}}};
}

void print(const Examination& examination, bool quiet) {
  if (!quiet) {
    std::printf("%s sequence of %lld frames", examination.layout.c_str(),
                static_cast<long long>(examination.recorded_frames));
    if (examination.selected_frames != examination.recorded_frames)
      std::printf(", of which %lld are selected", static_cast<long long>(examination.selected_frames));
    std::printf("; %lld frames and %lld pairs of them looked at\n", static_cast<long long>(examination.sampled_frames),
                static_cast<long long>(examination.frame_pairs));
  }
  for (const Finding& finding : examination.findings) {
    if (quiet && !finding.faulty) continue;
    std::printf("%s %s: %s (%.0f %% sure)\n", finding.faulty ? "FAULT" : "   ok", finding.topic.c_str(),
                finding.belief.c_str(), 100 * finding.confidence);
    if (!finding.evidence.empty()) std::printf("        %s\n", finding.evidence.c_str());
    if (!finding.remedy.empty()) std::printf("        mend: %s\n", finding.remedy.c_str());
  }
  const MapProposal& p = examination.proposal;
  if (!quiet && p.voxel_size_m > 0)
    std::printf(
        "proposed: --voxel-size %g --truncation %g --max-depth %g\n"
        "        half of depth is below %.2f m, 98 %% below %.2f m; a pixel sees %.1f mm there\n",
        p.voxel_size_m, p.truncation_m, p.max_depth_m, p.median_depth_m, p.far_depth_m, 1e3 * p.pixel_m);
}

}  // namespace

void add_doctor(CLI::App& app) {
  struct Arguments {
    std::filesystem::path sequence;
    ReadingArguments reading;
    CommonOptions common;
  };
  auto a = std::make_shared<Arguments>();
  CLI::App& command = add_command(
      app,
      {"doctor", "Examine a sequence before it is fused: what is wrong with it, and the option that mends it",
       "feltmap doctor recording\nfeltmap doctor recording --pose-convention w2c --json"},
      a->common, [a] {
        const Examination examination = examine_sequence(a->sequence, resolve(a->reading));
        if (a->common.json)
          print_json(to_json(examination));
        else
          print(examination, a->common.quiet);
        return examination.faulty() ? kDifferent : kDone;
      });
  command.add_option("SEQUENCE", a->sequence, "Folder of a recorded RGB-D sequence, or a .sens file")->required();
  add_reading_options(command, a->reading);
}

}  // namespace felt::apps
