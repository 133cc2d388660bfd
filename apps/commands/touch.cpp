#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "apps/command.h"
#include "apps/commands/commands.h"
#include "apps/exit_code.h"
#include "apps/options/number_checks.h"
#include "apps/options/problems.h"
#include "apps/options/touch_options.h"
#include "apps/output/belief_report.h"
#include "apps/output/output_files.h"
#include "core/text.h"
#include "inference/decision.h"
#include "io/map_file/map_file.h"
#include "io/readings/touch_json.h"
#include "io/readings/touches.h"
#include "io/sequence/open_sequence.h"

namespace felt::apps {
namespace {

using json = nlohmann::ordered_json;

struct TouchOptions : CommonOptions {
  std::string map, at, property, file, out, undo, redo, properties, model = "material", projection = "kl";
  double value = 0, sigma = 0, stamp_s = 0;
  std::optional<double> rho;
  bool dry_run = false, list = false, force = false;
  RegionOptions region;
  // A touch given by a frame of the sequence and a pixel.
  std::string sequence, masks;
  std::optional<int64_t> frame;
  std::vector<double> pixel;
};

/// The sequence that touches name frames of.
struct OpenedSequence {
  std::unique_ptr<SequenceReader> reader;
  TouchedSequence touched;
};

std::optional<OpenedSequence> open_touched(const TouchOptions& options, const Map& map) {
  if (options.sequence.empty()) return std::nullopt;
  SequenceOptions reading;
  reading.instances_dir = options.masks;
  OpenedSequence opened{open_sequence(options.sequence, reading), {}};
  opened.touched = touched_sequence(*opened.reader);
  if (!map.frames.runs.empty() &&
      std::none_of(map.frames.runs.begin(), map.frames.runs.end(),
                   [&](const FusedFrames& run) { return run.sequence == opened.reader->info().fingerprint; }))
    spdlog::warn("{}: {} was made of other recordings: are its poses in the map's world frame?", options.sequence,
                 options.map);
  opened.touched.segments = options.masks.empty() ? SegmentSource::geometric : SegmentSource::instances;
  return opened;
}

/// The rows of the file, or the one touch that the command line gives by frame and pixel.
std::vector<RecordedTouch> recorded_touches(const TouchOptions& options) {
  if (!options.file.empty()) return read_touches(options.file);
  RecordedTouch touch;
  touch.frame = options.frame;
  touch.pixel = Eigen::Vector2d(options.pixel[0], options.pixel[1]);
  touch.property = options.property;
  touch.value = options.value;
  touch.sigma = options.sigma;
  return {touch};
}

/// Classes that a reading says nothing of although they were believed in.
std::vector<std::string> classes_without_prior(const Map& map, const TouchEffect& effect) {
  constexpr double kNotable = 0.05;
  const int property = *map.properties.index_of(map.touches.find(effect.id)->request.property);
  const ClassPriors priors = class_priors(map.properties[property], map.classes);
  std::vector<std::string> names;
  for (int c = 0; c < map.classes.size(); ++c)
    if (!priors.has_prior[size_t(c)] && effect.before.class_probability[size_t(c)] >= kNotable)
      names.push_back(map.classes.at_slot(c).name);
  return names;
}

json effect_json(const Map& map, const TouchEffect& effect, const RegionSettings& settings) {
  const Touch& touch = *map.touches.find(effect.id);
  const TouchRequest& r = touch.request;
  json out;
  out["id"] = id_text(effect.id);
  out["property"] = r.property;
  out["value"] = r.value;
  out["sigma"] = r.sigma;
  out["stamp"] = r.stamp_s;
  out["model"] = model_name(r.model);
  out["projection"] = projection_name(r.projection);
  out["contact"] = {{"point_m", point_json(r.point_m)},
                    {"surface_m", point_json(touch.surface_m)},
                    {"distance_m", (touch.surface_m - r.point_m).norm()}};
  out["region"] = summary_json(map, summarize(map, touch.region, settings));
  out["before"] = belief_json(map, effect.before, std::nullopt);
  out["after"] = belief_json(map, effect.after, std::nullopt);
  out["touches_of_a_part"] = touches_of_a_part(map, touch.region);
  out["without_prior"] = classes_without_prior(map, effect);
  out["relabelled_voxels"] = effect.relabelled;
  out["refused_voxels"] = effect.refused;
  out["surprise"] = effect.after.log_evidence[size_t(*map.properties.index_of(r.property))];
  out["tail_probability"] = effect.tail_probability;
  out["flags"] = {{"surprising", effect.flags.surprising},
                  {"multi_modal_before", effect.flags.multi_modal},
                  {"multi_modal_after", effect.modes.size() > 1},
                  {"not_one_material", effect.flags.not_one_material}};
  return out;
}

void print_effect(const Map& map, const TouchEffect& effect, const RegionSettings& settings) {
  const Touch& touch = *map.touches.find(effect.id);
  const RegionSummary region = summarize(map, touch.region, settings);
  std::printf("touch %s: %s %g on %zu voxels, %.3f m2\n", id_text(effect.id).c_str(), touch.request.property.c_str(),
              touch.request.value, region.voxels, region.area_m2);
  std::printf("  before: %s\n  after:  %s\n  %llu voxels changed their class\n",
              belief_text(map, effect.before).c_str(), belief_text(map, effect.after).c_str(),
              static_cast<unsigned long long>(effect.relabelled));
  if (effect.refused > 0)
    std::printf("  %llu voxels kept their state: no valid projection\n",
                static_cast<unsigned long long>(effect.refused));
  for (const std::string& warning : region.warnings) std::printf("  warning: %s\n", warning.c_str());
  if (const size_t of_a_part = touches_of_a_part(map, touch.region); of_a_part > 0)
    std::printf(
        "  %zu other touches reach into this region and cover no more than half of it: these figures of the region as "
        "a whole leave them out (feltmap query asks for a point)\n",
        of_a_part);
  if (const std::string silent = listed(classes_without_prior(map, effect)); !silent.empty())
    std::printf("  warning: no prior of %s for %s: the other classes share what was believed of them\n",
                touch.request.property.c_str(), silent.c_str());
  if (effect.flags.surprising) std::printf("  warning: no class explains this reading\n");
  if (effect.flags.not_one_material) std::printf("  warning: the region may hold more than one material\n");
  if (effect.modes.size() > 1) {
    std::printf("  warning: the property may be any of");
    for (const double mode : effect.modes) std::printf(" %.3g", mode);
    std::printf("\n");
  }
}

/// The journal, for people and (without region masks) for programs.
int list_touches(const TouchOptions& options) {
  const Map map = load_map(options.map);
  if (options.json) {
    json out;
    out["map"] = options.map;
    out["touches"] = json::parse(touch_journal_json(map.touches));
    for (size_t t = 0; t < map.touches.touches.size(); ++t)
      out["touches"][t]["voxels"] = map.touches.touches[t].region.voxels();
    print_json(out);
    return kDone;
  }
  const auto text = [&](const BeliefSummary& belief) {
    if (belief.class_probability.empty()) return std::string("?");
    const int best = most_probable_class(belief.class_probability);
    char numbers[64];
    snprintf(numbers, sizeof numbers, " %.2f, %.3g +- %.3g", belief.class_probability[size_t(best)], belief.mean,
             belief.sd);
    return map.classes.at_slot(best).name + numbers;
  };
  for (const Touch& touch : map.touches.touches) {
    const TouchRequest& r = touch.request;
    std::printf("%s  %12.6f  %s %g at (%.3f, %.3f, %.3f), %zu voxels, %s%s\n    %s -> %s\n", id_text(touch.id).c_str(),
                r.stamp_s, r.property.c_str(), r.value, touch.surface_m.x(), touch.surface_m.y(), touch.surface_m.z(),
                touch.region.voxels(), model_name(r.model), touch.undone ? ", undone" : "", text(touch.before).c_str(),
                text(touch.after).c_str());
  }
  if (map.touches.touches.empty()) std::printf("no touches\n");
  return kDone;
}

/// How many of these touches, which are the journal's newest, repeat one that it had before.
size_t repeated(const Map& map, const std::vector<TouchEffect>& effects) {
  std::set<uint64_t> still_to_come;
  for (const TouchEffect& effect : effects) still_to_come.insert(effect.id);
  size_t count = 0;
  for (const TouchEffect& effect : effects) {
    const TouchRequest& request = map.touches.find(effect.id)->request;
    count += std::any_of(map.touches.touches.begin(), map.touches.touches.end(), [&](const Touch& other) {
      return !still_to_come.contains(other.id) && !other.undone && same_reading(other.request, request);
    });
    still_to_come.erase(effect.id);
  }
  return count;
}

/// Effects of readings that the map has at another time: rows by frame number, read without the recording's stamps.
size_t repeated_at_another_time(const Map& map, const std::vector<TouchEffect>& effects) {
  std::set<uint64_t> added;
  for (const TouchEffect& effect : effects) added.insert(effect.id);
  return size_t(std::count_if(effects.begin(), effects.end(), [&](const TouchEffect& effect) {
    return std::any_of(map.touches.touches.begin(), map.touches.touches.end(), [&](const Touch& other) {
      TouchRequest then = map.touches.find(effect.id)->request;
      if (added.contains(other.id) || other.undone || then.stamp_s == other.request.stamp_s) return false;
      then.stamp_s = other.request.stamp_s;
      return same_reading(other.request, then);
    });
  }));
}

TouchRequest request_of(const TouchOptions& options, const Map& map) {
  TouchRequest request;
  request.stamp_s = options.stamp_s;
  if (!options.at.empty()) request.point_m = point_of(options.at);
  request.property = options.property;
  request.value = options.value;
  request.sigma = options.sigma;
  request.model = model_of_name(options.model);
  request.projection = projection_of_name(options.projection);
  if (options.rho) request.rho = *options.rho;
  request.region = options.region.resolved(map);
  return request;
}

int run_touch(const TouchOptions& options) {
  if (options.list) return list_touches(options);
  const std::string& out_file = options.out.empty() ? options.map : options.out;
  std::optional<MapWriting> writing;
  if (!options.dry_run) writing.emplace(out_file, options.force);
  Map map = load_map(options.map);
  use_properties(map, options.properties);
  const TouchRequest request = request_of(options, map);
  json out;
  out["map"] = options.map;
  if (!options.dry_run) out["out"] = out_file;
  out["dry_run"] = options.dry_run;
  int code = kDone;
  std::string said;
  std::vector<TouchEffect> effects, timed_by_frame;
  if (!options.undo.empty() || !options.redo.empty()) {
    const bool undo = !options.undo.empty();
    const uint64_t id = of_command_line([&] { return id_of_text(undo ? options.undo : options.redo); });
    undo ? undo_touch(map, id) : redo_touch(map, id);
    out[undo ? "undone" : "redone"] = id_text(id);
    said = "touch " + id_text(id) +
           (options.dry_run ? (undo ? ": would be undone" : ": would be redone")
            : undo          ? ": undone"
                            : ": redone");
  } else if (!options.file.empty() || options.frame) {
    const std::optional<OpenedSequence> opened = open_touched(options, map);
    const std::vector<RecordedTouch> touches = recorded_touches(options);
    for (const TouchOutcome& outcome :
         apply_recorded_touches(map, touches, request, opened ? &opened->touched : nullptr)) {
      const std::string where = options.file.empty() ? "frame " + std::to_string(*options.frame)
                                                     : options.file + ":" + std::to_string(outcome.touch.line);
      if (!outcome.refused.empty()) {
        code = kInputOutput;
        std::fprintf(stderr, "feltmap: error: %s: %s\n", where.c_str(), outcome.refused.c_str());
      } else {
        effects.push_back(*outcome.effect);
        if (!opened && !outcome.touch.stamp_s) timed_by_frame.push_back(*outcome.effect);
      }
    }
    if (touches.empty()) {
      code = kInputOutput;
      std::fprintf(stderr, "feltmap: error: %s\n",
                   describe_mismatch(options.file, "touches", "at least one", "none").c_str());
    }
    if (code != kDone) return code;  // all of them, or none
  } else {
    const std::optional<ViewMask> view = options.region.view();
    effects.push_back(apply_touch(map, resolve_touch(map, request, view ? &*view : nullptr)));
  }
  if (!options.dry_run && !options.out.empty())
    require_nothing_lost(options.out, map, LostTouches::warn, options.force);
  out["map_hash"] = options.dry_run ? map_hash(map) : save_map(map, out_file);
  if (const size_t twice = repeated(map, effects); twice > 0)
    spdlog::warn("{} of {} touches repeat one that counts already (reading, place and time): they {} twice", twice,
                 effects.size(), options.dry_run ? "would count" : "count");
  if (const size_t moved = repeated_at_another_time(map, timed_by_frame); moved > 0)
    spdlog::warn(
        "{} of {} touches say what one at another time says: numbers of frames are taken for seconds where no "
        "--sequence "
        "tells their times",
        moved, effects.size());
  // Only what is done is said to be.
  if (options.json) {
    if (!options.at.empty()) out.update(effect_json(map, effects.front(), request.region));
    if (!options.file.empty() || options.frame) {
      out["touches"] = json::array();
      for (const TouchEffect& effect : effects) out["touches"].push_back(effect_json(map, effect, request.region));
    }
    print_json(out);
  } else if (!options.quiet) {
    if (!said.empty()) std::printf("%s\n", said.c_str());
    for (const TouchEffect& effect : effects) print_effect(map, effect, request.region);
  }
  return kDone;
}

}  // namespace

void add_touch(CLI::App& app) {
  auto options = std::make_shared<TouchOptions>();
  CLI::App& command =
      add_command(app,
                  {"touch", "Record a reading of a property at a point and update the surface it speaks for",
                   "feltmap touch map.vdb --at 0.4,1.2,0.0 --property friction --value 0.139\n"
                   "feltmap touch map.vdb --file touches.csv --out touched.vdb\n"
                   "feltmap touch map.vdb --sequence recording --frame 120 --pixel 310,225 --region mask "
                   "--property friction --value 0.4\n"
                   "feltmap touch map.vdb --list\n"
                   "feltmap touch map.vdb --undo 3f0c5d8a91e2b764"},
                  *options, [options] { return run_touch(*options); });
  command.add_option("MAP", options->map, "Map file")->required();
  CLI::Option_group& what = *command.add_option_group("What to do");
  what.require_option(1);
  CLI::Option* at = what.add_option("--at", options->at, "World point of a reading, metres: x,y,z")->check(check_point);
  CLI::Option* file = what.add_option("--file", options->file, "Recorded touches (CSV): all of them, or none");
  CLI::Option* frame =
      what.add_option("--frame", options->frame, "Number of the frame of --sequence in which --pixel was touched");
  CLI::Option* undo = what.add_option("--undo", options->undo, "Take back the touch with this id");
  CLI::Option* redo = what.add_option("--redo", options->redo, "Let an undone touch count again");
  CLI::Option* list =
      what.add_flag("--list", options->list, "Show the journal: every touch with what was believed before and after");
  CLI::Option* property = command.add_option("--property", options->property, "What was measured");
  CLI::Option* value = command.add_option("--value", options->value, "The reading, in the property's unit");
  value->check(finite());
  CLI::Option* sequence = command.add_option("--sequence", options->sequence,
                                             "Recording that --frame, or rows of --file with u and v, speak of");
  CLI::Option* pixel = command.add_option("--pixel", options->pixel,
                                          "u,v of the touch; with --region mask its region is the segment there");
  pixel->delimiter(',')->expected(2)->allow_extra_args(false)->check(finite())->needs(frame);
  CLI::Option* masks =
      command.add_option("--masks", options->masks, "Folder of instance images or masks to take that segment from");
  masks->needs(sequence);
  CLI::Option* sigma = command.add_option("--sigma", options->sigma, "Standard deviation of the reading's noise");
  sigma->check(at_least_zero())->capture_default_str();
  CLI::Option* stamp = command.add_option("--stamp", options->stamp_s, "Time of the touch, seconds");
  stamp->check(finite())->capture_default_str();
  CLI::Option* model =
      command
          .add_option("--model", options->model, "material: the region is one material; mixture: each voxel its own")
          ->check(CLI::IsMember({"material", "mixture"}))
          ->capture_default_str();
  CLI::Option* projection = command.add_option("--projection", options->projection, "kl or published")
                                ->check(CLI::IsMember({"kl", "published"}))
                                ->capture_default_str();
  CLI::Option* rho =
      command.add_option("--rho", options->rho, "Correlation of readings within a region, instead of the property's")
          ->check(from_zero_to_below(1));
  CLI::Option* properties = command.add_option("--properties", options->properties,
                                               "Property table (YAML), instead of the one that the map may have");
  CLI::Option* out = command.add_option("--out", options->out, "Write here instead of in place");
  CLI::Option* force = command.add_flag("--force", options->force,
                                        "Replace a file that is no map of the same frames, or was made read-only");
  CLI::Option* dry_run = command.add_flag("--dry-run", options->dry_run, "Say what would change and write nothing");

  at->needs(property)->needs(value)->excludes(sequence);
  frame->needs(property)->needs(value)->needs(sequence)->needs(pixel)->excludes(stamp);
  // Rows have a property, value, noise and time of their own, a frame its recorded time.
  file->excludes(property)->excludes(value)->excludes(sigma)->excludes(stamp);
  std::vector<CLI::Option*> of_a_reading = options->region.add_to(command);
  of_a_reading.insert(of_a_reading.end(),
                      {property, value, sequence, pixel, masks, sigma, stamp, model, projection, rho, properties});
  // Their regions are segments of the recording's own frames.
  for (const char* of_another_view : {"--mask", "--intrinsics", "--pose"})
    for (CLI::Option* of_a_recording : {file, frame}) of_a_recording->excludes(command.get_option(of_another_view));
  for (CLI::Option* of_the_journal : {undo, redo, list})
    for (CLI::Option* option : of_a_reading) of_the_journal->excludes(option);
  list->excludes(out)->excludes(force)->excludes(dry_run);
}

}  // namespace felt::apps
