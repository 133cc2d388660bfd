#include "io/pictures/plot_svg.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>
#include <limits>

#include "io/readings/infer_plot.h"

namespace felt {
namespace {

size_t count_of(const std::string& text, const std::string& what) {
  size_t n = 0;
  for (size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++n;
  return n;
}

}  // namespace

TEST_CASE("a plot names its axes and series and keeps every coordinate finite and inside") {
  Plot plot{"title <&>", "x", "y", {}, {{0.5, "here"}}};
  plot.series.push_back({"curve", {0, 1, 2}, {0, 10, 5}});
  plot.series.push_back({"", {0, 1, 2}, {1, std::numeric_limits<double>::quiet_NaN(), 3}});
  const std::string svg = plot_svg({plot}, 1, 400, 300);
  CHECK(count_of(svg, "title &lt;&amp;&gt;") == 1);
  CHECK(count_of(svg, ">curve<") == 1);
  CHECK(count_of(svg, ">here<") == 1);
  CHECK(count_of(svg, "nan") == 0);
  // A broken curve lifts the pen: two strokes of one point each.
  CHECK(count_of(svg, "M62.0,") >= 2);
  CHECK(svg.substr(0, 4) == "<svg");
}

TEST_CASE("the ends of a curve lie on the ends of the axes") {
  Plot plot{"", "", "", {{"", {10, 20}, {0, 8}}}, {}};
  const std::string svg = plot_svg({plot}, 1, 400, 300);
  CHECK(count_of(svg, "M62.0,256.0L388.0,30.0") == 1);
}

TEST_CASE("labels of markers keep off the legend, each other and the right end") {
  Plot plot{"", "", "", {}, {{0, "contact"}, {0.1, "slip"}, {9.7, "release"}, {10, "end"}}};
  plot.series.push_back({"normal", {0, 10}, {0, 1}});
  plot.series.push_back({"tangential", {0, 10}, {1, 1}});
  const std::string svg = plot_svg({plot}, 1, 400, 300);
  struct Placed {
    double x, y;
    std::string anchor;
  };
  const auto placed = [&](const std::string& text) {
    const size_t end = svg.find('>' + text + "</text>"), begin = svg.rfind("<text", end);
    REQUIRE(end != std::string::npos);
    Placed p;
    char anchor[8] = {};
    REQUIRE(std::sscanf(svg.c_str() + begin, "<text x=\"%lf\" y=\"%lf\" text-anchor=\"%7[a-z]", &p.x, &p.y, anchor) ==
            3);
    p.anchor = anchor;
    return p;
  };
  const double line = 11;  // height of the letters
  CHECK(placed("contact").y < placed("tangential").y);
  CHECK(placed("slip").y >= placed("contact").y + line);
  CHECK(placed("release").y >= placed("tangential").y + line);
  CHECK(placed("end").y >= placed("tangential").y + line);
  CHECK(placed("end").anchor == "end");
  CHECK(placed("end").x < 388);
  CHECK(std::abs(placed("end").y - placed("release").y) >= line);
}

TEST_CASE("a logarithmic axis places decades evenly and leaves out what is not positive") {
  Plot plot{"", "", "", {{"", {1, 10, 100, -5}, {1, 1, 2, 2}}}, {}, true, false};
  const std::string svg = plot_svg({plot}, 1, 400, 300);
  CHECK(count_of(svg, "M62.0,143.0L225.0,143.0L388.0,30.0\"") == 1);
}

TEST_CASE("a logarithmic axis says so, and short ones are marked between decades too") {
  const auto drawn = [](double from, double to) {
    return plot_svg({{"", "pixels", "ms", {{"", {from, to}, {1.2, 1.9}}}, {}, true, true}}, 1, 400, 300);
  };
  const std::string svg = drawn(3, 40);
  for (const char* tick : {"5", "10", "20", "1.2", "1.4", "1.6", "1.8"}) {
    INFO(tick);
    CHECK(count_of(svg, '>' + std::string(tick) + "</text>") == 1);
  }
  CHECK(count_of(svg, ">pixels (log)<") == 1);
  CHECK(count_of(svg, ">ms (log)<") == 1);
  const std::string long_one = drawn(1, 10000);
  CHECK(count_of(long_one, ">1000</text>") == 1);
  CHECK(count_of(long_one, ">2000</text>") == 0);
}

TEST_CASE("panels fill rows, and an empty or constant plot is still a picture") {
  const Plot empty{"empty", "", "", {}, {}};
  const Plot constant{"constant", "", "", {{"", {3, 3}, {0, 0}}}, {}};
  const std::string svg = plot_svg({empty, constant, empty}, 2, 100, 100);
  CHECK(count_of(svg, "width=\"200\" height=\"200\"") == 1);
  CHECK(count_of(svg, "translate(100 0)") == 1);
  CHECK(count_of(svg, "translate(0 100)") == 1);
  CHECK(count_of(svg, "nan") + count_of(svg, "inf") == 0);
}

TEST_CASE("densities of a touch are drawn before and after it, with the names of the classes") {
  const std::vector<Plot> plots = infer_plots(
      R"({"prior": {"alpha": [1, 1], "tau": [0.39, 0.19], "kappa": [50, 50], "beta": [25, 25], "gamma": [0.126, 0.053]},
          "rho": 0.5, "psi": [0.15], "names": ["snow", "ice"]})",
      "touch");
  REQUIRE(plots.size() == 2);
  const auto ice = [](const Plot& plot) {
    const auto found = std::find_if(plot.series.begin(), plot.series.end(),
                                    [](const PlotSeries& s) { return s.name.rfind("ice ", 0) == 0; });
    REQUIRE(found != plot.series.end());
    return *found;
  };
  const PlotSeries ice_before = ice(plots[0]), ice_after = ice(plots[1]);
  CHECK(ice_before.name == "ice 0.500");
  // Before the touch both classes weigh half; afterwards the area under the density is ice's probability.
  const auto area = [](const PlotSeries& s) {
    double sum = 0;
    for (size_t i = 1; i < s.x.size(); ++i) sum += (s.x[i] - s.x[i - 1]) * (s.y[i] + s.y[i - 1]) / 2;
    return sum;
  };
  CHECK(area(ice_before) == Approx(0.5).epsilon(0.01));
  CHECK(area(ice_after) > 0.95);
  CHECK(plots[0].markers[0].x == 0.15);
}

}  // namespace felt
