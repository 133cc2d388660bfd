#include "apps/fusion/recorded_touches.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "apps/options/run_settings.h"
#include "apps/options/touch_options.h"
#include "core/error.h"
#include "io/files/content_hash.h"
#include "io/files/text_input.h"
#include "io/sequence/open_sequence.h"
#include "io/tables/property_yaml.h"

namespace felt::apps {
namespace {

/// Stamps between which the selected frames lie.
std::pair<double, double> selected_span(const SequenceReader& selected) {
  double first = selected.name(0).stamp_s, last = first;
  for (int64_t i = 1; i < selected.size(); ++i) {
    first = std::min(first, selected.name(i).stamp_s);
    last = std::max(last, selected.name(i).stamp_s);
  }
  return {first, last};
}

TouchRequest reading_of(const RecordedTouch& touch) {
  TouchRequest request;
  request.property = touch.property;
  request.value = touch.value;
  request.sigma = touch.sigma;
  return request;
}

bool any_prior(const PropertyTable& properties, const ClassTable& classes) {
  return std::any_of(properties.properties().begin(), properties.properties().end(),
                     [&](const Property& p) { return class_priors(p, classes).any(); });
}

int64_t already_counted(const std::vector<TouchOutcome>& outcomes) {
  return std::count_if(outcomes.begin(), outcomes.end(), [](const TouchOutcome& o) { return o.already_counted; });
}

}  // namespace

TouchPlan plan_touches(const ReconstructOptions& options, const SequenceReader& selected, const ClassTable& classes) {
  const SequenceInfo& info = selected.info();
  TouchPlan plan;
  if (const auto& file = options.properties.empty() ? info.properties_file : options.properties; !file.empty())
    plan.properties = read_properties(file), warn_of_misspelt_priors(plan.properties, classes, file.string());
  if (options.no_touches) return plan;
  const bool named = !options.touches.empty();
  plan.file = named ? options.touches : info.touches_file;
  if (plan.file.empty()) return plan;

  plan.touches = read_touches(plan.file);
  plan.content = content_hash(read_whole_file(plan.file));
  plan.recorded = int64_t(plan.touches.size());
  if (plan.properties.empty())
    plan.unused = "a property table (--properties)";
  else if (!any_prior(plan.properties, classes))
    plan.unused = "a class of the sequence with a prior in the property table";
  if (!plan.unused.empty()) {
    plan.unused = describe_mismatch(plan.file.string(), "touches", plan.unused, "none");
    if (named) throw ConfigError(plan.unused);
    plan.touches.clear();
    return plan;
  }

  SequenceOptions every = options.reading;
  every.frames = {};
  plan.sequence = open_sequence(options.sequence, every);
  const TouchedSequence sequence = touched_sequence(*plan.sequence);
  const auto [first_s, last_s] = selected_span(selected);
  std::vector<std::string> problems;
  std::vector<RecordedTouch> within;
  for (const RecordedTouch& touch : plan.touches) {
    try {
      const double stamp_s = stamp_of(touch, sequence);
      check_reading(plan.properties, classes, reading_of(touch));
      if (stamp_s >= first_s && stamp_s <= last_s)
        within.push_back(touch);
      else
        ++plan.left_out;
    } catch (const TouchError& error) {
      problems.push_back(plan.file.string() + ":" + std::to_string(touch.line) + ": " + error.what());
    }
  }
  if (!problems.empty()) throw FormatError(first_of(problems));
  plan.touches = std::move(within);
  return plan;
}

std::vector<TouchOutcome> apply_touches(Map& map, const TouchPlan& plan) {
  if (plan.touches.empty()) return {};
  const TouchedSequence sequence = touched_sequence(*plan.sequence);
  TouchRequest defaults;
  defaults.region.min_weight = least_observed_weight(map);
  return apply_recorded_touches(map, plan.touches, defaults, &sequence, KnownReadings::leave_out);
}

void print_left_out(const TouchPlan& plan, const std::vector<TouchOutcome>& outcomes) {
  if (!plan.unused.empty()) spdlog::warn("touches left out: {}", plan.unused);
  for (const TouchOutcome& o : outcomes)
    if (!o.refused.empty()) spdlog::warn("touch refused: {}:{}: {}", plan.file.string(), o.touch.line, o.refused);
  if (const int64_t counted = already_counted(outcomes); counted > 0)
    spdlog::warn("{}: {} of {} touches count already (reading, place and time): left out", plan.file.string(), counted,
                 outcomes.size());
}

void warn_if_changed(const TouchPlan& plan, const std::string& then) {
  if (plan.file.empty()) return;
  const nlohmann::json earlier = nlohmann::json::parse(then, nullptr, false);
  if (earlier.is_object() && earlier.value("content", "") == plan.content) return;
  spdlog::warn(
      "{}: {}, and not applied, as the map was complete before: feltmap touch MAP --file applies what is new, in a "
      "file "
      "of its own",
      plan.file.string(), earlier.is_object() ? "has changed" : "came later");
}

nlohmann::ordered_json touches_json(const TouchPlan& plan, const std::vector<TouchOutcome>& outcomes) {
  nlohmann::ordered_json json;
  json["file"] = plan.file.string();
  json["content"] = plan.content;
  json["recorded"] = plan.recorded;
  json["applied"] =
      std::count_if(outcomes.begin(), outcomes.end(), [](const TouchOutcome& o) { return bool(o.effect); });
  json["already_counted"] = already_counted(outcomes);
  json["outside_selection"] = plan.left_out;
  if (!plan.unused.empty()) json["unused"] = plan.unused;
  json["refused"] = nlohmann::ordered_json::array();
  for (const TouchOutcome& o : outcomes)
    if (!o.refused.empty()) json["refused"].push_back({{"line", o.touch.line}, {"reason", o.refused}});
  json["ids"] = nlohmann::ordered_json::array();
  for (const TouchOutcome& o : outcomes)
    if (o.effect) json["ids"].push_back(id_text(o.effect->id));
  return json;
}

}  // namespace felt::apps
