#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "io/simulation/label_network.h"
#include "io/simulation/render_sequence.h"
#include "io/simulation/touches.h"

namespace felt {

/// Everything that decides a simulated sequence.
struct SimulationSettings {
  Scene scene;
  Trajectory trajectory;
  PinholeCamera camera = simulated_camera();
  std::optional<DepthNoise> noise;  ///< none: exact depth
  LabelSet label_set = LabelSet::semantic;
  std::optional<LabelNetwork> network;  ///< none: true labels
  PropertyTable properties = simulated_properties();
  TouchOptions touches;  ///< of the first property
  uint64_t seed = 1;
  double depth_scale = 5000;  ///< depth images hold metres times this
  bool jpeg_color = false;    ///< instead of PNG
  bool with_mesh = true;
};

/// Share of each class among the pixels of the trajectory, by slot of the label set's table; from at most 32 small
/// views.
std::vector<double> class_shares(const Scene& scene, const Trajectory& trajectory, const PinholeCamera& camera,
                                 LabelSet label_set);

/// Writes the sequence in the generic layout (docs/datasets.md) with the truth beside it. The folder appears whole or
/// not at all: it is written under another name and renamed. An `out` that exists is refused unless `replace`, which
/// replaces an empty folder or an earlier simulated sequence and nothing else. `progress` is called now and then with
/// the number of frames written; where it returns false the writing stops, nothing is left, and the result is false.
/// The files do not depend on the number of threads. Throws IoError and ConfigError.
bool write_simulated_sequence(const SimulationSettings& settings, const std::filesystem::path& out, bool replace,
                              const std::function<bool(int64_t)>& progress = {});

}  // namespace felt
