#include "io/readings/friction_log.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>
#include <tuple>
#include <utility>

#include "core/error.h"
#include "io/files/text_input.h"

namespace felt {
namespace {

constexpr size_t kFewestSamples = 16;

/// Column of each of t, fx, fy, fz.
std::vector<size_t> columns_of(const std::vector<std::string>& header, const std::string& where) {
  const std::vector<std::vector<std::string>> wanted{{"t", "time", "stamp"}, {"fx"}, {"fy"}, {"fz"}};
  std::vector<size_t> columns;
  std::string missing;
  for (const auto& names : wanted) {
    const auto at = std::find_if(header.begin(), header.end(), [&](const std::string& cell) {
      return std::find(names.begin(), names.end(), cell) != names.end();
    });
    if (at == header.end())
      missing.append(missing.empty() ? "a column " : ", a column ").append(names[0]);
    else
      columns.push_back(size_t(at - header.begin()));
  }
  if (!missing.empty()) throw FormatError(describe_mismatch(where, "header", missing, "none"));
  return columns;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + std::ptrdiff_t(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Longest run [begin, end) of indices in [from, to) where `keep` holds.
template <typename Keep>
std::pair<size_t, size_t> longest_run(size_t from, size_t to, const Keep& keep) {
  std::pair<size_t, size_t> best{from, from};
  for (size_t i = from; i < to;) {
    if (!keep(i)) {
      ++i;
      continue;
    }
    const size_t begin = i;
    while (i < to && keep(i)) ++i;
    if (i - begin > best.second - best.first) best = {begin, i};
  }
  return best;
}

/// Coefficients of the bilinear Butterworth low-pass of order 2 (Oppenheim and Schafer, Discrete-Time Signal
/// Processing, section 7.1): b0 (1 + 2 z^-1 + z^-2) / (1 + a1 z^-1 + a2 z^-2).
struct Biquad {
  double b0, a1, a2;
};

Biquad butterworth(double rate_hz, double cutoff_hz) {
  const double w = std::tan(std::numbers::pi * cutoff_hz / rate_hz), n = 1 / (1 + std::numbers::sqrt2 * w + w * w);
  return {w * w * n, 2 * (w * w - 1) * n, (1 - std::numbers::sqrt2 * w + w * w) * n};
}

/// One pass in place, from the steady state of the first sample.
void filter(const Biquad& f, std::vector<double>& x) {
  double x1 = x[0], x2 = x[0], y1 = x[0], y2 = x[0];
  for (double& value : x) {
    const double y = f.b0 * (value + 2 * x1 + x2) - f.a1 * y1 - f.a2 * y2;
    x2 = x1, x1 = value, y2 = y1, y1 = y;
    value = y;
  }
}

}  // namespace

std::vector<double> low_pass_zero_phase(const std::vector<double>& samples, double rate_hz, double cutoff_hz) {
  const size_t n = samples.size();
  // Three time constants of the filter settle the ends.
  const size_t pad = std::min(n - 1, size_t(std::ceil(rate_hz / cutoff_hz)));
  std::vector<double> x;
  for (size_t i = pad; i > 0; --i) x.push_back(2 * samples[0] - samples[i]);
  x.insert(x.end(), samples.begin(), samples.end());
  for (size_t i = 1; i <= pad; ++i) x.push_back(2 * samples[n - 1] - samples[n - 1 - i]);
  const Biquad f = butterworth(rate_hz, cutoff_hz);
  filter(f, x);
  std::reverse(x.begin(), x.end());
  filter(f, x);
  std::reverse(x.begin(), x.end());
  return {x.begin() + std::ptrdiff_t(pad), x.begin() + std::ptrdiff_t(pad + n)};
}

ForceLog parse_force_log(const std::string& text, const std::string& where) {
  ForceLog log;
  std::vector<size_t> columns;
  std::vector<std::string> problems;
  char separator = ',';
  for (LineReader lines(text, where); lines.next();) {
    const std::string at = lines.where();
    if (columns.empty()) {
      separator = csv_separator(lines.line());
      columns = columns_of(csv_cells(lines.line(), separator), at);
      continue;
    }
    const std::vector<std::string> cells = csv_cells(lines.line(), separator);
    double values[4] = {};
    bool good = true;
    for (size_t i = 0; i < 4 && good; ++i) {
      const std::string cell = columns[i] < cells.size() ? cells[columns[i]] : "";
      values[i] = parse_number(cell).value_or(std::numeric_limits<double>::quiet_NaN());
      good = std::isfinite(values[i]);
      if (!good) problems.push_back(describe_mismatch(at, "cell", "a finite number", "'" + cell.substr(0, 40) + "'"));
    }
    if (good && !log.time_s.empty() && values[0] <= log.time_s.back()) {
      problems.push_back(describe_mismatch(at, "time", "one after the line before", std::to_string(values[0])));
      good = false;
    }
    if (!good) continue;
    log.time_s.push_back(values[0]);
    log.force_n.emplace_back(values[1], values[2], values[3]);
  }
  if (columns.empty()) problems.push_back(describe_mismatch(where, "force log", "a header line", "an empty file"));
  if (problems.empty() && log.time_s.size() < kFewestSamples)
    problems.push_back(describe_mismatch(where, "samples", "at least " + std::to_string(kFewestSamples),
                                         std::to_string(log.time_s.size())));
  if (!problems.empty()) throw FormatError(first_of(problems));
  return log;
}

ForceLog read_force_log(const std::filesystem::path& file) {
  return parse_force_log(read_file_or_pipe(file), file.string());
}

FrictionReading friction_reading(const ForceLog& log, const FrictionSettings& settings) {
  const auto text = [](double x) {
    char buffer[32];
    snprintf(buffer, sizeof buffer, "%g", x);
    return std::string(buffer);
  };
  const size_t n = log.time_s.size();
  const double length = settings.normal.norm();
  if (!(length > 0) || !std::isfinite(length))
    throw ConfigError(describe_mismatch("force log", "normal", "a direction", "a vector of length " + text(length)));
  if (!(settings.contact_n > 0) || !std::isfinite(settings.contact_n))
    throw ConfigError(describe_mismatch("force log", "contact force", "a positive number", text(settings.contact_n)));
  std::vector<double> steps;
  for (size_t i = 1; i < n; ++i) steps.push_back(log.time_s[i] - log.time_s[i - 1]);
  const double rate_hz = 1 / median(steps);
  if (!(settings.cutoff_hz > 0) || settings.cutoff_hz >= rate_hz / 2)
    throw ConfigError(describe_mismatch(
        "force log", "cut-off", "between 0 and half the rate of " + text(rate_hz) + " Hz", text(settings.cutoff_hz)));

  const Eigen::Vector3d normal = settings.normal / length;
  std::vector<double> along[3];
  for (const Eigen::Vector3d& force : log.force_n)
    for (int axis = 0; axis < 3; ++axis) along[axis].push_back(force[axis]);
  for (auto& samples : along) samples = low_pass_zero_phase(samples, rate_hz, settings.cutoff_hz);

  FrictionReading out;
  double pressed = 0;
  for (size_t i = 0; i < n; ++i) {
    const Eigen::Vector3d force(along[0][i], along[1][i], along[2][i]);
    out.normal_n.push_back(force.dot(normal));
    out.tangential_n.push_back((force - force.dot(normal) * normal).norm());
    pressed += out.normal_n.back();
  }
  // Sensors differ in whether they report the force on the surface or on the tool.
  if (pressed < 0)
    for (double& f : out.normal_n) f = -f;
  const double strongest = *std::max_element(out.normal_n.begin(), out.normal_n.end());
  if (!(strongest > 1e-6))
    throw FormatError(describe_mismatch("force log", "normal force", "some", "none along the given normal"));
  std::tie(out.contact_begin, out.contact_end) =
      longest_run(0, n, [&](size_t i) { return out.normal_n[i] >= settings.contact_n; });
  if (out.contact_end - out.contact_begin < kFewestSamples)
    throw FormatError(describe_mismatch("force log", "contact",
                                        "at least " + std::to_string(kFewestSamples) +
                                            " samples with a normal force of " + text(settings.contact_n) + " N",
                                        "at most " + text(strongest) + " N"));
  out.ratio.assign(n, std::numeric_limits<double>::quiet_NaN());
  for (size_t i = out.contact_begin; i < out.contact_end; ++i) out.ratio[i] = out.tangential_n[i] / out.normal_n[i];

  // Sliding: ratios near the level that most of the loaded contact keeps. Rise, release and the filter's ends fall out.
  std::vector<double> loaded;
  const double highest = *std::max_element(out.ratio.begin() + std::ptrdiff_t(out.contact_begin),
                                           out.ratio.begin() + std::ptrdiff_t(out.contact_end));
  for (size_t i = out.contact_begin; i < out.contact_end; ++i)
    if (out.ratio[i] >= 0.5 * highest) loaded.push_back(out.ratio[i]);
  const double level = median(loaded);
  std::vector<double> away;
  for (const double r : loaded) away.push_back(std::abs(r - level));
  const double within = std::max(0.1 * level, 3 * 1.4826 * median(away));
  std::tie(out.slide_begin, out.slide_end) = longest_run(
      out.contact_begin, out.contact_end, [&](size_t i) { return std::abs(out.ratio[i] - level) <= within; });
  if (out.slide_end - out.slide_begin < kFewestSamples || !(level > 1e-6))
    throw FormatError(describe_mismatch(
        "force log", "sliding", "at least " + std::to_string(kFewestSamples) + " samples of steady F_t/F_n in contact",
        "none"));
  // The plateau's ends still hold the break-away and the release, smeared by the filter.
  const size_t margin =
      std::min((out.slide_end - out.slide_begin) / 8, size_t(std::ceil(0.5 * rate_hz / settings.cutoff_hz)));
  out.slide_begin += margin;
  out.slide_end -= margin;
  double sum = 0, squares = 0;
  const double count = double(out.slide_end - out.slide_begin);
  for (size_t i = out.slide_begin; i < out.slide_end; ++i) sum += out.ratio[i];
  out.kinetic_mean = sum / count;
  for (size_t i = out.slide_begin; i < out.slide_end; ++i)
    squares += (out.ratio[i] - out.kinetic_mean) * (out.ratio[i] - out.kinetic_mean);
  out.kinetic_sd = std::sqrt(squares / (count - 1));
  out.peak = out.contact_begin;
  const double firm_n = 0.5 * median(out.normal_n);
  for (size_t i = out.contact_begin; i < out.slide_end; ++i)
    if (out.ratio[i] > out.ratio[out.peak] && out.normal_n[i] >= firm_n) out.peak = i;
  out.static_peak = out.ratio[out.peak];
  return out;
}

std::vector<Plot> friction_plots(const ForceLog& log, const FrictionReading& reading) {
  Plot forces{"Filtered forces", "time, s", "force, N", {}, {}, false, false};
  forces.series.push_back({"normal", log.time_s, reading.normal_n, 0});
  forces.series.push_back({"tangential", log.time_s, reading.tangential_n, 1});
  const auto time = [&](size_t i) { return log.time_s[std::min(i, log.time_s.size() - 1)]; };
  forces.markers = {{time(reading.contact_begin), "contact"}, {time(reading.contact_end), "release"}};
  Plot ratio{"Tangential over normal force", "time, s", "ratio", {}, {}, false, false};
  ratio.series.push_back({"F_t/F_n", log.time_s, reading.ratio, 2});
  const double begin = time(reading.slide_begin), end = time(reading.slide_end);
  ratio.series.push_back(
      {"kinetic plateau", {begin, end}, {reading.kinetic_mean, reading.kinetic_mean}, -1, PlotSeries::Style::dashed});
  ratio.markers = {{time(reading.peak), "static peak"}};
  return {forces, ratio};
}

}  // namespace felt
