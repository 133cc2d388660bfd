#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "apps/command.h"
#include "apps/commands/commands.h"
#include "apps/exit_code.h"
#include "apps/options/number_checks.h"
#include "apps/options/run_settings.h"
#include "apps/options/touch_options.h"
#include "apps/output/belief_report.h"
#include "core/text.h"
#include "io/map_file/map_file.h"
#include "mapping/touch/touch_suggestion.h"

namespace felt::apps {
namespace {

using json = nlohmann::ordered_json;

struct SuggestOptions : CommonOptions {
  std::string map, property, properties, rule = "connected";
  SuggestionSettings settings;
};

json suggestion_json(const Map& map, const Suggestion& s) {
  const auto classes = [&](const std::vector<double>& p) {
    json out;
    for (int c = 0; c < map.classes.size(); ++c) out[map.classes.at_slot(c).name] = p[size_t(c)];
    return out;
  };
  json out;
  out["point_m"] = point_json(s.point_m);
  out["normal"] = point_json(s.normal);
  out["voxels"] = s.voxels;
  out["area_m2"] = s.area_m2;
  out["information_gain_nat"] = s.gain_nat;
  out["score"] = s.gain_nat * s.area_m2;
  out["class_probability"] = classes(s.class_probability);
  out["outcomes"] = json::array();
  for (const Outcome& o : s.outcomes)
    out["outcomes"].push_back({{"class", map.classes.at_slot(o.slot).name},
                               {"probability", o.probability},
                               {"reading", o.reading},
                               {"class_probability", classes(o.class_probability)}});
  return out;
}

int run_suggest(const SuggestOptions& options) {
  Map map = load_map(options.map);
  use_properties(map, options.properties);
  SuggestionSettings settings = options.settings;
  settings.region.rule = rule_of_name(options.rule);
  settings.region.min_weight = least_observed_weight(map);
  const std::vector<Suggestion> suggestions = suggest_touches(map, options.property, settings);
  json all = json::array();
  for (const Suggestion& s : suggestions) all.push_back(suggestion_json(map, s));
  if (options.json) {
    print_json(json{{"property", options.property}, {"suggestions", all}});
    return kDone;
  }
  for (const Suggestion& s : suggestions) {
    std::printf("%s: gain %.3f nat on %.3f m2\n", point_text(s.point_m.x(), s.point_m.y(), s.point_m.z()).c_str(),
                s.gain_nat, s.area_m2);
    for (const Outcome& o : s.outcomes)
      std::printf("  %.0f %%: %s %.3g would make it %s %.2f\n", 100 * o.probability, options.property.c_str(),
                  o.reading, map.classes.at_slot(o.slot).name.c_str(), o.class_probability[size_t(o.slot)]);
  }
  if (suggestions.empty()) std::printf("nothing to touch: no labelled segment is large enough\n");
  return kDone;
}

}  // namespace

void add_suggest(CLI::App& app) {
  auto options = std::make_shared<SuggestOptions>();
  CLI::App& command = add_command(app,
                                  {"suggest", "Rank the map's segments by what a touch would teach",
                                   "feltmap suggest map.vdb --property friction --top 5"},
                                  *options, [options] { return run_suggest(*options); });
  command.add_option("MAP", options->map, "Map file")->required();
  command.add_option("--property", options->property, "What would be measured")->required();
  command.add_option("--properties", options->properties,
                     "Property table (YAML), instead of the one that the map may have");
  command.add_option("--top", options->settings.most, "How many segments to name")->check(above_zero());
  command.add_option("--region", options->rule, "connected: what a touch would update; segment: the map's segments")
      ->check(CLI::IsMember({"connected", "segment"}))
      ->capture_default_str();
  command.add_option("--min-voxels", options->settings.min_voxels, "Smallest segment")
      ->check(at_least_zero())
      ->capture_default_str();
}

}  // namespace felt::apps
