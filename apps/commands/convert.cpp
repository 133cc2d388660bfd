#include <spdlog/spdlog.h>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "apps/command.h"
#include "apps/commands/commands.h"
#include "apps/exit_code.h"
#include "apps/fusion/interrupt.h"
#include "apps/options/number_checks.h"
#include "apps/options/reading_options.h"
#include "apps/output/progress.h"
#include "io/sequence/convert.h"
#include "io/sequence/open_sequence.h"

namespace felt::apps {
namespace {

struct Arguments {
  std::filesystem::path sequence, out;
  ReadingArguments reading;
  ConvertOptions options;
  CommonOptions common;
};

/// What the written sequence lacks, whatever else is printed: nothing else would ever tell.
void warn_of_losses(const ConvertResult& result, const ConvertOptions& options) {
  for (const std::string& what : result.left_out)
    spdlog::warn("{} left out: the layout {} has no place for that{}", what, options.layout,
                 options.renumber ? ", or other frame numbers" : "");
  if (result.touches_elsewhere > 0)
    spdlog::warn("{} touches left out: those of frames that are not written", result.touches_elsewhere);
  for (const auto& [reason, count] : result.skipped) spdlog::warn("{} frames left out: {}", count, reason);
  if (result.depth_out_of_range > 0)
    spdlog::warn("{} of {} measured pixels are too far for 16 bits, or too near for one, at this depth scale",
                 result.depth_out_of_range, result.depth_measured);
}

int run(const Arguments& a) {
  const auto reader = open_sequence(a.sequence, resolve(a.reading));
  for (const std::string& note : reader->info().notes) spdlog::warn("{}", note);
  ProgressBar progress("frames", reader->size(), !a.common.quiet);
  const InterruptGuard interrupt;
  bool stopped = false;
  const ConvertResult result = convert_sequence(*reader, a.out, a.options, [&](int64_t done) {
    progress.update(done);
    stopped = interrupt.requested();
    return !stopped;
  });
  if (stopped) {
    std::fprintf(stderr, "feltmap: interrupted: nothing is left at %s\n", a.out.c_str());
    return kInterrupted;
  }
  warn_of_losses(result, a.options);
  if (a.common.json) {
    const nlohmann::ordered_json json = {{"layout", a.options.layout},
                                         {"path", a.out.string()},
                                         {"written", result.written},
                                         {"skipped", result.skipped},
                                         {"depth_measured", result.depth_measured},
                                         {"depth_out_of_range", result.depth_out_of_range},
                                         {"touches_of_other_frames", result.touches_elsewhere},
                                         {"left_out", result.left_out}};
    print_json(json);
  } else if (!a.common.quiet) {
    std::printf("%lld frames written to %s (%s)\n", static_cast<long long>(result.written), a.out.c_str(),
                a.options.layout.c_str());
  }
  return kDone;
}

}  // namespace

void add_convert(CLI::App& app) {
  auto a = std::make_shared<Arguments>();
  CLI::App& command = add_command(app,
                                  {"convert", "Write a sequence in another layout",
                                   "feltmap convert rgbd_dataset_freiburg1_rpy --to generic --out recording\n"
                                   "feltmap convert scene0000_00.sens --to tum --out scene --frames ::5"},
                                  a->common, [a] { return run(*a); });
  command.add_option("SEQUENCE", a->sequence, "Folder of a recorded RGB-D sequence, or a .sens file")->required();
  command.add_option("--out", a->out, "Folder to make")->required();
  command.add_option("--to", a->options.layout, "Layout to write")
      ->check(CLI::IsMember(writable_layouts()))
      ->capture_default_str();
  command
      .add_option("--written-depth-scale", a->options.depth_scale,
                  "Stored depth units per metre in the result; 0: the layout's own, the only one in 7scenes and icl")
      ->check(at_least_zero())
      ->capture_default_str();
  command.add_flag("--renumber", a->options.renumber, "Number frames from 0");
  command.add_flag("--jpeg", a->options.jpeg_color, "Colour as JPEG instead of PNG");
  add_reading_options(command, a->reading);
}

}  // namespace felt::apps
