#include "io/readings/friction_log.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <tuple>
#include <utility>

#include "core/error.h"
#include "core/median.h"
#include "core/text.h"
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

namespace {

/// Forces along the normal and across it, the first turned so that the strongest presses.
void project(const std::vector<Eigen::Vector3d>& force, const Eigen::Vector3d& normal, FrictionReading& out) {
  out.normal_n.clear();
  out.tangential_n.clear();
  for (const Eigen::Vector3d& f : force) {
    out.normal_n.push_back(f.dot(normal));
    out.tangential_n.push_back((f - f.dot(normal) * normal).norm());
  }
  // Sensors differ in whether they report the force on the surface or on the tool.
  const auto [least, most] = std::minmax_element(out.normal_n.begin(), out.normal_n.end());
  if (-*least > *most)
    for (double& f : out.normal_n) f = -f;
}

/// Force of a log's first or last `samples`, whichever is the smaller along the normal, where it is steady there within
/// `steady_n` and less than half of the strongest: what the sensor reads before or after the contact, its tool's weight
/// perhaps, which may well exceed the normal force of a contact.
std::optional<Eigen::Vector3d> resting_force(const std::vector<Eigen::Vector3d>& force, const Eigen::Vector3d& normal,
                                             size_t samples, double steady_n) {
  if (2 * samples > force.size()) return std::nullopt;
  double strongest = 0;
  for (const Eigen::Vector3d& f : force) strongest = std::max(strongest, std::abs(f.dot(normal)));
  std::optional<Eigen::Vector3d> least;
  for (const size_t first : {size_t(0), force.size() - samples}) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (size_t i = first; i < first + samples; ++i) {
      sum += force[i];
      low = std::min(low, force[i].dot(normal));
      high = std::max(high, force[i].dot(normal));
    }
    const Eigen::Vector3d mean = sum / double(samples);
    if (high - low < steady_n && std::abs(mean.dot(normal)) < 0.5 * strongest &&
        (!least || std::abs(mean.dot(normal)) < std::abs(least->dot(normal))))
      least = mean;
  }
  return least;
}

/// The longest contact. Throws FormatError where there is none.
void find_contact_in(FrictionReading& out, double contact_n) {
  const double strongest = *std::max_element(out.normal_n.begin(), out.normal_n.end());
  if (!(strongest > 1e-6))
    throw FormatError(describe_mismatch("force log", "normal force", "some", "none along the given normal"));
  std::tie(out.contact_begin, out.contact_end) =
      longest_run(0, out.normal_n.size(), [&](size_t i) { return out.normal_n[i] >= contact_n; });
  if (out.contact_end - out.contact_begin < kFewestSamples)
    throw FormatError(describe_mismatch("force log", "contact",
                                        "at least " + std::to_string(kFewestSamples) +
                                            " samples with a normal force of " + number_text(contact_n) + " N",
                                        "at most " + number_text(strongest) + " N"));
}

/// What a sensor reads without contact, and how much it wavers: of samples that are `apart` from every contact.
struct Idle {
  Eigen::Vector3d offset_n = Eigen::Vector3d::Zero();
  double wavers_n = 0;  ///< root mean square across the normal
};

std::optional<Idle> idle_of(const std::vector<Eigen::Vector3d>& force, const Eigen::Vector3d& normal,
                            const FrictionReading& reading, double contact_n, size_t apart) {
  std::vector<size_t> samples;
  for (size_t i = 0; i < force.size(); ++i) {
    const size_t from = i > apart ? i - apart : 0, to = std::min(force.size(), i + apart + 1);
    if (std::all_of(reading.normal_n.begin() + std::ptrdiff_t(from), reading.normal_n.begin() + std::ptrdiff_t(to),
                    [&](double f) { return f < contact_n; }))
      samples.push_back(i);
  }
  if (samples.size() < kFewestSamples) return std::nullopt;
  Idle idle;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const size_t i : samples) values.push_back(force[i][axis]);
    idle.offset_n[axis] = median(std::move(values));
  }
  double squares = 0;
  for (const size_t i : samples) {
    const Eigen::Vector3d f = force[i] - idle.offset_n;
    squares += (f - f.dot(normal) * normal).squaredNorm();
  }
  idle.wavers_n = std::sqrt(squares / double(samples.size()));
  return idle;
}

