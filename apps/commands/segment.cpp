#include <algorithm>
#include <cstdio>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "apps/command.h"
#include "apps/commands/commands.h"
#include "apps/exit_code.h"
#include "apps/fusion/interrupt.h"
#include "apps/options/perception_options.h"
#include "apps/options/problems.h"
#include "apps/options/reading_options.h"
#include "apps/output/output_files.h"
#include "apps/output/progress.h"
#include "core/error.h"
#include "core/stopwatch.h"
#include "io/files/atomic_file.h"
#include "io/files/json_text.h"
#include "io/files/text_input.h"
#include "io/images/label_images.h"
#include "io/sequence/decode_ahead.h"
#include "io/sequence/open_sequence.h"
#include "io/tables/class_table_file.h"

namespace felt::apps {
namespace {
namespace fs = std::filesystem;
using json = nlohmann::ordered_json;

constexpr const char* kStateName = "segment.json";
constexpr const char* kClassesName = "classes.yaml";

struct SegmentOptions : CommonOptions {
  fs::path sequence, out, classes, labels, probs;
  std::string format, frames;
  PerceptionSettings perception;
  bool overwrite = false;
};

struct SegmentRecord {
  int64_t read = 0, written = 0, present = 0;
  std::map<std::string, int64_t> skipped;  ///< by reason
  double network_s = 0, vote_s = 0, decode_s = 0, write_s = 0, total_s = 0;
  bool interrupted = false;
};

/// Files that one frame becomes.
struct OutputNames {
  fs::path folder;
  bool probabilities;
  fs::path of(int64_t frame) const {
    char name[32];
    std::snprintf(name, sizeof name, "%06lld.png", static_cast<long long>(frame));
    return folder / (probabilities ? "probs" : "labels") / name;
  }
};

/// What the images in the folder depend on: they may be added to only where it is the same.
json state_of(const SegmentOptions& options, const SequenceInfo& sequence) {
  json state;
  std::error_code ignored;
  state["sequence"] = fs::weakly_canonical(options.sequence, ignored).string();
  state["recording"] = sequence.fingerprint;
  state["settings"] = to_json(options.perception);
  const bool with_network = !options.perception.network.empty();
  if (with_network) state["net"] = read_whole_file(options.perception.network);
  if (!with_network || !options.perception.masks.empty()) state["labels"] = sequence.reading.at("label images");
  state["classes"] = class_table_yaml(sequence.classes);
  return state;
}

/// What --force may not delete: the images that are read, and whatever else no run of segment wrote.
void require_own_images(const SegmentOptions& options) {
  std::error_code ignored;
  if (fs::equivalent(options.sequence, options.out, ignored))
    throw ConfigError(describe_mismatch(options.out.string(), "output", "a folder of its own", "the recording"));
  for (const char* folder : {"labels", "probs"}) {
    const fs::path images = options.out / folder;
    for (const fs::path& read : {options.labels, options.probs, fs::path(options.perception.masks)})
      if (!read.empty() && fs::equivalent(read, images, ignored))
        throw ConfigError(describe_mismatch(images.string(), "output", "a folder of its own", "images that are read"));
    if (!fs::exists(options.out / kStateName) && fs::exists(images) && !fs::is_empty(images))
      throw IoError(describe_mismatch(images.string(), "output exists", "images of an earlier run of segment",
                                      "others, which would be deleted"));
  }
}

/// Whether nothing lies in the folder, or what a run left that was stopped before its first image.
bool as_good_as_empty(const fs::path& folder) {
  return std::all_of(fs::directory_iterator(folder), fs::directory_iterator(), [](const fs::directory_entry& entry) {
    const std::string name = entry.path().filename().string();
    return (name == "labels" || name == "probs") && entry.is_directory() && fs::is_empty(entry.path());
  });
}

/// Makes the output folder ready: a new one gets its state and class table, one of an earlier run with the same
/// settings is gone on with, and any other is refused unless `overwrite`.
void prepare(const SegmentOptions& options, const OutputNames& names, const SequenceInfo& sequence) {
  prepare_output_folder(options.out);
  const fs::path file = options.out / kStateName;
  remove_abandoned_parts(file);
  const std::string state = json_text(state_of(options, sequence), 2) + "\n";
  const bool has_state = fs::exists(file), goes_on = has_state && read_whole_file(file) == state;
  if (has_state && !goes_on && !options.overwrite)
    throw ConfigError(describe_mismatch(options.out.string(), "output exists",
                                        "images of the same sequence, network and settings to go on with, or --force",
                                        "others (" + std::string(kStateName) + " says which)"));
  if (!has_state && !options.overwrite && !as_good_as_empty(options.out))
    throw IoError(describe_mismatch(options.out.string(), "output exists", "an empty folder, or --force",
                                    "a folder that no earlier run of segment made"));
  require_own_images(options);
  for (const char* folder : {"labels", "probs"}) {
    if (!goes_on || options.overwrite) fs::remove_all(options.out / folder);
    if (names.probabilities == (std::string(folder) == "probs")) fs::create_directory(options.out / folder);
  }
  // The state comes first: a folder that has it is one of segment, wherever this stops.
  if (!goes_on) write_file_atomically(file, state);
  if (!fs::exists(options.out / kClassesName) || !goes_on)
    write_file_atomically(options.out / kClassesName, class_table_yaml(sequence.classes));
}

SegmentRecord segment_frames(const SequenceReader& sequence, const Perception& perception, const OutputNames& names,
                             const CommonOptions& common) {
  const InterruptGuard interrupt;
  ProgressBar progress("frames", sequence.size(), !common.quiet);
  DecodeAhead frames(sequence, {.threads = common.thread_count()});
  SegmentRecord record;
  while (std::optional<ReadResult> next = frames.next()) {
    ++record.read;
    if (const auto* skipped = std::get_if<SkippedFrame>(&*next)) {
      skipped->reason == kAlreadyThere ? ++record.present : ++record.skipped[skipped->reason];
    } else if (const Frame& frame = std::get<Frame>(*next); frame.labels.empty() && frame.probabilities.empty()) {
      ++record.skipped["no labels"];
    } else {
      const Stopwatch watch;
      write_file_atomically(names.of(frame.index), names.probabilities
                                                       ? encode_probabilities(frame.probabilities)
                                                       : encode_labels(frame.labels, sequence.info().classes));
      record.write_s += watch.seconds();
      ++record.written;
    }
    record.network_s = perception.times->network_s();
    record.vote_s = perception.times->vote_s();
    record.decode_s = frames.decode_s() - record.network_s - record.vote_s;
    progress.update(record.read, shares_text({{"network", record.network_s},
                                              {"vote", record.vote_s},
                                              {"decode", record.decode_s},
                                              {"write", record.write_s}}));
    record.interrupted = interrupt.requested();
    if (record.interrupted) break;
  }
  return record;
}

int run_segment(SegmentOptions& options) {
  const Stopwatch watch;
  const bool by_instances = options.perception.votes_by(SegmentSource::instances);
  Problems problems;
  if (!options.perception.active())
    problems.add_of_usage(describe_mismatch("segment", "--net or --vote", "what makes or changes labels", "neither"));
  require_use(options.perception, {options.perception, "--net", "--vote instances", ""}, false, problems);
  problems.throw_if_any();
  ReadingArguments arguments;
  arguments.format = options.format, arguments.frames = options.frames;
  arguments.labels = options.labels, arguments.probs = options.probs, arguments.classes = options.classes;
  SequenceOptions reading = resolve(arguments);
  reading.instances_dir = options.perception.masks;
  reading.read_instances = by_instances;
  auto sequence = open_sequence(options.sequence, reading);
  Perception perception = perception_of(options.perception, sequence->info().classes);
  // Recorded probabilities stay probabilities.
  const bool probabilities =
      options.perception.network.empty() ? sequence->info().has_probabilities : perception.top > 0;
  const OutputNames names{options.out, probabilities};
  perception.skip = [names](int64_t frame) { return fs::exists(names.of(frame)); };
  sequence = perceived_sequence(std::move(sequence), perception);
  prepare(options, names, sequence->info());
  SegmentRecord record = segment_frames(*sequence, perception, names, options);
  record.total_s = watch.seconds();

  const std::string kind = names.probabilities ? "probs" : "labels";
  if (options.json) {
    json skipped = json::object();
    for (const auto& [reason, count] : record.skipped) skipped[reason] = count;
    print_json(json{
        {"frames",
         {{"read", record.read}, {"written", record.written}, {"already_there", record.present}, {"skipped", skipped}}},
        {kind, (options.out / kind).string()},
        {"classes", (options.out / kClassesName).string()},
        {"time_s",
         {{"total", record.total_s},
          {"network", record.network_s},
          {"vote", record.vote_s},
          {"decode", record.decode_s},
          {"write", record.write_s}}},
        {"threads", options.thread_count()}});
  } else if (!options.quiet) {
    std::printf("%lld frames segmented in %.2f s, %lld were there: %s\n", static_cast<long long>(record.written),
                record.total_s, static_cast<long long>(record.present), (options.out / kind).c_str());
    for (const auto& [reason, count] : record.skipped)
      std::printf("  skipped %lld: %s\n", static_cast<long long>(count), reason.c_str());
  }
  if (record.interrupted) {
    std::fprintf(stderr, "feltmap: interrupted after %lld of %lld frames: the same command goes on from there\n",
                 static_cast<long long>(record.read), static_cast<long long>(sequence->size()));
    return kInterrupted;
  }
  if (record.written + record.present == 0)
    throw FormatError(describe_mismatch(options.sequence.string(), "frames", "at least one that can be segmented",
                                        std::to_string(record.read) + " skipped"));
  return kDone;
}

}  // namespace

void add_segment(CLI::App& app) {
  auto options = std::make_shared<SegmentOptions>();
  CLI::App& command = add_command(
      app,
      {"segment", "Label the colour images of a sequence with a segmentation network",
       "feltmap segment recording --net net.yaml --out segmented\n"
       "feltmap segment recording --net net.yaml --top 3 --out segmented\n"
       "feltmap reconstruct recording --labels segmented/labels --classes segmented/classes.yaml --out map"},
      *options, [options] { return run_segment(*options); });
  command.add_option("SEQUENCE", options->sequence, "Folder of a recorded RGB-D sequence, or a .sens file")->required();
  command.add_option("--out", options->out, "Folder for labels/ or probs/ and classes.yaml; images there are kept")
      ->required();
  command.add_option("--classes", options->classes, "Class table (classes.yaml) that the network's classes map onto");
  command.add_option("--labels", options->labels, "Without --net: folder of label images whose segments vote");
  command.add_option("--probs", options->probs, "Without --net: folder of class probability images that are pooled");
  command.add_option("--format", options->format, "Layout: 7scenes, tum, replica, generic, ...");
  command.add_option("--frames", options->frames, "Frames a:b:step in recorded order, counted from 0");
  command.add_flag("--force", options->overwrite, "Replace images that were made with other settings");
  add_perception_options(command, options->perception, "--net");
}

}  // namespace felt::apps
