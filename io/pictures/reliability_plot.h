#pragma once

#include <vector>

#include "io/pictures/plot_svg.h"
#include "mapping/evaluation/evaluate_predictions.h"

namespace felt {

/// Reliability diagram: accuracy against confidence by bin, and the share of predictions in each bin.
std::vector<Plot> reliability_plots(const CalibrationScores& scores);

}  // namespace felt