/// The level near which, within a twentieth, most of these lie; of equals the highest.
double commonest(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  double best = values.back();
  size_t most = 0, last = 0;
  for (size_t first = 0; first < values.size(); ++first) {
    while (last < values.size() && values[last] <= values[first] * 1.1) ++last;
    if (last - first >= most) most = last - first, best = values[first + (last - first) / 2];
  }
  return best;
}

/// Change over the samples [begin, end) of the line that fits them best.
double trend(const std::vector<double>& values, size_t begin, size_t end) {
  const double n = double(end - begin), middle = (n - 1) / 2;
  double products = 0, squares = 0;
  for (size_t i = begin; i < end; ++i) {
    const double t = double(i - begin) - middle;
    products += t * values[i];
    squares += t * t;
  }
  return products / squares * (n - 1);
}

/// Samples [begin, end) of steady sliding, its ends left out.
struct Slide {
  size_t begin = 0, end = 0;
};

Slide slide_of(const FrictionReading& reading, size_t firm_begin, size_t firm_end, double wavers_n, size_t smear) {
  const auto none = [](const std::string& found) {
    throw FormatError(describe_mismatch(
        "force log", "sliding", "at least " + std::to_string(kFewestSamples) + " samples of steady F_t/F_n in contact",
        found));
  };
  const std::vector<double>& ratio = reading.ratio;
  std::vector<double> loaded;
  const double highest =
      *std::max_element(ratio.begin() + std::ptrdiff_t(firm_begin), ratio.begin() + std::ptrdiff_t(firm_end));
  for (size_t i = firm_begin; i < firm_end; ++i)
    if (ratio[i] >= 0.5 * highest) loaded.push_back(ratio[i]);
  const double level = commonest(loaded);
  if (!(level > 1e-6)) none("none");
  std::vector<double> away;
  for (const double r : loaded)
    if (std::abs(r - level) <= 0.25 * level) away.push_back(std::abs(r - level));
  const double within = std::clamp(3 * 1.4826 * median(away), 0.1 * level, 0.25 * level);
  Slide slide;
  std::tie(slide.begin, slide.end) =
      longest_run(firm_begin, firm_end, [&](size_t i) { return std::abs(ratio[i] - level) <= within; });
  // A ramp enters and leaves the band at its edges, a plateau at its level.
  while (slide.begin < slide.end && ratio[slide.begin] < level) ++slide.begin;
  while (slide.begin < slide.end && ratio[slide.end - 1] < level) --slide.end;
  const auto long_enough = [&] { return slide.begin + kFewestSamples <= slide.end; };
  if (!long_enough()) none("none");
  // The plateau's ends still hold the break-away and the release, smeared by the filter.
  const size_t margin = std::min((slide.end - slide.begin) / 8, smear);
  slide.begin += margin;
  slide.end -= margin;
  if (!long_enough()) none("none");
  // Any ramp passes through the band somewhere.
  if (20 * (slide.end - slide.begin) < firm_end - firm_begin)
    none("a twentieth of the contact's " + std::to_string(firm_end - firm_begin) + " samples or less, " +
         std::to_string(slide.end - slide.begin));
  if (const double change = std::abs(trend(ratio, slide.begin, slide.end)); change > within)
    none("F_t/F_n that changes by " + number_text(change) + " about " + number_text(level) +
         ": loaded, but not sliding");
  double tangential = 0;
  for (size_t i = slide.begin; i < slide.end; ++i) tangential += reading.tangential_n[i];
  tangential /= double(slide.end - slide.begin);
  if (tangential < 2 * wavers_n)
    none("a tangential force of " + number_text(tangential) + " N where the sensor wavers by " + number_text(wavers_n) +
         " N without contact");
  return slide;
}

}  // namespace

