#include "io/pictures/reliability_plot.h"

#include "core/text.h"

namespace felt {

std::vector<Plot> reliability_plots(const CalibrationScores& s) {
  PlotSeries bins{"bins", {}, {}, 0, PlotSeries::Style::points}, line{"", {}, {}, 0, PlotSeries::Style::line};
  PlotSeries share{"", {}, {}, 1, PlotSeries::Style::line};
  for (int i = 0; i < CalibrationScores::kBins; ++i) {
    const CalibrationScores::Bin& bin = s.bins()[size_t(i)];
    const double from = double(i) / CalibrationScores::kBins, to = double(i + 1) / CalibrationScores::kBins;
    const double height = s.count() > 0 ? double(bin.count) / double(s.count()) : 0;
    share.x.insert(share.x.end(), {from, from, to, to});
    share.y.insert(share.y.end(), {0, height, height, 0});
    if (bin.count == 0) continue;
    bins.x.push_back(bin.confidence_sum / double(bin.count));
    bins.y.push_back(double(bin.correct) / double(bin.count));
  }
  line.x = bins.x, line.y = bins.y;
  Plot reliability{
      "Reliability (ECE " + number_text(s.ece(), "%.4f") + ")", "confidence", "accuracy", {line, bins}, {}};
  reliability.series.push_back({"calibrated", {0, 1}, {0, 1}, -1, PlotSeries::Style::dashed});
  return {reliability, {"How often", "confidence", "share of predictions", {share}, {}}};
}

}  // namespace felt
