#include <cmath>
#include <cstdlib>

#include "bench/paper/experiments.h"
#include "bench/paper/map_comparison.h"
#include "bench/paper/pictures.h"
#include "io/pictures/picture.h"
#include "io/pictures/plot_svg.h"
#include "io/pictures/reliability_plot.h"
#include "io/sequence/open_sequence.h"
#include "io/simulation/label_network.h"
#include "io/simulation/touches.h"
#include "mapping/fusion/label_evidence.h"
#include "mapping/fusion/tsdf_integrator.h"
#include "mapping/labels/label_calibration.h"
#include "mapping/surface/render_classes.h"

namespace felt::paper {
namespace {
namespace fs = std::filesystem;

fs::path recorded(const char* name) {
  const char* set = std::getenv("FELTMAP_DATA");
  return fs::path(set != nullptr ? set : "../shared/data") / name;
}

std::vector<Frame> frames_of(const fs::path& path, const SequenceOptions& options) {
  const auto reader = open_sequence(path, options);
  std::vector<Frame> frames;
  for (int64_t i = 0; i < reader->size(); ++i) {
    ReadResult result = reader->read(i);
    if (Frame* frame = std::get_if<Frame>(&result)) frames.push_back(std::move(*frame));
  }
  return frames;
}

ClassTable classes_of(const fs::path& path, const SequenceOptions& options) {
  return open_sequence(path, options)->info().classes;
}

void print_row(const char* name, const LabelScores& s) {
  std::printf("| %s | %.4f | %.4f | %.4f | %.4f | %.3f |\n", name, s.counts.pixel_accuracy(), s.counts.mean_iou(),
              s.calibration.ece(), s.calibration.brier(), s.calibration.nll());
  std::fflush(stdout);
}

/// Real predictions of a real network, wrong by view and class.
void icl_living_room(const Options& options, Checks& checks) {
  const fs::path path = recorded("icl_livingroom_maskrcnn");
  if (!fs::exists(path)) return;
  SequenceOptions predicted, truth;
  predicted.frames = truth.frames = {0, std::numeric_limits<int64_t>::max(), options.quick ? 40 : 4};
  predicted.labels_dir = path / "pred_label";
  const ClassTable classes = classes_of(path, truth);
  std::vector<Frame> seen = frames_of(path, predicted), true_frames = frames_of(path, truth);
  std::printf(
      "\n## ICL-NUIM living room, labels of Mask R-CNN\n\n%zu frames, 2 cm voxels; the true labels of the second half "
      "are the reference. Frames by themselves have no probabilities.\n\n"
      "| labels | pixel accuracy | mIoU | ECE | Brier | NLL |\n|---|---|---|---|---|---|\n",
      seen.size());
  const TruthClasses slots(classes, classes);
  LabelScores frames(classes.size());
  for (size_t i = seen.size() / 2; i < seen.size(); ++i) {
    LabelPrediction prediction{Image<int16_t>(seen[i].labels.width(), seen[i].labels.height(), -1), {}};
    for (size_t p = 0; p < seen[i].labels.size(); ++p)
      prediction.slot.data()[p] = int16_t(std::max(-1, slots.slot_of_id(seen[i].labels.data()[p])));
    add_view(frames, prediction, {&true_frames[i].labels, &true_frames[i].depth_m, 0.1, 4}, slots, false);
  }
  std::printf("| frame by frame | %.4f | %.4f | | | |\n", frames.counts.pixel_accuracy(), frames.counts.mean_iou());
  Recording recording;
  recording.frames = std::move(true_frames);
  recording.classes = classes;
  // What the network mistakes is learned from the first half of the frames; the maps are scored on the second.
  const size_t half = seen.size() / 2;
  ConfusionCounts counted(classes.size());
  for (size_t i = 0; i < half; ++i) count_confusion(seen[i], recording.frames[i].labels, classes, counted);
  const LabelEvidence likelihood = label_evidence(counted.pixels, classes.size());
  recording.frames.erase(recording.frames.begin(), recording.frames.begin() + long(half));
  double ece_of_counts = 0, accuracy_of_counts = 0, iou_of_counts = 0;
  for (const bool calibrated : {false, true}) {
    Map map(0.02, 0.08);
    map.classes = with_prior(classes, calibrated ? 1.0 / classes.size() : 1);
    IntegrationConfig config;
    if (calibrated) config.labels.likelihood = &likelihood;
    IntegrationScratch scratch;
    for (const Frame& frame : seen) integrate(map, frame, config, scratch);
    const LabelScores s = score(map, recording, false);
    print_row(calibrated ? "**ours**: map, confusion learned from the first half" : "map, counts on a prior of 1", s);
    if (calibrated) {
      checks.better("ICL living room: ECE of counts less that with the network's confusion",
                    ece_of_counts - s.calibration.ece(), 0);
      if (s.counts.pixel_accuracy() < accuracy_of_counts && s.counts.mean_iou() < iou_of_counts)
        std::printf("\nA confusion matrix learned on the first half costs accuracy and mIoU here.\n");
    } else {
      ece_of_counts = s.calibration.ece();
      accuracy_of_counts = s.counts.pixel_accuracy(), iou_of_counts = s.counts.mean_iou();
    }
    if (options.out.empty()) continue;
    write_plot_svg(options.out / (calibrated ? "icl_reliability.svg" : "icl_reliability_counts.svg"),
                   reliability_plots(s.calibration), 2);
    if (!calibrated) continue;
    const size_t middle = recording.frames.size() / 2;
    const Frame& frame = recording.frames[middle];
    const VoxelBeliefs beliefs(map);
    const RenderedView view = RayCaster(map).render(frame.camera, frame.T_world_camera);
    write_png(options.out / "icl.png",
              tiled({frame.color, colored(frame.labels, classes), colored(seen[half + middle].labels, classes),
                     colored(class_image(map, beliefs, view.voxel), classes)},
                    4));
  }
}

/// True materials of a rendered house, a simulated network, readings where it is wrong.
void rendered_house(const Options& options, Checks& checks) {
  const fs::path path = recorded("house_living_rendered");
  if (!fs::exists(path)) return;
  SequenceOptions materials;
  materials.frames = {0, std::numeric_limits<int64_t>::max(), options.quick ? 40 : 8};
  materials.classes_file = path / "classes_material.csv";
  materials.labels_dir = path / "material";
  SequenceOptions things = materials;
  things.labels_dir = path / "instance";
  Recording recording;
  recording.frames = frames_of(path, materials);
  recording.classes = classes_of(path, materials);
  const std::vector<Frame> instances = frames_of(path, things);
  for (size_t i = 0; i < instances.size(); ++i) recording.frames[i].instances = instances[i].labels;
  recording.property = simulated_properties()[0];
  recording.property.priors["stone"] = recording.property.priors.at("rock");
  std::printf(
      "\n## Rendered house, materials\n\n%zu frames, 2 cm voxels, 13 materials of which wood, plastic, stone (as rock) "
      "and rubber have a friction prior; the network `medium` is wrong about the same things in every frame.\n\n"
      "| map | pixel accuracy | mIoU | ECE | Brier | NLL |\n|---|---|---|---|---|---|\n",
      recording.frames.size());
  const NetworkLabels network = network_labels(recording, preset_confusion("medium", recording.classes), 3);
  const Map counts = fused(recording, network, Evidence::counts);
  Map ours = fused(recording, network, Evidence::calibrated);
  const LabelScores vision = score(counts, recording, false);
  print_row("vision only, counts", vision);
  print_row("vision only, calibrated", score(ours, recording, false));
  const std::vector<Reading> readings = readings_where_wrong(recording, network, 1, 3);
  const int refused = touch(ours, recording, readings);
  const LabelScores touched = score(ours, recording, false);
  print_row(("**ours**, " + std::to_string(int(readings.size()) - refused) + " wrong things touched once").c_str(),
            touched);
  checks.better("house: ECE of vision only, counts, less that of ours touched",
                vision.calibration.ece() - touched.calibration.ece(), 0);
  if (!options.out.empty()) {
    const Frame& frame = recording.frames[recording.frames.size() / 3];
    std::vector<ColorImage> panels = {frame.color, colored(frame.labels, recording.classes)};
    for (const Map* map : {&counts, static_cast<const Map*>(&ours)}) {
      const VoxelBeliefs beliefs(*map);
      const RenderedView view = RayCaster(*map).render(frame.camera, frame.T_world_camera);
      panels.push_back(colored(class_image(*map, beliefs, view.voxel), map->classes));
    }
    write_png(options.out / "house.png", tiled(panels, 4));
  }
}

}  // namespace

void recorded_sequences(const Options& options, Checks& checks) {
  icl_living_room(options, checks);
  rendered_house(options, checks);
}

}  // namespace felt::paper
