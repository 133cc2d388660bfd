#include <algorithm>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>

#include "apps/command.h"
#include "apps/commands/commands.h"
#include "apps/exit_code.h"
#include "apps/options/reading_options.h"
#include "apps/output/output_files.h"
#include "apps/output/progress.h"
#include "core/error.h"
#include "io/files/atomic_file.h"
#include "io/sequence/open_sequence.h"
#include "io/sequence/skip_reasons.h"
#include "io/tables/confusion_file.h"
#include "mapping/labels/label_calibration.h"

namespace felt::apps {
namespace {
namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct CalibrateOptions : CommonOptions {
  fs::path sequence, labels, probs, classes, reference, out;
  std::string format, frames;
  bool overwrite = false;
};

/// The reference as a sequence: one of its own, or label images of the same recording.
std::unique_ptr<SequenceReader> open_reference(const CalibrateOptions& o, SequenceOptions reading) {
  reading.probs_dir.clear();
  reading.labels_dir.clear();
  try {
    return open_sequence(o.reference, reading);
  } catch (const FormatError& as_sequence) {
    reading.labels_dir = o.reference;  // no layout: a folder of images
    try {
      return open_sequence(o.sequence, reading);
    } catch (const Error&) {
      throw as_sequence;
    }
  }
}

/// Ids of the reference's table as those of the predictions', by name.
std::vector<uint16_t> translation(const ClassTable& from, const ClassTable& to) {
  std::vector<uint16_t> ids(0x10000, kNoLabel);
  for (const ClassInfo& theirs : from.classes())
    for (const ClassInfo& ours : to.classes())
      if (ours.name == theirs.name && !theirs.ignore) ids[theirs.id] = ours.id;
  return ids;
}

struct Learned {
  ConfusionCounts even, odd;  ///< of every other frame
  int64_t frames = 0;
  std::map<std::string, int64_t> skipped = {};
};

Learned learn(const CalibrateOptions& o, const SequenceReader& predicted, const SequenceReader& reference) {
  const ClassTable& classes = predicted.info().classes;
  Learned learned{ConfusionCounts(classes.size()), ConfusionCounts(classes.size())};
  const bool translated = !reference.info().classes.empty() && !(reference.info().classes == classes);
  const std::vector<uint16_t> id_of =
      translated ? translation(reference.info().classes, classes) : std::vector<uint16_t>();
  // Frames of both are read side by side: in each the numbers ascend.
  ProgressBar progress("frames", predicted.size(), !o.quiet);
  int64_t r = 0;
  for (int64_t i = 0; i < predicted.size(); ++i) {
    progress.update(i + 1);
    ReadResult result = predicted.read(i);
    const auto* frame = std::get_if<Frame>(&result);
    if (frame == nullptr) {
      ++learned.skipped[std::get<SkippedFrame>(result).reason];
      continue;
    }
    if (frame->labels.empty() && frame->probabilities.empty()) {
      ++learned.skipped["no labels"];
      continue;
    }
    ReadResult truth = SkippedFrame{-1, "no true labels", ""};
    while (r < reference.size() && reference.name(r).index < frame->index) ++r;
    if (r < reference.size() && reference.name(r).index == frame->index) truth = reference.read(r++);
    auto* true_frame = std::get_if<Frame>(&truth);
    if (true_frame == nullptr || true_frame->labels.empty()) {
      ++learned.skipped["no true labels"];
      continue;
    }
    if (translated)
      for (uint16_t& id : true_frame->labels) id = id_of[id];
    count_confusion(*frame, true_frame->labels, classes, learned.frames % 2 == 0 ? learned.even : learned.odd);
    ++learned.frames;
  }
  return learned;
}

Json largest_confusions(const ConfusionCounts& counts, const ClassTable& classes) {
  struct Pair {
    int truth, predicted;
    double pixels;
  };
  std::vector<Pair> pairs;
  for (int i = 0; i < counts.k; ++i)
    for (int j = 0; j < counts.k; ++j)
      if (i != j && counts.at(i, j) > 0) pairs.push_back({i, j, counts.at(i, j)});
  std::stable_sort(pairs.begin(), pairs.end(), [](const Pair& a, const Pair& b) { return a.pixels > b.pixels; });
  Json list = Json::array();
  for (size_t i = 0; i < std::min<size_t>(5, pairs.size()); ++i)
    list.push_back({{"true", classes.at_slot(pairs[i].truth).name},
                    {"predicted", classes.at_slot(pairs[i].predicted).name},
                    {"share", pairs[i].pixels / counts.total()}});
  return list;
}

int run(const CalibrateOptions& o) {
  require_no_file(o.out, o.overwrite);
  ReadingArguments arguments;
  arguments.format = o.format, arguments.frames = o.frames;
  arguments.labels = o.labels, arguments.probs = o.probs, arguments.classes = o.classes;
  SequenceOptions reading = resolve(arguments);
  reading.read_color = false, reading.read_instances = false;
  const auto predicted = open_sequence(o.sequence, reading);
  const ClassTable& classes = predicted->info().classes;
  if (classes.empty())
    throw ConfigError(
        describe_mismatch(o.sequence.string(), "class table", "one in the sequence or by --classes", "none"));
  const Learned learned = learn(o, *predicted, *open_reference(o, reading));
  ConfusionCounts all = learned.even;
  all += learned.odd;
  if (!(all.total() > 0)) {
    const std::string frames = std::to_string(predicted->size()) + " frames", reasons = skipped_text(learned.skipped);
    throw FormatError(describe_mismatch(o.reference.string(), "true labels", "pixels with a predicted and a true class",
                                        reasons.empty() ? frames : frames + ", " + reasons));
  }
  const ConfusionScores forward = score_confusion(learned.even, learned.odd),
                        backward = score_confusion(learned.odd, learned.even);
  const auto mean = [&](double ConfusionScores::*score) {
    return learned.frames < 2 ? 0 : (forward.*score + backward.*score) / 2;
  };
  Json report;
  report["out"] = o.out.string();
  report["frames"] = learned.frames;
  report["skipped"] = learned.skipped;
  report["pixels"] = all.total();
  report["pixels_without_prediction"] = all.without_prediction;
  report["pixels_without_truth"] = all.without_truth;
  report["accuracy"] = all.correct() / all.total();
  if (learned.frames >= 2)
    report["held_out"] = {{"ece", mean(&ConfusionScores::ece)},
                          {"brier", mean(&ConfusionScores::brier)},
                          {"nll", mean(&ConfusionScores::nll)},
                          {"definition", "P(true | predicted) learned on every other frame, scored on the others"}};
  report["largest_confusions"] = largest_confusions(all, classes);
  const std::string extension = o.out.extension().string();
  const std::string comment = "How often each true class was labelled as each class, in pixels of " +
                              std::to_string(learned.frames) + " frames (feltmap calibrate-labels).";
  write_file_atomically(o.out, extension == ".csv" ? confusion_counts_csv(all.pixels, classes)
                                                   : confusion_counts_yaml(all.pixels, classes, comment));
  if (o.json) {
    print_json(report);
  } else if (!o.quiet) {
    std::printf("%lld frames, %.3g pixels: %.1f %% labelled right\n", static_cast<long long>(learned.frames),
                all.total(), 100 * all.correct() / all.total());
    for (const auto& [reason, count] : learned.skipped)
      std::printf("  skipped %lld: %s\n", static_cast<long long>(count), reason.c_str());
    for (const Json& pair : report["largest_confusions"])
      std::printf("  %s taken for %s: %.1f %% of all\n", pair["true"].get<std::string>().c_str(),
                  pair["predicted"].get<std::string>().c_str(), 100 * pair["share"].get<double>());
    if (learned.frames >= 2)
      std::printf("  learned on one half, on the other: ECE %.3f, Brier %.3f, NLL %.3f\n", mean(&ConfusionScores::ece),
                  mean(&ConfusionScores::brier), mean(&ConfusionScores::nll));
    std::printf("  %s\n", o.out.c_str());
  }
  return kDone;
}

}  // namespace

void add_calibrate_labels(CLI::App& app) {
  auto o = std::make_shared<CalibrateOptions>();
  CLI::App& command =
      add_command(app,
                  {"calibrate-labels", "Learn what a network takes for what, from frames whose true labels are known",
                   "feltmap calibrate-labels recording --labels pred --reference-labels truth --out confusion.yaml\n"
                   "feltmap reconstruct recording --labels pred --confusion confusion.yaml --out result"},
                  *o, [o] { return run(*o); });
  command.add_option("SEQUENCE", o->sequence, "Recording with predicted labels")->required();
  command.add_option("--reference-labels", o->reference, "True labels: a folder of images, or a sequence")->required();
  command.add_option("--out", o->out, "Counts of pixels, as .yaml or .csv")->required();
  command.add_option("--labels", o->labels, "Folder of predicted labels, where they are not the sequence's own");
  command.add_option("--probs", o->probs, "Folder of predicted probabilities");
  command.add_option("--classes", o->classes, "Class table of the predicted labels");
  command.add_option("--frames", o->frames, "Frames a:b:step in recorded order, counted from 0");
  command.add_option("--format", o->format, "Layout of the sequence");
  command.add_flag("--force", o->overwrite, "Replace a file that exists");
}

}  // namespace felt::apps
