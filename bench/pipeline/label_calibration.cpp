// How honest a map's class probabilities are on frames it has not seen, by the settings of label fusion: the figures
// behind the defaults (docs/semantics.md). Every fourth frame builds the map, every fourth teaches the confusion
// matrix, every fourth is held out: the map is rendered from there and compared, pixel by pixel, with the true labels.
//   bench_label_calibration [icl | house]
#include <cmath>
#include <functional>
#include <numeric>

#include "bench/support/bench.h"
#include "core/simd.h"
#include "io/simulation/label_network.h"
#include "mapping/evaluation/evaluate_predictions.h"
#include "mapping/fusion/label_evidence.h"
#include "mapping/fusion/tsdf_integrator.h"
#include "mapping/labels/class_belief.h"
#include "mapping/labels/label_calibration.h"
#include "mapping/surface/render.h"

namespace {

using namespace felt;

constexpr double kVoxel = 0.02;
constexpr int kSmaller = 4;  // rendered at a quarter of the width and height

/// One network on one recording.
struct Experiment {
  std::string name;
  ClassTable classes;
  std::vector<Frame> building;            // labelled by the network
  std::vector<Frame> teaching, held_out;  // likewise, with their true labels
  std::vector<LabelImage> teaching_truth, held_out_truth;
  std::vector<Image<VoxelRef>> seen;  // by held-out frame: what the map shows there
};

struct Settings {
  std::string name;
  LabelConfig labels;
  double prior = 1;
  bool confusion = false;
};

void add(Experiment& e, size_t position, Frame frame, LabelImage truth) {
  switch (position % 4) {
    case 0:
      e.building.push_back(std::move(frame));
      return;
    case 1:
      e.teaching.push_back(std::move(frame));
      e.teaching_truth.push_back(std::move(truth));
      return;
    case 2:
      e.held_out.push_back(std::move(frame));
      e.held_out_truth.push_back(std::move(truth));
      return;
    default:
      return;
  }
}

Experiment recorded_network(const std::string& name, const std::string& labels, const std::string& confidence) {
  const std::filesystem::path folder = bench::recorded(name);
  SequenceOptions options{.read_color = false};
  options.labels_dir = folder / labels;
  if (!confidence.empty()) options.probs_dir = folder / confidence;
  const auto predicted = open_sequence(folder, options), truth = open_sequence(folder, {.read_color = false});
  Experiment e;
  e.name = confidence.empty() ? name + ", labels" : name + ", labels with confidence";
  e.classes = predicted->info().classes;
  for (int64_t i = 0; i < predicted->size(); ++i) {
    ReadResult frame = predicted->read(i), true_frame = truth->read(i);
    add(e, size_t(i), std::move(std::get<Frame>(frame)), std::move(std::get<Frame>(true_frame).labels));
  }
  return e;
}

std::vector<double> class_share(const std::vector<Frame>& frames, const ClassTable& classes) {
  std::vector<double> share(size_t(classes.size()));
  for (const Frame& frame : frames)
    for (const uint16_t id : frame.labels)
      if (const uint16_t slot = classes.slot_of_id(id); slot != ClassTable::kNoSlot) share[slot] += 1;
  const double sum = std::accumulate(share.begin(), share.end(), 0.0);
  for (double& s : share) s /= sum;
  return share;
}

/// `sharpness` 0: labels only; else its three greatest probabilities to that power, 1: calibrated, above: too sure.
Experiment simulated_network(const std::vector<Frame>& frames, const ClassTable& classes, const std::string& preset,
                             ErrorScale scale, const std::string& scale_name, double sharpness = 0) {
  Experiment e;
  e.name = "house, " + preset + " network, mistakes by " + scale_name;
  if (sharpness > 0) e.name += sharpness > 1 ? ", top-3 probabilities too sure" : ", top-3 probabilities";
  e.classes = classes;
  LabelNetwork network{preset_confusion(preset, classes), scale};
  if (sharpness > 0) network.top = 3, network.sharpness = sharpness, network.class_share = class_share(frames, classes);
  for (size_t i = 0; i < frames.size(); ++i) {
    if (i % 4 == 3) continue;
    Frame frame = frames[i];
    LabelImage truth = frame.labels;
    NetworkOutput output = run_network(network, classes, truth, frame.instances, 1, frame.index);
    frame.labels = std::move(output.labels), frame.probabilities = std::move(output.probabilities);
    frame.instances = {};
    add(e, i, std::move(frame), std::move(truth));
  }
  return e;
}

Map fused(const Experiment& e, const Settings& s, const LabelEvidence* likelihood) {
  Map map(kVoxel, 4 * kVoxel);
  std::vector<ClassInfo> classes = e.classes.classes();
  for (ClassInfo& c : classes) c.prior = s.prior;
  map.classes = ClassTable(classes);
  IntegrationConfig config;
  config.labels = s.labels;
  config.labels.likelihood = s.confusion ? likelihood : nullptr;
  IntegrationScratch scratch;
  for (const Frame& frame : e.building) integrate(map, frame, config, scratch);
  return map;
}

/// What the held-out cameras see of the geometry. Blocks are numbered alike whatever the labels.
void render_held_out(Experiment& e) {
  const Map map = fused(e, {}, nullptr);
  const RayCaster caster(map);
  for (const Frame& frame : e.held_out) {
    PinholeCamera camera = frame.camera;
    camera.fx /= kSmaller, camera.fy /= kSmaller, camera.cx /= kSmaller, camera.cy /= kSmaller;
    camera.width /= kSmaller, camera.height /= kSmaller;
    e.seen.push_back(
        caster.render(camera, frame.T_world_camera, {.max_depth_m = 4, .normals = false, .color = false}).voxel);
  }
}

struct Scores {
  double accuracy = 0, ece = 0, brier = 0, nll = 0;
};

Scores score(const Experiment& e, const Map& map) {
  CalibrationScores scores;
  std::vector<double> p(size_t(map.classes.size()));
  uint64_t right = 0, all = 0;
  for (size_t n = 0; n < e.held_out.size(); ++n)
    for (int v = 0; v < e.seen[n].height(); ++v)
      for (int u = 0; u < e.seen[n].width(); ++u) {
        const VoxelRef voxel = e.seen[n](u, v);
        const uint16_t truth = map.classes.slot_of_id(e.held_out_truth[n](u * kSmaller, v * kSmaller));
        if (voxel.block == BlockStore::kNone || truth == ClassTable::kNoSlot) continue;
        const Block& block = map.store[voxel.block];
        if (class_belief(block, voxel.offset, map.classes).slot == ClassTable::kNoSlot) continue;
        class_concentration(&block, voxel.offset, map.classes, p);
        const double sum = std::accumulate(p.begin(), p.end(), 0.0);
        for (double& x : p) x /= sum;
        scores.add(p, truth);
        right += size_t(std::max_element(p.begin(), p.end()) - p.begin()) == truth;
        ++all;
      }
  return {double(right) / double(all), scores.ece(), scores.brier(), scores.nll()};
}

/// Every remedy against over-confidence beside none, for each way to count.
std::vector<Settings> all_settings(double k, bool confusion_too) {
  struct Counting {
    std::string name;
    double prior;
    bool confusion;
  };
  std::vector<Counting> countings = {{"prior 1", 1, false},
                                     {"prior 8/k", 8 / k, false},
                                     {"prior 4/k", 4 / k, false},
                                     {"prior 2/k", 2 / k, false},
                                     {"prior 1/k", 1 / k, false}};
  if (confusion_too) {
    countings.push_back({"confusion matrix, prior 1", 1, true});
    countings.push_back({"confusion matrix, prior 8/k", 8 / k, true});
    countings.push_back({"confusion matrix, prior 1/k", 1 / k, true});
  }
  std::vector<Settings> all;
  for (const Counting& c : countings) {
    const auto with = [&](const std::string& remedy, const std::function<void(LabelConfig&)>& change) {
      Settings s{c.name + remedy, {}, c.prior, c.confusion};
      s.labels.max_evidence = 0, s.labels.evidence = 1;
      change(s.labels);
      all.push_back(s);
    };
    with("", [](LabelConfig&) {});
    for (const float evidence : {0.1f, 0.3f})
      with(", evidence " + std::to_string(evidence).substr(0, 3), [&](LabelConfig& l) { l.evidence = evidence; });
    for (const float cap : {5.0f, 10.0f, 20.0f, 50.0f})
      with(", cap " + std::to_string(int(cap)), [&](LabelConfig& l) { l.max_evidence = cap; });
    with(", novelty 0.1 m, 10 deg", [](LabelConfig& l) { l.novelty_m = 0.1f, l.novelty_deg = 10; });
  }
  return all;
}

void print(const std::string& name, const Scores& s) {
  std::printf("| %s | %.3f | %.3f | %.3f | %.3f |\n", name.c_str(), s.accuracy, s.ece, s.brier, s.nll);
  std::fflush(stdout);
}

/// The network's own probabilities on the held-out frames, what is not named spread over the other classes.
Scores score_frames(const Experiment& e) {
  CalibrationScores scores;
  uint64_t right = 0, all = 0;
  const int k = e.classes.size();
  std::vector<double> p(static_cast<size_t>(k));
  for (size_t n = 0; n < e.held_out.size(); ++n) {
    const ProbabilityImage& image = e.held_out[n].probabilities;
    for (int v = 0; v < image.height; v += kSmaller)
      for (int u = 0; u < image.width; u += kSmaller) {
        const uint16_t truth = e.classes.slot_of_id(e.held_out_truth[n](u, v));
        if (truth == ClassTable::kNoSlot) continue;
        std::fill(p.begin(), p.end(), -1.0);
        double rest = 1;
        int unnamed = k;
        for (int i = 0; i < image.top; ++i) {
          const size_t at = (size_t(v) * size_t(image.width) + size_t(u)) * size_t(image.top) + size_t(i);
          const uint16_t slot = e.classes.slot_of_id(image.class_id[at]);
          if (slot == ClassTable::kNoSlot || !(image.probability[at] > 0) || p[slot] >= 0) continue;
          p[slot] = double(image.probability[at]);
          rest -= p[slot], --unnamed;
        }
        if (unnamed == k) continue;
        double sum = 0;
        for (double& x : p) sum += x = x >= 0 ? x : std::max(0.0, rest) / unnamed;
        for (double& x : p) x /= sum;
        scores.add(p, truth);
        right += size_t(std::max_element(p.begin(), p.end()) - p.begin()) == truth;
        ++all;
      }
  }
  return {double(right) / double(all), scores.ece(), scores.brier(), scores.nll()};
}

void run(Experiment e) {
  render_held_out(e);
  ConfusionCounts taught(e.classes.size()), held_out(e.classes.size());
  for (size_t n = 0; n < e.teaching.size(); ++n) count_confusion(e.teaching[n], e.teaching_truth[n], e.classes, taught);
  for (size_t n = 0; n < e.held_out.size(); ++n)
    count_confusion(e.held_out[n], e.held_out_truth[n], e.classes, held_out);
  const LabelEvidence likelihood = label_evidence(taught.pixels, taught.k);
  const ConfusionScores frame = score_confusion(taught, held_out);
  std::printf("\n%s: %d classes, %zu frames build, %zu held out\n\n", e.name.c_str(), e.classes.size(),
              e.building.size(), e.held_out.size());
  std::printf("| settings | accuracy | ECE | Brier | NLL |\n|---|---|---|---|---|\n");
  print("single frames, through the confusion matrix", {frame.accuracy, frame.ece, frame.brier, frame.nll});
  const bool soft = !e.held_out[0].probabilities.empty();
  if (soft) print("single frames, as the network says", score_frames(e));
  // What a calibrated distribution says of the true class it has already said.
  for (const Settings& s : all_settings(e.classes.size(), !soft || e.building[0].probabilities.top == 1))
    print(s.name, score(e, fused(e, s, &likelihood)));
}

}  // namespace

int main(int argc, char** argv) {
  apply_simd_choice();
  const std::string wanted = argc > 1 ? argv[1] : "";
  if (wanted.empty() || wanted == "icl") {
    run(recorded_network("icl_livingroom_maskrcnn", "pred_label", ""));
    run(recorded_network("icl_livingroom_maskrcnn", "pred_label", "pred_score"));
  }
  if (wanted.empty() || wanted == "house") {
    const std::vector<Frame> frames = bench::decoded("house_living_rendered", {.read_color = false});
    const ClassTable classes =
        open_sequence(bench::recorded("house_living_rendered"), {.read_color = false})->info().classes;
    for (const char* preset : {"good", "medium", "poor"})
      run(simulated_network(frames, classes, preset, ErrorScale::segment, "thing and frame"));
    run(simulated_network(frames, classes, "medium", ErrorScale::pixel, "pixel"));
    run(simulated_network(frames, classes, "medium", ErrorScale::scene, "thing in all frames"));
    run(simulated_network(frames, classes, "medium", ErrorScale::segment, "thing and frame", 1));
    run(simulated_network(frames, classes, "medium", ErrorScale::segment, "thing and frame", 3));
  }
}
