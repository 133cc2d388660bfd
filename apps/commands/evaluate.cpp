#include <cstdio>
#include <memory>
#include <optional>
#include <set>

#include "apps/command.h"
#include "apps/commands/commands.h"
#include "apps/exit_code.h"
#include "apps/options/camera_options.h"
#include "apps/options/number_checks.h"
#include "apps/options/problems.h"
#include "apps/options/reading_options.h"
#include "apps/options/run_settings.h"
#include "apps/options/touch_options.h"
#include "apps/output/evaluation_report.h"
#include "apps/output/output_files.h"
#include "apps/output/progress.h"
#include "core/error.h"
#include "io/map_file/map_file.h"
#include "io/meshes/mesh_io.h"
#include "io/pictures/reliability_plot.h"
#include "io/readings/touches.h"
#include "io/sequence/open_sequence.h"
#include "io/sequence/skip_reasons.h"
#include "io/tables/class_table_file.h"
#include "mapping/surface/marching_cubes.h"

namespace felt::apps {
namespace {
namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct EvaluateCommand {
  CommonOptions common;
  CameraOptions camera;
  std::string input, reference_mesh, trajectory;
  std::string reference_labels, labels, classes, format, frames, label_name, reliability;
  std::string reference_readings, properties;
  bool class_images = false;
  GeometryOptions geometry;
  ObservingCameras cameras;
  SequenceOptions reading;  ///< how a sequence is read, be it for its labels or for its poses
  CLI::Option *intrinsics = nullptr, *size = nullptr, *min_depth = nullptr, *max_depth = nullptr;
  std::vector<CLI::Option*> of_surfaces;
};

/// What is evaluated: a map, or a mesh, or the map's mesh where geometry is asked for.
struct Evaluated {
  std::optional<Map> map;
  std::optional<TriangleMesh> mesh;
};

SequenceOptions reading_of(const EvaluateCommand& command) {
  ReadingArguments arguments;
  arguments.format = command.format, arguments.frames = command.frames;
  if (command.intrinsics->count() > 0) arguments.intrinsics = command.camera.intrinsics;
  SequenceOptions options = resolve(arguments);
  options.read_color = options.read_instances = false;
  return options;
}

std::unique_ptr<SequenceReader> open_reference(const EvaluateCommand& command, const std::string& path) {
  SequenceOptions options = command.reading;
  options.labels_dir = command.labels;
  options.classes_file = command.classes;
  return open_sequence(path, options);
}

void read_cameras(EvaluateCommand& command) {
  Viewpoints views = read_viewpoints(command.trajectory, command.camera, command.reading);
  command.cameras.camera = views.camera;
  command.cameras.T_world_camera = std::move(views.T_world_camera);
}

/// The evaluated mesh may carry the labels under the reference's name or, as ours do, at its vertices.
std::string label_name_in(const TriangleMesh& mesh, const std::string& label_name) {
  return TriangleMesh::find(mesh.triangle_scalars, label_name) != nullptr ? label_name : kVertexLabels;
}

/// Scores of a sequence's labels with the classes they are over.
struct SequenceLabels {
  LabelScores scores;
  ClassTable classes;
  std::map<std::string, int64_t> skipped;  ///< frames by reason
};

SequenceLabels evaluate_sequence_labels(const EvaluateCommand& command, const Evaluated& evaluated) {
  const auto sequence = open_reference(command, command.reference_labels);
  const ClassTable& truth = sequence->info().classes;
  const ClassTable& classes = evaluated.map ? evaluated.map->classes : truth;
  if (classes.empty())
    throw ConfigError(evaluated.map ? describe_mismatch(command.input, "classes", "a map with classes", "none")
                                    : describe_mismatch(command.reference_labels, "class table",
                                                        "one in the sequence, or --classes", "none"));
  const TruthClasses slots(classes, truth);
  std::optional<RayCaster> caster;
  std::optional<VoxelBeliefs> beliefs;
  std::optional<LabelledMesh> mesh;
  if (evaluated.map)
    caster.emplace(*evaluated.map), beliefs.emplace(*evaluated.map);
  else
    mesh.emplace(*evaluated.mesh, label_name_in(*evaluated.mesh, command.label_name), command.input);
  SequenceLabels result{LabelScores(classes.size()), classes, {}};
  ProgressBar progress("frames", sequence->size(), !command.common.quiet);
  for (int64_t i = 0; i < sequence->size(); ++i) {
    progress.update(i);
    const ReadResult read = sequence->read(i);
    if (const auto* skipped = std::get_if<SkippedFrame>(&read)) {
      ++result.skipped[skipped->reason];
      continue;
    }
    const Frame& frame = std::get<Frame>(read);
    if (frame.labels.empty()) {
      ++result.skipped["no labels"];
      continue;
    }
    const double max_depth_m = command.cameras.max_depth_m;
    // Through a hole a ray may meet something far behind the true surface: that is then what is predicted.
    const double farthest_m = 2 * max_depth_m;
    const LabelPrediction prediction =
        evaluated.map ? predict_labels(*caster, *beliefs, frame.camera, frame.T_world_camera, farthest_m)
                      : predict_labels(*mesh, slots, frame.camera, frame.T_world_camera, farthest_m);
    add_view(result.scores, prediction, {&frame.labels, &frame.depth_m, command.cameras.min_depth_m, max_depth_m},
             slots, command.class_images);
  }
  if (result.scores.views == 0) {
    const std::string reasons = skipped_text(result.skipped);
    throw FormatError(describe_mismatch(command.reference_labels, "frames", "at least one with labels",
                                        reasons.empty() ? "none" : "none: " + reasons));
  }
  return result;
}

LabelScores evaluate_mesh_labels(const EvaluateCommand& command, const Evaluated& evaluated,
                                 const TriangleMesh& reference, ClassTable& classes) {
  const ClassTable truth = command.classes.empty() ? ClassTable() : read_class_table(command.classes);
  classes = evaluated.map ? evaluated.map->classes : truth;
  if (classes.empty())
    throw ConfigError(describe_mismatch("evaluate --label-name", "classes",
                                        evaluated.map ? "a map with classes" : "--classes FILE", "none"));
  const TruthClasses slots(classes, truth);
  const LabelledMesh labelled(reference, command.label_name, command.reference_mesh);
  const ObservingCameras* cameras = command.trajectory.empty() ? nullptr : &command.cameras;
  LabelScores scores(classes.size());
  if (evaluated.map)
    add_surface(scores, *evaluated.map, VoxelBeliefs(*evaluated.map), labelled, slots, command.geometry, cameras);
  else
    add_surface(scores,
                LabelledMesh(*evaluated.mesh, label_name_in(*evaluated.mesh, command.label_name), command.input), slots,
                labelled, slots, command.geometry, cameras);
  return scores;
}

/// How good forecasts of readings are, by property, and why some readings had none.
struct ReadingScores {
  std::map<std::string, PropertyScores> of_property;
  std::map<std::string, int64_t> refused;
};

/// Forecasts of the map at the places of recorded readings that it has not been given.
ReadingScores evaluate_readings(const EvaluateCommand& command, Map& map) {
  use_properties(map, command.properties);
  const VoxelBeliefs beliefs(map);
  RegionSettings settings;
  settings.min_weight = least_observed_weight(map);
  ReadingScores scores;
  for (const RecordedTouch& reading : read_touches(command.reference_readings)) {
    const auto property = map.properties.index_of(reading.property);
    if (!property || !reading.point_m) {
      ++scores.refused[property ? "no point in the world" : "unknown property"];
      continue;
    }
    try {
      const Index3 voxel = find_contact(map, *reading.point_m, settings).voxel;
      const StudentTMixture next =
          beliefs.next_reading({map.store.find(block_of_voxel(voxel)), uint16_t(offset_in_block(voxel))}, *property);
      if (next.weight.empty())
        ++scores.refused["no class with a prior"];
      else
        scores.of_property[reading.property].add(reading.value, next);
    } catch (const TouchError&) {
      ++scores.refused["not on a labelled surface"];
    }
  }
  return scores;
}

Json readings_json(const ReadingScores& scores) {
  Json json = Json::object();
  for (const auto& [name, s] : scores.of_property) json[name] = property_json(s);
  if (!scores.refused.empty()) json["refused"] = scores.refused;
  return json;
}

void print_geometry(const GeometryScores& s, double threshold_m) {
  std::printf("accuracy            mean %.5f m   median %.5f m   rms %.5f m\n", s.accuracy_mean_m, s.accuracy_median_m,
              s.accuracy_rms_m);
  std::printf("completion          mean %.5f m   median %.5f m   (%.1f %% of the reference counted)\n",
              s.completion_mean_m, s.completion_median_m, 100 * s.reference_seen);
  std::printf("within %.3f m      precision %.4f   recall %.4f   F %.4f\n", threshold_m, s.precision, s.recall,
              s.f_score);
  std::printf("normal consistency  %.4f\n", s.normal_consistency);
}

void print_labels(const LabelScores& s, const char* of) {
  std::printf("labels of %-9s accuracy %.4f   mean IoU %.4f   of %llu %s\n", of, s.counts.pixel_accuracy(),
              s.counts.mean_iou(), static_cast<unsigned long long>(s.counts.total()),
              s.views > 0 ? "pixels" : "samples");
  if (s.calibration.count() > 0)
    std::printf("calibration         ECE %.4f   Brier %.4f   NLL %.4f\n", s.calibration.ece(), s.calibration.brier(),
                s.calibration.nll());
  if (s.images.images() > 0)
    std::printf("class images        PSNR %.2f dB   SSIM %.4f   cross entropy %.4f\n", s.images.psnr_db(),
                s.images.ssim(), s.images.binary_cross_entropy());
}

void print_readings(const ReadingScores& scores) {
  for (const auto& [name, s] : scores.of_property) {
    std::printf("%-19s mean error %.4f   NLL %.4f   CRPS %.4f   of %llu readings\n", name.c_str(), s.mae(), s.nll(),
                s.crps(), static_cast<unsigned long long>(s.count()));
    std::printf("coverage            of 50 %% intervals %.1f %%   of 90 %% intervals %.1f %%\n", 100 * s.coverage(0),
                100 * s.coverage(1));
  }
  for (const auto& [reason, readings] : scores.refused)
    std::printf("not counted         %lld: %s\n", static_cast<long long>(readings), reason.c_str());
}

void require_depth_range(const ObservingCameras& cameras) {
  if (cameras.max_depth_m > cameras.min_depth_m) return;
  throw ConfigError(describe_mismatch("evaluate", "--max-depth, metres",
                                      "a number above --min-depth, " + Json(cameras.min_depth_m).dump(),
                                      Json(cameras.max_depth_m).dump()));
}

void check(const EvaluateCommand& c) {
  Problems problems;
  const auto need = [&](bool good, const char* option, const char* expected) {
    if (!good) problems.add_of_usage(describe_mismatch("evaluate", option, expected, "none"));
  };
  if (c.reference_mesh.empty() && c.reference_labels.empty() && c.reference_readings.empty())
    throw CLI::RequiredError("--reference-mesh, --reference-labels or --reference-readings");
  need(c.reliability.empty() || !c.reference_labels.empty() || !c.label_name.empty(), "--reliability",
       "--reference-labels, or --reference-mesh with --label-name");
  const bool along_sequence = names_sequence(c.trajectory), of_sequence = along_sequence || !c.reference_labels.empty();
  need(c.frames.empty() || of_sequence, "--frames", "--reference-labels or --trajectory SEQUENCE");
  need(c.format.empty() || of_sequence, "--format", "--reference-labels or --trajectory SEQUENCE");
  need(!fs::is_regular_file(c.trajectory) || along_sequence || (c.intrinsics->count() > 0 && c.size->count() > 0),
       "--trajectory FILE", "--intrinsics and --size");
  need(c.trajectory.empty() || !c.reference_mesh.empty(), "--trajectory", "--reference-mesh");
  need(c.size->count() == 0 || (!c.trajectory.empty() && !along_sequence), "--size", "--trajectory FILE");
  need(c.labels.empty() || !c.reference_labels.empty(), "--labels", "--reference-labels");
  need(c.classes.empty() || !c.reference_labels.empty() || !c.label_name.empty(), "--classes",
       "--reference-labels or --label-name");
  for (const CLI::Option* option : c.of_surfaces)
    need(option->count() == 0 || !c.reference_mesh.empty(), option->get_name().c_str(), "--reference-mesh");
  need(c.properties.empty() || !c.reference_readings.empty(), "--properties", "--reference-readings");
  need(c.label_name.empty() || !c.reference_mesh.empty() || !c.reference_labels.empty(), "--label-name",
       "--reference-mesh or --reference-labels");
  const bool is_map = fs::path(c.input).extension() == ".vdb";
  need(c.reference_readings.empty() || is_map, "--reference-readings", "a map (.vdb)");
  need(!c.class_images || (is_map && !c.reference_labels.empty()), "--class-images",
       "a map (.vdb) and --reference-labels");
  need(c.intrinsics->count() == 0 || of_sequence || !c.trajectory.empty(), "--intrinsics",
       "--trajectory or --reference-labels");
  problems.throw_if_any();
  require_ending(c.reliability, ".svg");
  // A map may bring a range of its own.
  if (!is_map || (c.min_depth->count() > 0 && c.max_depth->count() > 0)) require_depth_range(c.cameras);
}

/// The range of depth that all frames of the map were fused with, where none was given.
void adopt_depth_range(EvaluateCommand& command, const Map& map) {
  const auto adopt = [&](const CLI::Option* given, const char* key, double& value) {
    const std::set<double> fused = numbers_of_runs({&map, 1}, key);
    if (given->count() == 0 && fused.size() == 1) value = *fused.begin();
  };
  adopt(command.min_depth, "min_depth_m", command.cameras.min_depth_m);
  adopt(command.max_depth, "max_depth_m", command.cameras.max_depth_m);
  require_depth_range(command.cameras);
}

/// What comparisons found: figures, what each of them is, and the calibration that a reliability diagram shows.
struct Comparison {
  Json figures, definitions = Json::object();
  std::optional<CalibrationScores> calibration;
  bool print = false;  ///< in words, as they are found
};

void compare_geometry(const EvaluateCommand& command, const Evaluated& evaluated, const TriangleMesh& reference,
                      Comparison& found) {
  const bool culled = !command.trajectory.empty();
  const GeometryScores scores = evaluate_geometry(
      evaluated.map ? extract_mesh(*evaluated.map, {.normals = false, .colors = false}) : *evaluated.mesh, reference,
      command.geometry, culled ? &command.cameras : nullptr);
  found.figures["reference_mesh"] = command.reference_mesh;
  found.figures["threshold_m"] = command.geometry.threshold_m;
  found.figures.update(geometry_json(scores));
  found.definitions["geometry"] = geometry_definitions(command.geometry, culled);
  if (found.print) print_geometry(scores, command.geometry.threshold_m);
}

void compare_mesh_labels(const EvaluateCommand& command, const Evaluated& evaluated, const TriangleMesh& reference,
                         Comparison& found) {
  ClassTable classes;
  const LabelScores scores = evaluate_mesh_labels(command, evaluated, reference, classes);
  const std::string samples =
      "samples of the reference mesh whose triangle has a class, that a camera saw where a trajectory is given; the "
      "prediction is ";
  found.figures["surface"] = label_json(scores, classes);
  found.definitions["surface"] = label_definitions(
      scores, samples + (evaluated.map ? "that of the voxel nearest to the sample"
                                       : "the label of the nearest point of the mesh within the threshold"));
  found.calibration = scores.calibration;
  if (found.print) print_labels(scores, "the mesh");
}

void compare_sequence_labels(const EvaluateCommand& command, const Evaluated& evaluated, Comparison& found) {
  const SequenceLabels labels = evaluate_sequence_labels(command, evaluated);
  found.figures["reference_labels"] = command.reference_labels;
  found.figures.update(label_json(labels.scores, labels.classes));
  if (!labels.skipped.empty()) found.figures["labels"]["skipped_views"] = labels.skipped;
  found.definitions["labels"] = label_definitions(
      labels.scores,
      "pixels with depth from " + Json(command.cameras.min_depth_m).dump() + " to " +
          Json(command.cameras.max_depth_m).dump() +
          " m whose true label is a class; the prediction is that of the surface that the pixel's ray meets first");
  found.calibration = labels.scores.calibration;
  if (found.print) print_labels(labels.scores, "the views");
  if (found.print && !labels.skipped.empty())
    std::printf("not counted         views: %s\n", skipped_text(labels.skipped).c_str());
}

void compare_readings(const EvaluateCommand& command, Evaluated& evaluated, Comparison& found) {
  const ReadingScores scores = evaluate_readings(command, *evaluated.map);
  found.figures["properties"] = readings_json(scores);
  found.definitions["properties"] = property_definitions();
  if (found.print) print_readings(scores);
}

void draw_reliability(const std::string& file, Comparison& found) {
  if (!found.calibration || found.calibration->count() == 0)
    throw ConfigError(describe_mismatch("--reliability", "class probabilities", "a map with classes", "none"));
  write_plot_svg(file, reliability_plots(*found.calibration), 2);
  found.figures["reliability"] = file;
}

int evaluate(EvaluateCommand& command) {
  check(command);
  command.reading = reading_of(command);
  if (!command.trajectory.empty()) read_cameras(command);
  Evaluated evaluated;
  if (fs::path(command.input).extension() == ".vdb") {
    evaluated.map = load_map(command.input);
    adopt_depth_range(command, *evaluated.map);
  } else
    evaluated.mesh = read_mesh(command.input);
  Comparison found;
  found.figures["input"] = command.input;
  found.print = !command.common.json && !command.common.quiet;
  if (!command.reference_mesh.empty()) {
    const TriangleMesh reference = read_mesh(command.reference_mesh);
    warn_if_coarse(reference, command.reference_mesh);
    compare_geometry(command, evaluated, reference, found);
    if (!command.label_name.empty()) compare_mesh_labels(command, evaluated, reference, found);
  }
  if (!command.reference_labels.empty()) compare_sequence_labels(command, evaluated, found);
  if (!command.reference_readings.empty()) compare_readings(command, evaluated, found);
  if (!command.reliability.empty()) draw_reliability(command.reliability, found);
  found.figures["definitions"] = std::move(found.definitions);
  if (command.common.json) print_json(found.figures);
  return kDone;
}

}  // namespace

void add_evaluate(CLI::App& app) {
  static EvaluateCommand command;
  CLI::App& sub =
      add_command(app,
                  {"evaluate", "Compare a map or mesh with references; --json gives the definition of every figure",
                   "feltmap evaluate out/map.vdb --reference-mesh scene/mesh.ply --trajectory scene\n"
                   "feltmap evaluate out/map.vdb --reference-labels scene/truth --reliability reliability.svg --json\n"
                   "feltmap evaluate out/map.vdb --reference-readings held_out.csv"},
                  command.common, [] { return evaluate(command); });
  sub.add_option("INPUT", command.input, "Map (.vdb) or mesh (.ply, .obj)")->required();

  const char* geometry = "Geometry";
  sub.add_option("--reference-mesh", command.reference_mesh, "Exact mesh (.ply, .obj) in the same world frame")
      ->group(geometry);
  sub.add_option("--samples", command.geometry.samples, "Samples on each mesh")
      ->check(CLI::Range(size_t(1), size_t(100000000)))
      ->capture_default_str()
      ->group(geometry);
  sub.add_option("--seed", command.geometry.seed, "Of the samples")
      ->check(at_least_zero())
      ->capture_default_str()
      ->group(geometry);
  sub.add_option("--threshold", command.geometry.threshold_m, "Metres, of precision, recall and F-score")
      ->check(above_zero())
      ->capture_default_str()
      ->group(geometry);
  sub.add_option("--trajectory", command.trajectory,
                 "Recorded sequence (its --frames), or a file with one pose a line: only what it saw of the reference "
                 "counts")
      ->group(geometry);
  sub.add_flag("--cull-reconstruction", command.geometry.cull_reconstruction,
               "Leave out what the trajectory did not see of the reconstruction, too")
      ->needs("--trajectory")
      ->group(geometry);
  for (const char* name : {"--samples", "--seed", "--threshold"}) command.of_surfaces.push_back(sub.get_option(name));
  add_camera_options(sub, command.camera);
  // The defaults serve nothing here: a recording brings its camera, poses alone need the one they were taken with.
  const std::string required = " (required where --trajectory is a file of poses)";
  command.intrinsics = sub.get_option("--intrinsics")->default_str("")->description("fx,fy,cx,cy in pixels" + required);
  command.size = sub.get_option("--size")->default_str("")->description("Width x height in pixels" + required);
  command.min_depth = sub.add_option("--min-depth", command.cameras.min_depth_m,
                                     "Metres, of the recording [as the map was fused, else 0.1]")
                          ->check(at_least_zero());
  command.max_depth = sub.add_option("--max-depth", command.cameras.max_depth_m,
                                     "Metres, of the recording [as the map was fused, else 4]")
                          ->check(above_zero());

  const char* labels = "Labels";
  sub.add_option("--reference-labels", command.reference_labels, "Sequence with true labels, in the map's world frame")
      ->group(labels);
  sub.add_option("--labels", command.labels, "Folder of true label images, where the sequence has others or none")
      ->group(labels);
  sub.add_option("--classes", command.classes, "Class table of the true labels; matched with the map's by name")
      ->group(labels);
  sub.add_option("--format", command.format, "Layout of the sequence (else detected)")->group(labels);
  sub.add_option("--frames", command.frames, "Frames a:b:step of the sequence")->group(labels);
  sub.add_option("--label-name", command.label_name,
                 "Compare labels with the reference mesh's: this scalar of its triangles, or its vertex labels")
      ->group(labels);
  sub.add_flag("--class-images", command.class_images, "Also PSNR, SSIM and cross entropy of class images")
      ->group(labels);
  sub.add_option("--reliability", command.reliability, "Write the reliability diagram (SVG)")->group(labels);

  const char* properties = "Properties";
  sub.add_option("--reference-readings", command.reference_readings,
                 "Readings that the map was not given (as touches.csv): how good are its forecasts?")
      ->group(properties);
  sub.add_option("--properties", command.properties, "Property table (YAML), instead of the one that the map may have")
      ->group(properties);
}

}  // namespace felt::apps
