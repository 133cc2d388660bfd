// The map experiment that stands in for the paper's in Habitat.
#include <tbb/parallel_for.h>

#include <cmath>
#include <map>

#include "bench/paper/experiments.h"
#include "bench/paper/map_comparison.h"
#include "bench/paper/pictures.h"
#include "io/pictures/picture.h"
#include "io/simulation/furniture.h"
#include "io/simulation/label_network.h"
#include "io/simulation/render_sequence.h"
#include "io/simulation/scene_library.h"
#include "io/simulation/touches.h"
#include "mapping/surface/render_classes.h"

namespace felt::paper {
namespace {

Recording furnished_recording(int room, int frames) {
  const Scene scene = make_scene("room" + std::to_string(room));
  RenderOptions options;
  options.noise = DepthNoise{};
  options.label_set = LabelSet::material;
  options.seed = uint64_t(room);
  Recording recording;
  recording.frames = render_sequence(scene, standard_trajectory(scene, frames), simulated_camera(320, 240), options);
  recording.classes = scene.materials;
  recording.property = simulated_properties()[0];
  return recording;
}

/// Figures of one kind of map, gathered over rooms.
struct Figures {
  std::vector<double> accuracy, miou, ece, nll, psnr, ssim, bce;
  int touches = 0, refused = 0;

