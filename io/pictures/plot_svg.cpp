#include "io/pictures/plot_svg.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "io/files/atomic_file.h"

namespace felt {
namespace {

// Okabe and Ito, "Color universal design" (2008).
constexpr const char* kColors[] = {"#0072B2", "#D55E00", "#009E73", "#CC79A7",
                                   "#E69F00", "#56B4E9", "#7A7200", "#6E6E6E"};
constexpr int kLeft = 62, kRight = 12, kTop = 30, kBottom = 44;
constexpr double kLegendLine = 15;

std::string escaped(const std::string& text) {
  std::string out;
  for (char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
    }
  }
  return out;
}

std::string label_of(double value) {
  if (std::abs(value) < 1e-300) return "0";
  return fmt::format("{:.4g}", value);
}

// Values to pixels, linear or logarithmic.
class Axis {
public:
  Axis(bool logarithmic, double from_pixel, double to_pixel)
      : log_(logarithmic), from_pixel_(from_pixel), to_pixel_(to_pixel) {}

  bool shows(double value) const { return std::isfinite(value) && (!log_ || value > 0); }
  void include(double value) {
    if (!shows(value)) return;
    low_ = std::min(low_, scaled(value));
    high_ = std::max(high_, scaled(value));
  }
  /// After the last `include`: rooms of no width get some.
  void settle() {
    if (!(low_ <= high_)) low_ = 0, high_ = 1;
    if (low_ == high_) {
      const double room = low_ == 0 ? 1 : 0.1 * std::abs(low_);
      low_ -= room;
      high_ += room;
    }
  }
  double pixel(double value) const {
    return from_pixel_ + (scaled(value) - low_) / (high_ - low_) * (to_pixel_ - from_pixel_);
  }
  std::vector<double> ticks() const {
    if (!log_) return even_ticks(low_, high_);
    std::vector<double> at;
    if (high_ - low_ < 2) {
      // Decades alone would be too few.
      for (double decade = std::floor(low_); decade <= high_ + 1e-9; ++decade)
        for (const double times : {1.0, 2.0, 5.0})
          if (const double place = decade + std::log10(times); place >= low_ - 1e-9 && place <= high_ + 1e-9)
            at.push_back(times * std::pow(10, decade));
      return at.size() >= 2 ? at : even_ticks(std::pow(10, low_), std::pow(10, high_));
    }
    const double step = std::ceil((high_ - low_) / 8);
    for (double decade = std::ceil(low_ - 1e-9); decade <= high_ + 1e-9; decade += step)
      at.push_back(std::pow(10, decade));
    return at;
  }

private:
  static std::vector<double> even_ticks(double low, double high) {
    const double rough = (high - low) / 6, power = std::pow(10, std::floor(std::log10(rough)));
    double step = 10 * power;
    for (double candidate : {5.0, 2.0, 1.0})
      if (candidate * power >= rough) step = candidate * power;
    const double first = std::ceil(low / step - 1e-9);
    std::vector<double> at;
    for (int i = 0; i < 12 && (first + i) * step <= high + 1e-9 * step; ++i) at.push_back((first + i) * step);
    return at;
  }

  double scaled(double value) const { return log_ ? std::log10(value) : value; }

  bool log_;
  double from_pixel_, to_pixel_;
  double low_ = std::numeric_limits<double>::infinity(), high_ = -low_;
};

std::string text_at(double x, double y, const char* anchor, const std::string& text, const char* more = "") {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\"{}>{}</text>\n", x, y, anchor, more,
                     escaped(text));
}

std::string line_at(double x1, double y1, double x2, double y2, const char* style) {
  return fmt::format("<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" {}/>\n", x1, y1, x2, y2, style);
}

const char* color_of(const PlotSeries& s) {
  return s.color < 0 ? "#000000" : kColors[size_t(s.color) % std::size(kColors)];
}

std::string drawn(const PlotSeries& s, const Axis& x, const Axis& y) {
  const size_t n = std::min(s.x.size(), s.y.size());
  std::string out, path;
  bool pen_down = false;
  for (size_t i = 0; i < n; ++i) {
    if (!x.shows(s.x[i]) || !y.shows(s.y[i])) {
      pen_down = false;
      continue;
    }
    const double px = x.pixel(s.x[i]), py = y.pixel(s.y[i]);
    if (s.style == PlotSeries::Style::points) {
      out += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"2.5\" fill=\"{}\"/>\n", px, py, color_of(s));
    } else {
      path += fmt::format("{}{:.1f},{:.1f}", pen_down ? 'L' : 'M', px, py);
    }
    pen_down = true;
  }
  if (path.empty()) return out;
  return out + fmt::format("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.6\"{}/>\n", path, color_of(s),
                           s.style == PlotSeries::Style::dashed ? " stroke-dasharray=\"5 4\"" : "");
}

std::string legend(const Plot& plot, double right, double top) {
  std::string out;
  double y = top + 14;
  for (const PlotSeries& s : plot.series) {
    if (s.name.empty()) continue;
    out += text_at(right - 26, y, "end", s.name);
    const std::string style = fmt::format("stroke=\"{}\" stroke-width=\"2\"{}", color_of(s),
                                          s.style == PlotSeries::Style::dashed ? " stroke-dasharray=\"5 4\"" : "");
    out += line_at(right - 22, y - 4, right - 4, y - 4, style.c_str());
    y += kLegendLine;
  }
  return out;
}

