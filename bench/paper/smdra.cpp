// Measured friction on measured depth: the SMDRA pictures (docs/touch.md, "Measured friction").
//
//   FELTMAP_DATA=DATA bench_smdra [draws of the labels per picture]
//
// Priors and rho are fitted to the readings of the pictures that have no depth image. Each of the others becomes a map
// of one frame: its samples are labelled by a network that is right in 70 % of them and says so, and each sample is
// touched once with the friction that was measured on it. Reported before and after: how many voxels of the samples
// have the right class, and how far the expected next reading is from the material's mean over the other pictures.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "bench/support/bench.h"
#include "inference/decision.h"
#include "inference/prior_fit.h"
#include "io/files/text_input.h"
#include "io/images/image_decode.h"
#include "mapping/fusion/tsdf_integrator.h"
#include "mapping/touch/touch_update.h"
#include "mapping/touch/touch_view.h"

namespace felt {
namespace {

namespace fs = std::filesystem;

constexpr int kPictureStep = 6;  // pictures 1, 7, 13, ... have depth
constexpr double kVisionAccuracy = 0.7;
// The camera is not published. What matters here is only that neighbours in the picture are neighbours on the surface.
constexpr double kFocalPixels = 557, kDepthScale = 10000, kVoxelM = 0.004;

struct Reading {
  int picture = 0;
  uint16_t label = 0;  ///< in the label image
  double value = 0;
};

struct Recording {
  std::map<uint16_t, std::string> materials;
  std::vector<Reading> readings;
};

std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells;
  std::istringstream stream(line);
  for (std::string cell; std::getline(stream, cell, ',');) cells.push_back(cell);
  return cells;
}

Recording read_recording(const fs::path& folder) {
  Recording recording;
  std::ifstream csv(folder / "friction_measurements.csv");
  std::string line;
  std::getline(csv, line);
  while (std::getline(csv, line)) {
    const std::vector<std::string> cells = cells_of(line);
    const auto label = uint16_t(std::stoi(cells.at(1)));
    recording.materials[label] = cells.at(2);
    recording.readings.push_back({std::stoi(cells.at(0)), label, std::stod(cells.at(3))});
  }
  return recording;
}

/// Samples were recorded alone, then in pairs, in threes and in fours: readings of one session may have more in common
/// than others.
std::map<int, int> sessions(const Recording& recording) {
  std::map<int, int> samples;
  for (const Reading& r : recording.readings) ++samples[r.picture];
  return samples;
}

Property fitted_friction(const Recording& recording, std::vector<PriorFit>& fits) {
  const std::map<int, int> session = sessions(recording);
  Property friction;
  friction.name = "friction";
  friction.support_lo = 0;
  for (const auto& [label, material] : recording.materials) {
    std::map<int, std::vector<double>> by_session;
    for (const Reading& r : recording.readings)
      if (r.label == label && r.picture % kPictureStep != 1) by_session[session.at(r.picture)].push_back(r.value);
    GroupedReadings groups;
    for (const auto& [samples, values] : by_session) groups.push_back(values);
    fits.push_back(*fit_prior(groups));
    friction.priors[material] = {fits.back().mean, fits.back().sd, fits.back().nu_0};
  }
  friction.rho = pooled_rho(fits).value_or(0.5);
  return friction;
}

Image<uint16_t> read_image(const fs::path& path) {
  const std::string bytes = read_whole_file(path, size_t(1) << 24);
  return decode_gray16({reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()}, path.string());
}

struct Picture {
  int number = 0;
  DepthImage depth_m;
  Image<uint16_t> labels;
  std::vector<Reading> readings;
};

std::vector<Picture> read_pictures(const fs::path& folder, const Recording& recording) {
  std::vector<Picture> pictures;
  for (int number = 1; number < 200; number += kPictureStep) {
    char name[64];
    std::snprintf(name, sizeof name, "_%08d.png", number);
    const fs::path depth = folder / "images" / ("image_DEPTH" + std::string(name)),
                   labels = folder / "labels" / ("label" + std::string(name));
    if (!fs::exists(depth)) continue;
    Picture picture;
    picture.number = number;
    const Image<uint16_t> raw = read_image(depth);
    picture.depth_m = DepthImage(raw.width(), raw.height());
    for (int v = 0; v < raw.height(); ++v)
      for (int u = 0; u < raw.width(); ++u) picture.depth_m(u, v) = float(raw(u, v) / kDepthScale);
    picture.labels = read_image(labels);
    for (const Reading& r : recording.readings)
      if (r.picture == number) picture.readings.push_back(r);
    pictures.push_back(std::move(picture));
  }
  return pictures;
}

/// Pixel of a sample that is farthest from everything else (two passes of a chessboard distance transform).
std::optional<Eigen::Vector2i> deepest_pixel(const Image<uint16_t>& labels, uint16_t label) {
  Image<uint16_t> distance(labels.width(), labels.height());
  const auto at = [&](int u, int v) {
    return u < 0 || v < 0 || u >= labels.width() || v >= labels.height() ? uint16_t(0) : distance(u, v);
  };
  for (int v = 0; v < labels.height(); ++v)
    for (int u = 0; u < labels.width(); ++u)
      distance(u, v) = labels(u, v) != label
                           ? uint16_t(0)
                           : uint16_t(1 + std::min({at(u - 1, v), at(u - 1, v - 1), at(u, v - 1), at(u + 1, v - 1)}));
  std::optional<Eigen::Vector2i> deepest;
  uint16_t most = 0;
  for (int v = labels.height() - 1; v >= 0; --v)
    for (int u = labels.width() - 1; u >= 0; --u) {
      if (labels(u, v) != label) continue;
      distance(u, v) = std::min<uint16_t>(
          distance(u, v), uint16_t(1 + std::min({at(u + 1, v), at(u + 1, v + 1), at(u, v + 1), at(u - 1, v + 1)})));
      if (distance(u, v) > most) most = distance(u, v), deepest = Eigen::Vector2i(u, v);
    }
  return deepest;
}

/// Class table of the materials; what lies between the samples is not known to any network.
ClassTable class_table(const Recording& recording) {
  std::vector<ClassInfo> classes{{0, "none", {}, true}};
  for (const auto& [label, material] : recording.materials)
    classes.push_back({uint16_t(classes.size()), material, default_class_color(int(classes.size()) - 1), false});
  return ClassTable(classes);
}

struct Sample {
  Reading reading;
  Eigen::Vector2i pixel;
  int slot = 0;  ///< true class
};

/// A picture as a map whose samples carry the labels that a network gave them.
Map map_of(const Picture& picture, const ClassTable& classes, const Property& friction,
           const std::map<uint16_t, int>& seen_slot, Frame& frame) {
  Map map(kVoxelM, 4 * kVoxelM);
  map.classes = classes;
  map.properties = PropertyTable({friction});
  frame.camera = {kFocalPixels,
                  kFocalPixels,
                  picture.depth_m.width() / 2.0,
                  picture.depth_m.height() / 2.0,
                  picture.depth_m.width(),
                  picture.depth_m.height()};
  frame.depth_m = picture.depth_m;
  frame.labels = LabelImage(picture.labels.width(), picture.labels.height());
  for (int v = 0; v < picture.labels.height(); ++v)
    for (int u = 0; u < picture.labels.width(); ++u) {
      const auto seen = seen_slot.find(picture.labels(u, v));
      frame.labels(u, v) = seen == seen_slot.end() ? uint16_t(0) : classes.at_slot(seen->second).id;
    }
  IntegrationConfig config;
  const double k = classes.size();
  config.labels.evidence = float((k * kVisionAccuracy - 1) / (1 - kVisionAccuracy));  // belief kVisionAccuracy
  IntegrationScratch scratch;
  integrate(map, frame, config, scratch);
  return map;
}

struct Score {
  double voxels = 0, right = 0;   ///< labelled voxels of touched samples
  double samples = 0, error = 0;  ///< of the expected next reading at the contact, absolute, summed
  int touched = 0, refused = 0;
  double leaked = 0, region_voxels = 0;  ///< voxels of regions that lie on another sample or between samples
};

/// True label under a voxel, by its projection; 0 outside the picture.
uint16_t label_under(const Picture& picture, const PinholeCamera& camera, const Index3& v) {
  const Eigen::Vector3d p = Eigen::Vector3d(v.x, v.y, v.z) * kVoxelM;
  const Eigen::Vector2d uv = camera.project(p);
  const int u = int(std::lround(uv.x())), w = int(std::lround(uv.y()));
  return u < 0 || w < 0 || u >= picture.labels.width() || w >= picture.labels.height() ? uint16_t(0)
                                                                                       : picture.labels(u, w);
}

/// Counts right classes of the voxels that carry evidence and lie on a touched sample.
void count_right(const Map& map, const Picture& picture, const PinholeCamera& camera,
                 const std::map<uint16_t, int>& true_slot, Score& score) {
  const std::vector<TouchView> views = touch_views(map);
  for (const Block& block : map.store.blocks()) {
    if (block.evidence.empty()) continue;
    const Index3 f = first_voxel(block.coord);
    for (int i = 0; i < kBlockVoxels; ++i) {
      const Index3 o = voxel_of_offset(i), v{f.x + o.x, f.y + o.y, f.z + o.z};
      const ClassBelief belief = class_belief_at(map, views, v);
      if (belief.slot == ClassTable::kNoSlot) continue;
      const auto truth = true_slot.find(label_under(picture, camera, v));
      if (truth == true_slot.end()) continue;
      score.voxels += 1;
      score.right += belief.slot == truth->second;
    }
  }
}

double expected_friction(const Map& map, const Sample& sample, const Frame& frame) {
  Beliefs beliefs(map);
  const double depth = double(frame.depth_m(sample.pixel.x(), sample.pixel.y()));
  const Contact contact =
      find_contact(map, frame.camera.ray(sample.pixel.x(), sample.pixel.y()) * depth, RegionSettings{});
  return mean(beliefs.at(contact.voxel).next_reading[0]).value();
}

int run(int draws) {
  const fs::path folder = bench::recorded("smdra_friction");
  const Recording recording = read_recording(folder);
  std::vector<PriorFit> fits;
  const Property friction = fitted_friction(recording, fits);
  const ClassTable classes = class_table(recording);
  const std::vector<Picture> pictures = read_pictures(folder, recording);
  std::printf(
      "Priors from the pictures without depth\n\n| material | readings | mean | sd | nu_0 |\n|---|---|---|---|---|\n");
  size_t m = 0;
  for (const auto& [label, material] : recording.materials) {
    std::printf("| %s | %zu | %.4f | %.4f | %.0f |\n", material.c_str(), fits[m].readings, fits[m].mean, fits[m].sd,
                fits[m].nu_0);
    ++m;
  }
  std::printf("\nrho (sessions): %.3f\n\n", friction.rho);

  std::map<uint16_t, double> mean_elsewhere;
  for (const auto& [label, material] : recording.materials) mean_elsewhere[label] = friction.priors.at(material).mean;
  Score before, after[2];
  for (const Picture& picture : pictures)
    for (int draw = 0; draw < draws; ++draw) {
      std::mt19937 rng(uint32_t(1000 * draw + picture.number));
      std::map<uint16_t, int> seen_slot, true_slot;
      std::vector<Sample> samples;
      for (const Reading& r : picture.readings) {
        const int slot = *classes.slot_of_name(recording.materials.at(r.label)), k = classes.size();
        const bool right = std::uniform_real_distribution<double>()(rng) < kVisionAccuracy;
        seen_slot[r.label] = right ? slot : (slot + 1 + int(rng() % uint32_t(k - 1))) % k;
        const auto pixel = deepest_pixel(picture.labels, r.label);
        if (!pixel || !(picture.depth_m(pixel->x(), pixel->y()) > 0)) continue;
        true_slot[r.label] = slot;
        samples.push_back({r, *pixel, slot});
      }
      Frame frame;
      const Map untouched = map_of(picture, classes, friction, seen_slot, frame);
      count_right(untouched, picture, frame.camera, true_slot, before);
      for (const Sample& sample : samples) {
        before.samples += 1;
        before.error += std::abs(expected_friction(untouched, sample, frame) - mean_elsewhere.at(sample.reading.label));
      }
      for (const RegionRule rule : {RegionRule::connected, RegionRule::mask}) {
        Frame again;
        Map map = map_of(picture, classes, friction, seen_slot, again);
        Score& score = after[rule == RegionRule::mask];
        for (const Sample& sample : samples) {
          TouchRequest request;
          request.property = "friction";
          request.value = sample.reading.value;
          request.region.rule = rule;
          request.point_m = frame.camera.ray(sample.pixel.x(), sample.pixel.y()) *
                            double(frame.depth_m(sample.pixel.x(), sample.pixel.y()));
          ViewMask view{Image<uint8_t>(picture.labels.width(), picture.labels.height()), frame.camera, {}};
          view.T_world_camera.setIdentity();
          for (int v = 0; v < picture.labels.height(); ++v)
            for (int u = 0; u < picture.labels.width(); ++u)
              view.mask(u, v) = picture.labels(u, v) == sample.reading.label;
          try {
            const Touch touch = resolve_touch(map, request, &view);
            for (size_t b = 0; b < touch.region.blocks(); ++b)
              for_each_bit(touch.region.mask[b], [&](int i) {
                const Index3 f = first_voxel(touch.region.coord[b]), o = voxel_of_offset(i);
                score.region_voxels += 1;
                score.leaked +=
                    label_under(picture, frame.camera, {f.x + o.x, f.y + o.y, f.z + o.z}) != sample.reading.label;
              });
            add_touch(map, touch);
            ++score.touched;
          } catch (const TouchError& error) {
            ++score.refused;
            std::fprintf(stderr, "picture %d: %s\n", picture.number, error.what());
          }
        }
        count_right(map, picture, frame.camera, true_slot, score);
        for (const Sample& sample : samples) {
          score.samples += 1;
          score.error += std::abs(expected_friction(map, sample, frame) - mean_elsewhere.at(sample.reading.label));
        }
      }
    }
  std::printf("%zu pictures, %d draws of their labels each\n\n", pictures.size(), draws);
  std::printf(
      "| | touches | refused | region voxels on other material | voxels with the right class | error of the expected "
      "friction |\n|---|---|---|---|---|---|\n");
  const auto row = [](const char* name, const Score& s) {
    std::printf("| %s | %d | %d | %.2f %% | %.1f %% | %.4f |\n", name, s.touched, s.refused,
                s.region_voxels > 0 ? 100 * s.leaked / s.region_voxels : 0.0, 100 * s.right / s.voxels,
                s.error / s.samples);
  };
  row("before", before);
  row("after, region connected", after[0]);
  row("after, region from the mask", after[1]);
  const bool holds = after[0].right / after[0].voxels > before.right / before.voxels &&
                     after[0].error / after[0].samples < before.error / before.samples;
  if (!holds) std::printf("FAILED: touching made it worse\n");
  return holds ? 0 : 1;
}

}  // namespace
}  // namespace felt

int main(int argc, char** argv) { return felt::run(argc > 1 ? std::atoi(argv[1]) : 10); }