  void add(const LabelScores& s) {
    accuracy.push_back(s.counts.pixel_accuracy());
    miou.push_back(s.counts.mean_iou());
    ece.push_back(s.calibration.ece());
    nll.push_back(s.calibration.nll());
    psnr.push_back(s.images.psnr_db());
    ssim.push_back(s.images.ssim());
    bce.push_back(s.images.binary_cross_entropy());
  }
};

double mean_of(const std::vector<double>& x) {
  double sum = 0;
  for (const double v : x) sum += v;
  return sum / double(x.size());
}

/// Half of the 95 % interval of the mean over rooms and networks.
double interval(const std::vector<double>& x) {
  const double m = mean_of(x);
  double squares = 0;
  for (const double v : x) squares += (v - m) * (v - m);
  return 1.96 * std::sqrt(squares / double(x.size() - 1) / double(x.size()));
}

void print_row(const std::string& network, const std::string& name, const Figures& f) {
  std::printf("| %s | %s | %d | %.3f ± %.3f | %.3f | %.3f ± %.3f | %.2f | %.2f | %.3f | %.3f |\n", network.c_str(),
              name.c_str(), f.touches, mean_of(f.accuracy), interval(f.accuracy), mean_of(f.miou), mean_of(f.ece),
              interval(f.ece), mean_of(f.nll), mean_of(f.psnr), mean_of(f.ssim), mean_of(f.bce));
  std::fflush(stdout);
}

/// What touching changed, over the colour: green where only `after` has the true class, purple where only `before` has,
/// red where neither.
ColorImage changes(const Frame& frame, const LabelImage& before, const LabelImage& after) {
  ColorImage image = frame.color;
  for (size_t p = 0; p < image.size(); ++p) {
    const uint16_t truth = frame.labels.data()[p];
    const bool was = before.data()[p] == truth, is = after.data()[p] == truth;
    Rgba8& c = image.data()[p];
    const int grey = (c.r + 2 * c.g + c.b) / 4;
    const Rgba8 tint = was == is ? Rgba8{210, 40, 40, 255} : is ? Rgba8{40, 180, 70, 255} : Rgba8{150, 50, 200, 255};
    const auto mix = [&](uint8_t channel) { return uint8_t(was && is ? grey : (grey + 2 * channel) / 3); };
    c = {mix(tint.r), mix(tint.g), mix(tint.b), 255};
  }
  return image;
}

/// Colour, truth and the maps before and after touching, seen from a frame; below them the network's labels, what
/// touching changed, and the entropy of both maps.
ColorImage picture(const Recording& recording, const NetworkLabels& network, size_t f, const Map& before,
                   const Map& after) {
  const Frame& frame = recording.frames[f];
  std::vector<LabelImage> classes;
  std::vector<ColorImage> entropies;
  for (const Map* map : {&before, &after}) {
    const VoxelBeliefs beliefs(*map);
    const RenderedView view = RayCaster(*map).render(frame.camera, frame.T_world_camera);
    classes.push_back(class_image(*map, beliefs, view.voxel));
    entropies.push_back(colored(entropy_image(beliefs, view.voxel), 0, std::log(double(recording.classes.size()))));
  }
  const ClassTable& table = recording.classes;
  return tiled({frame.color, colored(frame.labels, table), colored(classes[0], table), colored(classes[1], table),
                colored(network.labels[f], table), changes(frame, classes[0], classes[1]), entropies[0], entropies[1]},
               4);
}

constexpr const char* kVision = "vision only, counts";
constexpr const char* kCalibrated = "vision only, calibrated";
constexpr const char* kOne = "**ours**, wrong things touched once";
constexpr const char* kThree = "**ours**, wrong things touched three times";
constexpr const char* kCountsOne = "counts, wrong things touched once";
constexpr const char* kSuggested = "**ours**, as many touches where `suggest` says";
constexpr const char* kOrder[] = {kVision, kCalibrated, kCountsOne, kOne, kThree, kSuggested};

void run_room(int room, const std::string& network_name, const Options& options,
              std::map<std::string, Figures>& figures) {
  const Recording recording = furnished_recording(room, options.quick ? 4 : 10);
  const NetworkLabels network =
      network_labels(recording, preset_confusion(network_name, recording.classes), uint64_t(room));
  Map counts = fused(recording, network, Evidence::counts), ours = fused(recording, network, Evidence::calibrated);
  const auto record = [&](const char* name, const Map& map, int touches, int refused) {
    figures[name].add(score(map, recording, true));
    figures[name].touches += touches, figures[name].refused += refused;
  };
  record(kVision, counts, 0, 0);
  record(kCalibrated, ours, 0, 0);
  const std::vector<Reading> once = readings_where_wrong(recording, network, 1, uint64_t(room));
  record(kOne, ours, int(once.size()), touch(ours, recording, once));
  const bool shown = network_name == "medium" || (network_name == "poor" && room == 3);
  if (!options.out.empty() && shown)
    write_png(options.out / ("room" + std::to_string(room) + "_" + network_name + ".png"),
              picture(recording, network, 2, counts, ours));
  record(kCountsOne, counts, int(once.size()), touch(counts, recording, once));
  undo_touches(ours);
  const std::vector<Reading> thrice = readings_where_wrong(recording, network, 3, uint64_t(room));
  record(kThree, ours, int(thrice.size()), touch(ours, recording, thrice));
  undo_touches(ours);
  const int made = touch_as_suggested(ours, recording, int(once.size()), uint64_t(room));
  record(kSuggested, ours, made, 0);
}

}  // namespace

void room_maps(const Options& options, Checks& checks) {
  std::printf(
      "\n## Maps of five furnished rooms\n\nTen frames of 320x240 with sensor noise, 2 cm voxels, 15 materials; "
      "networks right for about 92, 78 and 55 %% of the things, wrong about the same things in every frame. Means over "
      "rooms ± 95 %%; touches are totals; counts stand on a prior of 1.\n\n"
      "| network | map | touches | pixel accuracy | mIoU | ECE | NLL | PSNR, dB | SSIM | cross entropy |\n"
      "|---|---|---|---|---|---|---|---|---|---|\n");
  std::map<std::string, Figures> all;
  for (const char* network : {"good", "medium", "poor"}) {
    if (options.quick && std::string(network) != "medium") continue;
    std::map<std::string, Figures> figures;
    for (int room = 1; room <= (options.quick ? 2 : 5); ++room) run_room(room, network, options, figures);
    for (const char* name : kOrder) {
      print_row(network, name, figures[name]);
      Figures& sum = all[name];
      const auto append = [](std::vector<double>& to, const std::vector<double>& from) {
        to.insert(to.end(), from.begin(), from.end());
      };
      const Figures& f = figures[name];
      append(sum.accuracy, f.accuracy), append(sum.miou, f.miou), append(sum.ece, f.ece), append(sum.nll, f.nll);
      append(sum.psnr, f.psnr), append(sum.ssim, f.ssim), append(sum.bce, f.bce);
      sum.touches += f.touches, sum.refused += f.refused;
    }
  }
  if (!options.quick)
    for (const char* name : kOrder) print_row("all", name, all[name]);
  std::printf("\nTouches refused (the contact carries no label in the map): %d of %d.\n", all[kThree].refused,
              all[kThree].touches);
  const auto compare = [&](const char* what, const std::vector<double>& better, const std::vector<double>& worse) {
    std::vector<double> difference;
    for (size_t i = 0; i < better.size(); ++i) difference.push_back(better[i] - worse[i]);
    checks.better(what, mean_of(difference), options.quick ? 0 : interval(difference) / 1.96);
  };
  compare("maps: ECE of vision only, counts, less that of ours touched once", all[kVision].ece, all[kOne].ece);
  compare("maps: ECE of vision only, counts, less that of calibrated vision", all[kVision].ece, all[kCalibrated].ece);
  if (options.quick) return;  // too few touches to say
  compare("maps: accuracy of ours touched once less that of vision only, counts", all[kOne].accuracy,
          all[kVision].accuracy);
}

}  // namespace felt::paper
