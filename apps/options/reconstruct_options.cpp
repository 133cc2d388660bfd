#include "apps/options/reconstruct_options.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "apps/command.h"
#include "apps/options/label_options.h"
#include "apps/options/number_checks.h"
#include "core/error.h"
#include "core/text.h"
#include "io/settings/reconstruct_config.h"

namespace felt::apps {
namespace {

bool positive(double value) { return std::isfinite(value) && value > 0; }

/// Beyond the truncation nothing says how far a voxel is from the surface, and free space would take labels.
void require_bands_that_fit(const ReconstructOptions& options) {
  const double voxel_m = options.voxel_size_m, truncation_m = options.truncation_m;
  if (!positive(voxel_m)) return;
  if (!(truncation_m >= voxel_m))
    throw ConfigError(describe_mismatch("--truncation", "band around the surface",
                                        "at least one voxel, " + number_text(voxel_m) + " m",
                                        number_text(truncation_m) + " m"));
  if (const auto& band = options.labels.band_vox; band && *band * voxel_m > truncation_m * (1 + 1e-6))
    throw ConfigError(describe_mismatch("--label-band", "voxels",
                                        "at most the truncation, " + number_text(truncation_m / voxel_m),
                                        number_text(*band)));
}

}  // namespace

void add_reconstruct_options(CLI::App& command, ReconstructArguments& a) {
  command.add_option("SEQUENCE", a.sequence, "Folder of a recorded RGB-D sequence, or a .sens file")->required();
  command.add_option("--out", a.out, "Folder for map.vdb, mesh.ply and report.json")->required();
  command.add_flag(
      "--force", a.overwrite,
      "Replace results that exist there, the map already by a checkpoint or by what a stopped run had fused");
  command
      .add_option("--checkpoint", a.checkpoint_every,
                  "Save the map every so many frames, so that no accident loses more than those; 0: at the end only")
      ->check(at_least_zero())
      ->option_text("N");
  command.add_flag("--resume", a.resume,
                   "Go on with the map in --out, however its run ended; the result is that of a run that never ended");
  command
      .add_option("--config", a.config,
                  "YAML file with settings of sequence, map, labels and perception; the command line wins")
      ->option_text("FILE");

  const char* map = "Map";
  command
      .add_option("--voxel-size", a.voxel_size_m,
                  "Edge of a voxel, metres [0.02; what suits the sensor for some layouts: docs/datasets.md]")
      ->group(map);
  command.add_option("--truncation", a.truncation, "Band around the surface: metres, or voxels as 4vox [4vox]")
      ->group(map);
  command.add_option("--min-depth", a.min_depth_m, "Nearer depth is not used, metres [0.1]")->group(map);
  command.add_option("--max-depth", a.max_depth_m, "Farther depth is not used, metres [4]")->group(map);
  const IntegrationConfig standard;
  add_choice(command, "--distance", a.distance, kDistanceNames,
             "What signed distance is measured along [" + name_of(kDistanceNames, standard.distance) + "]")
      ->group(map);
  add_choice(command, "--weight", a.weight, kWeightNames,
             "Weight of a measurement [" + name_of(kWeightNames, standard.weight) + "]")
      ->group(map);
  command
      .add_option("--max-weight", a.max_weight,
                  "Cap of a voxel's summed weight [" + number_text(standard.max_weight) + "]")
      ->group(map);
  add_switch(command, "--carve", a.carve, "Let free space seen later erase what stood there")->group(map);

  add_reading_options(command, a.reading);
  command.add_option("--properties", a.properties, "Property table (properties.yaml)")->group(kReadingGroup);
  CLI::Option* touches =
      command.add_option("--touches", a.touches, "Recorded touches (touches.csv), each at its stamp or frame");
  touches->group(kReadingGroup);
  command
      .add_flag("--no-touches", a.no_touches,
                "Leave out the touches that lie in the recording, as in a part whose merged map is touched later")
      ->excludes(touches)
      ->group(kReadingGroup);
  add_label_options(command, a.label_settings);
  add_perception_options(command, a.perception, "--segmenter");
}

ReconstructOptions resolve(const ReconstructArguments& a, int threads) {
  ReconstructOptions options;
  Problems problems;
  ReconstructConfig file;
  if (!a.config.empty()) problems.attempt([&] { file = read_reconstruct_config(a.config); });
  options.sequence = a.sequence, options.out = a.out, options.overwrite = a.overwrite;
  options.checkpoint_every = a.checkpoint_every.value_or(file.checkpoint_every.value_or(0));
  options.resume = a.resume;
  options.threads = threads > 0 ? threads : file.threads.value_or(0);

  SequenceOptions configured;
  configured.format = file.format.value_or("");
  configured.labels_dir = file.labels, configured.probs_dir = file.probs, configured.classes_file = file.classes;
  options.properties = a.properties.empty() ? file.properties : a.properties;
  options.no_touches = a.no_touches;
  if (!a.no_touches) options.touches = a.touches.empty() ? file.touches : a.touches;
  configured.intrinsics = file.intrinsics;
  configured.pose_convention = file.pose_convention;
  configured.depth_encoding = file.depth_encoding;
  configured.frames = file.frames.value_or(configured.frames);
  configured.depth_scale = file.depth_scale;
  configured.depth_is_ray_length = file.ray_length;
  configured.distortion = file.distortion;
  configured.T_body_camera = file.T_body_camera;
  configured.pose_stamp_offset = file.stamp_offset.value_or(0);
  configured.label_offset = file.label_offset.value_or(0);
  configured.bgr = file.bgr.value_or(false);
  configured.max_dt_s = file.max_dt_s.value_or(configured.max_dt_s);
  configured.read_color = file.color.value_or(true);
  options.reading = apps::resolve(a.reading, configured, problems);

  SequenceOptions& reading = options.reading;
  options.perception = overlaid(a.perception, file.perception);
  if (!options.perception.network.empty())
    problems.expect(reading.read_color, "--segmenter", "colour", "colour images to look at", "--no-color");

  options.voxel_size_given = a.voxel_size_m || file.voxel_size_m;
  options.max_depth_given = a.max_depth_m || file.max_depth_m;
  options.voxel_size_m = a.voxel_size_m.value_or(file.voxel_size_m.value_or(options.voxel_size_m));
  problems.expect(positive(options.voxel_size_m), "--voxel-size", "edge of a voxel in metres", "a number above 0",
                  number_text(options.voxel_size_m));
  // Of a file it was read before.
  options.truncation = a.truncation.empty() ? file.truncation.value_or("4vox") : a.truncation;
  if (problems.attempt_reading(
          [&] { options.truncation_m = parse_truncation(options.truncation, options.voxel_size_m, "--truncation"); }))
    problems.attempt([&] { require_bands_that_fit(options); });

  IntegrationConfig& fusion = options.fusion;
  const auto choose = [](float& value, const std::optional<double>& line, const std::optional<double>& from_file) {
    if (line || from_file) value = float(line ? *line : *from_file);
  };
  choose(fusion.min_depth_m, a.min_depth_m, file.min_depth_m);
  choose(fusion.max_depth_m, a.max_depth_m, file.max_depth_m);
  choose(fusion.max_weight, a.max_weight, file.max_weight);
  choose(fusion.dropoff_start_vox, std::nullopt, file.dropoff_start_vox);
  choose(fusion.color_band_vox, std::nullopt, file.color_band_vox);
  fusion.distance = a.distance.value_or(file.distance.value_or(fusion.distance));
  fusion.weight = a.weight.value_or(file.weight.value_or(fusion.weight));
  fusion.carve = a.carve.value_or(file.carve.value_or(fusion.carve));
  problems.expect(std::isfinite(fusion.min_depth_m) && fusion.min_depth_m >= 0, "--min-depth", "metres",
                  "a number of at least 0", number_text(fusion.min_depth_m));
  problems.expect(std::isfinite(fusion.max_depth_m) && fusion.max_depth_m > fusion.min_depth_m, "--max-depth", "metres",
                  "a number above the smallest depth, " + number_text(fusion.min_depth_m),
                  number_text(fusion.max_depth_m));
  problems.expect(fusion.max_weight >= 1, "--max-weight", "summed weight", "a number of at least 1",
                  number_text(fusion.max_weight));
  options.labels = overlaid(a.label_settings, file.label_settings);
  for (const std::string& problem : problems_of(options.labels)) problems.add(problem);
  fusion.labels = label_config(options.labels);
  problems.expect(!(fusion.labels.max_evidence > 0) || fusion.labels.evidence <= fusion.labels.max_evidence,
                  "--label-cap", "evidence of a voxel",
                  "at least that of one observation, " + number_text(fusion.labels.evidence),
                  number_text(fusion.labels.max_evidence));
  require_use(options.perception, {a.perception, "--segmenter", "--vote instances or --instances", a.config.string()},
              fusion.labels.instances, problems);
  reading.instances_dir = options.perception.masks;
  reading.read_instances = fusion.labels.instances || options.perception.votes_by(SegmentSource::instances);
  problems.throw_if_any();
  require_bands_that_fit(options);
  return options;
}

void adopt_sequence_defaults(const SequenceInfo& info, ReconstructOptions& options) {
  if (info.voxel_size_m > 0 && !options.voxel_size_given) {
    options.voxel_size_m = info.voxel_size_m;
    options.truncation_m = parse_truncation(options.truncation, options.voxel_size_m, "--truncation");
    require_bands_that_fit(options);
  }
  if (info.max_depth_m > 0 && !options.max_depth_given) options.fusion.max_depth_m = float(info.max_depth_m);
}

nlohmann::ordered_json to_json(const ReconstructOptions& options) {
  const SequenceOptions& reading = options.reading;
  const IntegrationConfig& fusion = options.fusion;
  nlohmann::ordered_json json;
  json["sequence"] = options.sequence.string();
  if (!reading.format.empty()) json["format"] = reading.format;
  json["frames"] = to_string(reading.frames);
  if (reading.intrinsics) {
    const Intrinsics& k = *reading.intrinsics;
    json["intrinsics"] = {k.fx, k.fy, k.cx, k.cy};
  }
  if (reading.depth_scale) json["depth_scale"] = *reading.depth_scale;
  if (reading.pose_convention) json["pose_convention"] = to_string(*reading.pose_convention);
  if (reading.depth_encoding) json["depth_encoding"] = to_string(*reading.depth_encoding);
  if (reading.distortion) {
    const Distortion& d = *reading.distortion;
    json["distortion"] = {d.k1, d.k2, d.p1, d.p2, d.k3};
  }
  if (reading.T_body_camera)
    for (int row = 0; row < 4; ++row)
      for (int column = 0; column < 4; ++column)
        json["T_body_camera"].push_back(reading.T_body_camera->matrix()(row, column));
  if (reading.depth_is_ray_length) json["ray_length"] = *reading.depth_is_ray_length;
  if (!reading.labels_dir.empty()) json["labels"] = reading.labels_dir.string();
  if (!reading.probs_dir.empty()) json["probs"] = reading.probs_dir.string();
  if (!reading.classes_file.empty()) json["classes"] = reading.classes_file.string();
  if (!options.properties.empty()) json["properties"] = options.properties.string();
  if (!options.touches.empty()) json["touches"] = options.touches.string();
  if (options.no_touches) json["no_touches"] = true;
  json["max_dt_s"] = reading.max_dt_s;
  if (reading.pose_stamp_offset != 0) json["stamp_offset"] = reading.pose_stamp_offset;
  if (reading.label_offset != 0) json["label_offset"] = reading.label_offset;
  if (reading.bgr) json["bgr"] = true;
  json["color"] = reading.read_color;
  if (options.perception.active() || !options.perception.masks.empty())
    json["perception"] = to_json(options.perception);
  json["voxel_size_m"] = options.voxel_size_m;
  json["truncation_m"] = options.truncation_m;
  json["min_depth_m"] = short_decimal(fusion.min_depth_m);
  json["max_depth_m"] = short_decimal(fusion.max_depth_m);
  json["distance"] = name_of(kDistanceNames, fusion.distance);
  json["weight"] = name_of(kWeightNames, fusion.weight);
  json["max_weight"] = short_decimal(fusion.max_weight);
  json["dropoff_start_vox"] = short_decimal(fusion.dropoff_start_vox);
  json["color_band_vox"] = short_decimal(fusion.color_band_vox);
  json["carve"] = fusion.carve;
  add_to_json(options.labels, fusion.labels, json);
  return json;
}

}  // namespace felt::apps
