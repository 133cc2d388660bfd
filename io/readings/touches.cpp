#include "io/readings/touches.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <limits>
#include <map>
#include <utility>

#include "core/text.h"
#include "io/files/text_input.h"

namespace felt {
namespace {

/// Column numbers by name, from the header line.
class Columns {
public:
  Columns(const std::vector<std::string>& names, const std::string& where, std::vector<std::string>& problems) {
    for (size_t i = 0; i < names.size(); ++i)
      if (!at_.emplace(names[i], i).second)
        problems.push_back(describe_mismatch(where, "header", "each column once", "'" + names[i] + "' twice"));
    std::vector<std::string> missing;
    const auto need = [&](bool good, const char* what) {
      if (!good) missing.emplace_back(what);
    };
    need(has("stamp") || has("frame"), "a column stamp or frame");
    need((has("x") && has("y") && has("z")) || (has("u") && has("v")), "columns x, y, z or u, v");
    need(has("property"), "a column property");
    need(has("value"), "a column value");
    if (!missing.empty()) problems.push_back(describe_mismatch(where, "header", listed(missing), "none"));
    // Columns of one's own are welcome, but a reading must not become exact for a slip of the pen.
    if (!has("sigma"))
      for (const std::string& name : names)
        if (!nearest_word(name, {"sigma"}).empty())
          problems.push_back(describe_mismatch(where, "header", "'sigma'", "'" + name + "'"));
  }
  bool has(const std::string& name) const { return at_.contains(name); }
  size_t operator[](const std::string& name) const { return at_.at(name); }
  size_t size() const { return at_.size(); }

private:
  std::map<std::string, size_t> at_;
};

RecordedTouch parse_row(const std::vector<std::string>& cells, const Columns& columns, const std::string& where,
                        std::vector<std::string>& problems) {
  RecordedTouch touch;
  const auto real = [&](const char* name) {
    const std::string& cell = cells[columns[name]];
    const auto value = parse_number(cell);
    if (!value) problems.push_back(describe_mismatch(where, name, "a number", "'" + cell + "'"));
    return value.value_or(0.0);
  };
  if (columns.has("stamp")) touch.stamp_s = real("stamp");
  if (columns.has("frame")) {
    touch.frame = parse_integer(cells[columns["frame"]]);
    if (!touch.frame)
      problems.push_back(describe_mismatch(where, "frame", "a frame number", "'" + cells[columns["frame"]] + "'"));
  }
  const auto all = [](std::initializer_list<const char*> names, auto good) {
    return std::all_of(names.begin(), names.end(), good);
  };
  const auto named = [&](const char* name) { return columns.has(name); };
  const auto blank = [&](const char* name) { return cells[columns[name]].empty(); };
  const bool points = all({"x", "y", "z"}, named), pixels = all({"u", "v"}, named);
  if (points && !(pixels && all({"x", "y", "z"}, blank)))
    touch.point_m = Eigen::Vector3d(real("x"), real("y"), real("z"));
  else
    touch.pixel = Eigen::Vector2d(real("u"), real("v"));
  touch.property = cells[columns["property"]];
  touch.value = real("value");
  if (columns.has("sigma") && !cells[columns["sigma"]].empty()) touch.sigma = real("sigma");
  return touch;
}

/// World point under a pixel of a frame: its depth there, back-projected.
Eigen::Vector3d point_under(const Frame& frame, const Eigen::Vector2d& uv) {
  const double u = std::floor(uv.x() + 0.5), v = std::floor(uv.y() + 0.5);
  const auto at = [](double x, double y) { return "(" + std::to_string(int(x)) + ", " + std::to_string(int(y)) + ")"; };
  if (!(u >= 0 && v >= 0 && u < frame.depth_m.width() && v < frame.depth_m.height()))
    throw TouchError(describe_mismatch("touch", "pixel",
                                       "one inside the image of " + at(frame.depth_m.width(), frame.depth_m.height()),
                                       std::abs(u) < 1e9 && std::abs(v) < 1e9 ? at(u, v) : "one far outside"));
  const double depth = double(frame.depth_m(int(u), int(v)));
  if (!(depth > 0) || !std::isfinite(depth))
    throw TouchError(describe_mismatch("touch", "pixel " + at(u, v), "a measured depth", "none"));
  return frame.T_world_camera * (frame.camera.ray(uv.x(), uv.y()) * depth);
}

std::string seconds_text(double seconds) { return number_text(seconds, "%.6f"); }

/// The place of a touch's frame among the sequence's: that with its number, or the one nearest to its stamp.
size_t place_of(const RecordedTouch& touch, const TouchedSequence& sequence) {
  const std::vector<FrameName>& frames = sequence.frames;
  const auto outside = [&](const char* what, const std::string& first, const std::string& last,
                           const std::string& found) {
    throw TouchError(describe_mismatch("touch", what, "one of the sequence, " + first + " to " + last, found));
  };
  if (touch.frame) {
    const auto at =
        std::find_if(frames.begin(), frames.end(), [&](const FrameName& f) { return f.index == *touch.frame; });
    const auto [first, last] = std::minmax_element(
        frames.begin(), frames.end(), [](const FrameName& a, const FrameName& b) { return a.index < b.index; });
    if (at == frames.end())
      outside("frame", std::to_string(first->index), std::to_string(last->index), std::to_string(*touch.frame));
    return size_t(at - frames.begin());
  }
  const auto [first, last] = std::minmax_element(
      frames.begin(), frames.end(), [](const FrameName& a, const FrameName& b) { return a.stamp_s < b.stamp_s; });
  constexpr double kRoundingS = 1e-6;  // stamps are written with as many digits
  const double stamp_s = *touch.stamp_s;
  if (!(stamp_s >= first->stamp_s - kRoundingS && stamp_s <= last->stamp_s + kRoundingS))
    outside("stamp", seconds_text(first->stamp_s), seconds_text(last->stamp_s), seconds_text(stamp_s));
  const auto distance = [&](const FrameName& f) { return std::abs(f.stamp_s - stamp_s); };
  const auto nearest = std::min_element(
      frames.begin(), frames.end(), [&](const FrameName& a, const FrameName& b) { return distance(a) < distance(b); });
  return size_t(nearest - frames.begin());
}

/// First and last of the frames that a map was made of.
struct FusedSpan {
  int64_t first = std::numeric_limits<int64_t>::max(), last = std::numeric_limits<int64_t>::min();
};

FusedSpan fused_span(const FrameJournal& journal) {
  FusedSpan span;
  for (const FusedFrames& run : journal.runs)
    for (const int64_t frame : run.frames)
      span.first = std::min(span.first, frame), span.last = std::max(span.last, frame);
  return span;
}

/// For a touch without its sequence: throws where it cannot have been recorded with the frames of the map.
void require_recorded_within(const FusedSpan& span, const RecordedTouch& touch) {
  if (!touch.frame || span.first > span.last || (*touch.frame >= span.first && *touch.frame <= span.last)) return;
  throw TouchError(describe_mismatch(
      "touch", "frame", "one of the map's, " + std::to_string(span.first) + " to " + std::to_string(span.last),
      std::to_string(*touch.frame)));
}

/// What a recorded touch asks of the map.
struct Resolved {
  TouchRequest request;
  std::optional<ViewMask> view;  ///< for the rule `mask`
};

Resolved resolved(const RecordedTouch& touch, const TouchRequest& defaults, const TouchedSequence* sequence) {
  Resolved out{defaults, std::nullopt};
  TouchRequest& request = out.request;
  request.property = touch.property;
  request.value = touch.value;
  request.sigma = touch.sigma;
  if (touch.point_m) request.point_m = *touch.point_m;
  if (sequence == nullptr) {
    request.stamp_s = touch.stamp_s ? *touch.stamp_s : double(*touch.frame);
    if (!touch.point_m) throw TouchError("touch: expected a world point x, y, z, found a pixel without its sequence");
    return out;
  }
  request.stamp_s = stamp_of(touch, *sequence);
  if (touch.point_m) return out;
  const std::optional<Frame> frame = sequence->read(place_of(touch, *sequence));
  if (!frame) throw TouchError("touch: expected a readable frame at its stamp, found none");
  request.point_m = point_under(*frame, *touch.pixel);
  if (request.region.rule == RegionRule::mask) out.view = segment_mask(*frame, *touch.pixel, sequence->segments);
  return out;
}

}  // namespace

std::vector<RecordedTouch> parse_touches(const std::string& text, const std::string& where) {
  std::vector<std::string> problems;
  std::vector<RecordedTouch> touches;
  std::optional<Columns> columns;
  char separator = ',';
  for (LineReader lines(text, where); lines.next();) {
    if (!columns) separator = csv_separator(lines.line());
    const std::vector<std::string> cells = csv_cells(lines.line(), separator);
    if (!columns) {
      columns.emplace(cells, lines.where(), problems);
      if (!problems.empty()) break;
    } else if (cells.size() != columns->size()) {
      problems.push_back(
          describe_mismatch(lines.where(), "cells", std::to_string(columns->size()), std::to_string(cells.size())));
    } else {
      touches.push_back(parse_row(cells, *columns, lines.where(), problems));
      touches.back().line = int(lines.number());
    }
  }
  if (!columns) problems.push_back(describe_mismatch(where, "touches", "a header line", "an empty file"));
  if (!problems.empty()) throw FormatError(first_of(problems));
  return touches;
}

std::vector<RecordedTouch> read_touches(const std::filesystem::path& file) {
  return parse_touches(read_file_or_pipe(file), file.string());
}

TouchedSequence touched_sequence(const SequenceReader& reader) {
  TouchedSequence sequence;
  for (int64_t i = 0; i < reader.size(); ++i) sequence.frames.push_back(reader.name(i));
  sequence.read = [&reader](size_t place) -> std::optional<Frame> {
    ReadResult result = reader.read(int64_t(place));
    if (Frame* frame = std::get_if<Frame>(&result)) return std::move(*frame);
    return std::nullopt;
  };
  return sequence;
}

double stamp_of(const RecordedTouch& touch, const TouchedSequence& sequence) {
  const size_t place = place_of(touch, sequence);
  return touch.stamp_s ? *touch.stamp_s : sequence.frames[place].stamp_s;
}

bool same_reading(const TouchRequest& a, const TouchRequest& b) {
  return a.stamp_s == b.stamp_s && a.point_m == b.point_m && a.property == b.property && a.value == b.value &&
         a.sigma == b.sigma;
}

std::vector<TouchOutcome> apply_recorded_touches(Map& map, const std::vector<RecordedTouch>& touches,
                                                 const TouchRequest& defaults, const TouchedSequence* sequence,
                                                 KnownReadings known) {
  std::vector<TouchOutcome> outcomes;
  std::vector<TouchRequest> counted;  // before, and not yet found among the rows
  if (known == KnownReadings::leave_out)
    for (const Touch& touch : map.touches.touches)
      if (!touch.undone) counted.push_back(touch.request);
  const FusedSpan span = fused_span(map.frames);
  TouchBatch batch(map);
  for (const RecordedTouch& touch : touches) {
    TouchOutcome outcome{touch, std::nullopt, "", false};
    try {
      if (sequence == nullptr) require_recorded_within(span, touch);
      const Resolved asked = resolved(touch, defaults, sequence);
      const auto before = std::find_if(counted.begin(), counted.end(), [&](const TouchRequest& request) {
        return same_reading(request, asked.request);
      });
      outcome.already_counted = before != counted.end();
      if (outcome.already_counted)
        counted.erase(before);
      else
        outcome.effect = batch.apply(resolve_touch(map, asked.request, asked.view ? &*asked.view : nullptr));
    } catch (const Error& error) {
      outcome.refused = error.what();
    }
    outcomes.push_back(std::move(outcome));
  }
  batch.finish();
  return outcomes;
}

}  // namespace felt