/// A line of text takes this much, roughly: fonts differ.
constexpr double kCharacter = 6.2, kTextLine = 12;

struct Box {
  double left, right, top, bottom;
  bool overlaps(const Box& o) const { return left < o.right && o.left < right && top < o.bottom && o.top < bottom; }
};

Box legend_box(const Plot& plot, double right, double top) {
  size_t longest = 0, lines = 0;
  for (const PlotSeries& s : plot.series) {
    longest = std::max(longest, s.name.size());
    lines += !s.name.empty();
  }
  if (lines == 0) return {right, right, top, top};
  return {right - 26 - kCharacter * double(longest), right, top, top + 4 + kLegendLine * double(lines)};
}

/// Vertical lines with their labels, each label on the first line from the top where it covers neither the legend nor
/// another label; on the left of its line where the panel ends on the right.
std::string markers(const Plot& plot, const Axis& x, double right, double top, double bottom) {
  std::string out;
  std::vector<Box> taken{legend_box(plot, right, top)};
  for (const PlotMarker& m : plot.markers) {
    if (!x.shows(m.x)) continue;
    const double at = x.pixel(m.x), width = kCharacter * double(m.label.size());
    out += line_at(at, top, at, bottom, "stroke=\"#444444\" stroke-dasharray=\"2 3\"");
    const bool left_of_line = at + 3 + width > right;
    Box box{left_of_line ? at - 3 - width : at + 3, left_of_line ? at - 3 : at + 3 + width, top, top + kTextLine};
    while (box.bottom < bottom &&
           std::any_of(taken.begin(), taken.end(), [&](const Box& other) { return box.overlaps(other); }))
      box.top += kTextLine, box.bottom += kTextLine;
    out += text_at(left_of_line ? at - 3 : at + 3, box.top + 10, left_of_line ? "end" : "start", m.label);
    taken.push_back(box);
  }
  return out;
}

std::string panel(const Plot& plot, double width, double height) {
  const double left = kLeft, right = width - kRight, top = kTop, bottom = height - kBottom;
  Axis x(plot.log_x, left, right), y(plot.log_y, bottom, top);
  for (const PlotSeries& s : plot.series) {
    for (double value : s.x) x.include(value);
    for (double value : s.y) y.include(value);
  }
  for (const PlotMarker& m : plot.markers) x.include(m.x);
  if (!plot.log_y) y.include(0);
  x.settle();
  y.settle();

  std::string out;
  for (double at : x.ticks()) {
    out += line_at(x.pixel(at), top, x.pixel(at), bottom, "stroke=\"#e4e4e4\"");
    out += text_at(x.pixel(at), bottom + 15, "middle", label_of(at));
  }
  for (double at : y.ticks()) {
    out += line_at(left, y.pixel(at), right, y.pixel(at), "stroke=\"#e4e4e4\"");
    out += text_at(left - 5, y.pixel(at) + 4, "end", label_of(at));
  }
  out += fmt::format("<path d=\"M{:.1f},{:.1f}L{:.1f},{:.1f}L{:.1f},{:.1f}\" fill=\"none\" stroke=\"#444444\"/>\n",
                     left, top, left, bottom, right, bottom);
  out += markers(plot, x, right, top, bottom);
  for (const PlotSeries& s : plot.series) out += drawn(s, x, y);
  out += legend(plot, right, top);
  out += text_at((left + right) / 2, 18, "middle", plot.title, " font-weight=\"bold\"");
  const auto axis_title = [](const std::string& label, bool log) { return log ? label + " (log)" : label; };
  out += text_at((left + right) / 2, height - 10, "middle", axis_title(plot.x_label, plot.log_x));
  const std::string turn = fmt::format(" transform=\"rotate(-90 14 {:.1f})\"", (top + bottom) / 2);
  out += text_at(14, (top + bottom) / 2, "middle", axis_title(plot.y_label, plot.log_y), turn.c_str());
  return out;
}

}  // namespace

std::string plot_svg(const std::vector<Plot>& panels, int columns, int panel_width, int panel_height) {
  columns = std::max(1, std::min(columns, int(std::max<size_t>(1, panels.size()))));
  const int rows = int((panels.size() + size_t(columns) - 1) / size_t(columns));
  std::string out = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} {1}\" "
      "font-family=\"sans-serif\" font-size=\"11\" fill=\"#222222\">\n<rect width=\"100%\" height=\"100%\" "
      "fill=\"white\"/>\n",
      columns * panel_width, rows * panel_height);
  for (size_t i = 0; i < panels.size(); ++i) {
    out += fmt::format("<g transform=\"translate({} {})\">\n", int(i) % columns * panel_width,
                       int(i) / columns * panel_height);
    out += panel(panels[i], panel_width, panel_height) + "</g>\n";
  }
  return out + "</svg>\n";
}

void write_plot_svg(const std::filesystem::path& file, const std::vector<Plot>& panels, int columns) {
  write_file_atomically(file, plot_svg(panels, columns));
}

}  // namespace felt