FrictionReading friction_reading(const ForceLog& log, const FrictionSettings& settings) {
  const size_t n = log.time_s.size();
  const double length = settings.normal.norm();
  if (!(length > 0) || !std::isfinite(length))
    throw ConfigError(
        describe_mismatch("force log", "normal", "a direction", "a vector of length " + number_text(length)));
  if (!(settings.contact_n > 0) || !std::isfinite(settings.contact_n))
    throw ConfigError(
        describe_mismatch("force log", "contact force", "a positive number", number_text(settings.contact_n)));
  std::vector<double> steps;
  for (size_t i = 1; i < n; ++i) steps.push_back(log.time_s[i] - log.time_s[i - 1]);
  const double rate_hz = 1 / median(steps);
  if (!(settings.cutoff_hz > 0) || settings.cutoff_hz >= rate_hz / 2)
    throw ConfigError(describe_mismatch("--cutoff", "frequency",
                                        "between 0 and half the rate of the log, " + number_text(rate_hz) + " Hz",
                                        number_text(settings.cutoff_hz)));

  const Eigen::Vector3d normal = settings.normal / length;
  std::vector<Eigen::Vector3d> force(n);
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> samples;
    for (const Eigen::Vector3d& f : log.force_n) samples.push_back(f[axis]);
    samples = low_pass_zero_phase(samples, rate_hz, settings.cutoff_hz);
    for (size_t i = 0; i < n; ++i) force[i][axis] = samples[i];
  }

  FrictionReading out;
  const auto smear = size_t(std::ceil(0.5 * rate_hz / settings.cutoff_hz));
  const auto take_off = [&](const Eigen::Vector3d& offset_n) {
    out.offset_n += offset_n;
    for (Eigen::Vector3d& f : force) f -= offset_n;
  };
  if (const auto resting = resting_force(force, normal, std::max(kFewestSamples, 2 * smear), settings.contact_n))
    take_off(*resting);
  project(force, normal, out);
  find_contact_in(out, settings.contact_n);
  const std::optional<Idle> idle = idle_of(force, normal, out, settings.contact_n, 2 * smear);
  if (idle) {
    take_off(idle->offset_n);
    project(force, normal, out);
    find_contact_in(out, settings.contact_n);
  }
  out.ratio.assign(n, std::numeric_limits<double>::quiet_NaN());
  for (size_t i = out.contact_begin; i < out.contact_end; ++i) out.ratio[i] = out.tangential_n[i] / out.normal_n[i];

  // Touch-down and lift-off divide by forces near zero: only where the contact is firm does the ratio mean something.
  const auto at = [&](size_t i) { return out.normal_n.begin() + std::ptrdiff_t(i); };
  const double firm_n = 0.5 * median({at(out.contact_begin), at(out.contact_end)});
  const auto [firm_begin, firm_end] =
      longest_run(out.contact_begin, out.contact_end, [&](size_t i) { return out.normal_n[i] >= firm_n; });
  const Slide slide = slide_of(out, firm_begin, firm_end, idle ? idle->wavers_n : 0, smear);
  out.slide_begin = slide.begin;
  out.slide_end = slide.end;
  double sum = 0, squares = 0;
  const double count = double(out.slide_end - out.slide_begin);
  for (size_t i = out.slide_begin; i < out.slide_end; ++i) sum += out.ratio[i];
  out.kinetic_mean = sum / count;
  for (size_t i = out.slide_begin; i < out.slide_end; ++i)
    squares += (out.ratio[i] - out.kinetic_mean) * (out.ratio[i] - out.kinetic_mean);
  out.kinetic_sd = std::sqrt(squares / (count - 1));
  out.peak = firm_begin;
  for (size_t i = firm_begin; i <= out.slide_begin; ++i)
    if (out.ratio[i] > out.ratio[out.peak]) out.peak = i;
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
