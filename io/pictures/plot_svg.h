#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace felt {

/// A curve (or scattered points) in the units of its axes. Points that are not finite break the curve.
struct PlotSeries {
  enum class Style { line, dashed, points };
  std::string name;  ///< in the legend; empty: not listed
  std::vector<double> x, y;
  int color = 0;  ///< index into a cycle of 8 colours that colour-blind readers can tell apart; negative: black
  Style style = Style::line;
};

/// A vertical line with a label, for example at a reading.
struct PlotMarker {
  double x = 0;
  std::string label;
};

/// One panel with its axes.
struct Plot {
  std::string title, x_label, y_label;
  std::vector<PlotSeries> series;
  std::vector<PlotMarker> markers;
  /// Logarithmic axes, whose titles say so. Values that are not positive are left out.
  bool log_x = false, log_y = false;
};

/// Text of an SVG picture with the panels in rows of `columns`, each `panel_width` x `panel_height` pixels.
std::string plot_svg(const std::vector<Plot>& panels, int columns = 1, int panel_width = 560, int panel_height = 340);

/// Writes the picture as a whole file. Throws IoError.
void write_plot_svg(const std::filesystem::path& file, const std::vector<Plot>& panels, int columns = 1);

}  // namespace felt
