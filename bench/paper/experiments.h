#pragma once

#include <filesystem>

#include "bench/paper/checks.h"

namespace felt::paper {

struct Options {
  bool quick = false;         ///< small enough for a test: fewer regions, rooms and frames
  std::filesystem::path out;  ///< folder for pictures and plots; empty: none
};

/// Table of material labels, both protocols, and of correlated readings.
void material_labels(const Options& options, Checks& checks);
/// Five furnished rooms, ten frames each, three networks, wrong regions touched.
void room_maps(const Options& options, Checks& checks);
/// Crossing ice and pulling a door, in maps.
void situations(const Options& options, Checks& checks);
/// Recorded sequences with labels; nothing where FELTMAP_DATA has none.
void recorded_sequences(const Options& options, Checks& checks);

}  // namespace felt::paper
