#include "io/readings/fit_priors.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "io/files/json_text.h"
#include "io/files/text_input.h"

namespace felt {
std::vector<ClassReadings> read_readings_csv(const std::filesystem::path& file) {
  const std::string content = read_file_or_pipe(file);
  std::vector<ClassReadings> classes;
  std::map<std::string, size_t> class_index;
  std::map<std::pair<size_t, std::string>, size_t> group_index;
  std::vector<std::string> header;
  size_t class_column = 0, value_column = 0, group_column = 0;
  char separator = ',';
  for (LineReader lines(content, file); lines.next();) {
    const std::string where = lines.where();
    if (header.empty()) separator = csv_separator(lines.line());
    const std::vector<std::string> cells = csv_cells(lines.line(), separator);
    if (header.empty()) {
      header = cells;
      const auto column = [&](const char* name) {
        return size_t(std::find(header.begin(), header.end(), name) - header.begin());
      };
      class_column = column("class");
      value_column = column("value");
      group_column = column("group");
      if (class_column == header.size() || value_column == header.size()) {
        throw FormatError(describe_mismatch(where, "header", "columns 'class', 'value' and perhaps 'group'",
                                            "'" + std::string(lines.line().substr(0, 60)) + "'"));
      }
      continue;
    }
    if (cells.size() != header.size()) {
      throw FormatError(describe_mismatch(where, "cells", std::to_string(header.size()), std::to_string(cells.size())));
    }
    const std::string &name = cells[class_column], &text = cells[value_column];
    const std::optional<double> value = parse_number(text);
    if (!value || !std::isfinite(*value)) {
      throw FormatError(describe_mismatch(where, "value", "a finite number", "'" + text + "'"));
    }
    if (name.empty()) throw FormatError(describe_mismatch(where, "class", "a name", "an empty cell"));
    const auto [of_class, new_class] = class_index.try_emplace(name, classes.size());
    if (new_class) classes.push_back({name, {}});
    GroupedReadings& groups = classes[of_class->second].groups;
    // Without a group column a class is one group: its correlation stays unknown.
    const std::string group = group_column < cells.size() ? cells[group_column] : "";
    const auto [of_group, new_group] = group_index.try_emplace({of_class->second, group}, groups.size());
    if (new_group) groups.emplace_back();
    groups[of_group->second].push_back(*value);
  }
  if (classes.empty()) {
    throw FormatError(describe_mismatch(file.string(), "content", "a header and at least one reading", "none"));
  }
  return classes;
}

namespace {

/// Fits in the order of the classes; those of one group take the correlation of the others.
std::vector<std::optional<PriorFit>> fits_of(const std::vector<ClassReadings>& classes, double max_nu_0) {
  std::vector<std::optional<PriorFit>> fits;
  std::vector<PriorFit> found;
  for (const ClassReadings& c : classes) {
    fits.push_back(fit_prior(c.groups, max_nu_0));
    if (fits.back()) found.push_back(*fits.back());
  }
  if (const std::optional<double> rho = pooled_rho(found))
    for (size_t i = 0; i < classes.size(); ++i)
      if (fits[i] && !fits[i]->rho) fits[i] = fit_prior(classes[i].groups, max_nu_0, rho);
  return fits;
}

}  // namespace

PropertyTable fitted_properties(const std::vector<ClassReadings>& classes, Property property) {
  std::vector<PriorFit> fits;
  const std::vector<std::optional<PriorFit>> of_class = fits_of(classes, property.max_prior_readings);
  for (size_t i = 0; i < classes.size(); ++i) {
    const ClassReadings& c = classes[i];
    for (const std::vector<double>& group : c.groups)
      for (const double value : group)
        if (value < property.support_lo || value > property.support_hi)
          throw ConfigError(describe_mismatch("priors", "reading of '" + c.name + "'", "a value in the support",
                                              std::to_string(value)));
    const std::optional<PriorFit>& fit = of_class[i];
    if (!fit) continue;
    fits.push_back(*fit);
    property.priors[c.name] = {fit->mean, fit->sd, fit->effective_readings};
  }
  if (fits.empty()) throw ConfigError("priors: expected a class with at least two readings that differ, found none");
  property.rho = pooled_rho(fits).value_or(property.rho);
  return PropertyTable({property});
}

std::string fit_priors_json(const std::vector<ClassReadings>& classes, double max_nu_0) {
  using nlohmann::ordered_json;
  ordered_json out{{"classes", ordered_json::array()}};
  std::vector<PriorFit> fits;
  std::vector<std::string> names;
  const std::vector<std::optional<PriorFit>> of_class = fits_of(classes, max_nu_0);
  for (size_t i = 0; i < classes.size(); ++i) {
    const ClassReadings& c = classes[i];
    const std::optional<PriorFit>& fit = of_class[i];
    if (!fit) {
      out["classes"].push_back(
          {{"class", c.name}, {"error", "readings: expected at least two that differ, found fewer"}});
      continue;
    }
    fits.push_back(*fit);
    names.push_back(c.name);
    out["classes"].push_back(
        {{"class", c.name},
         {"readings", fit->readings},
         {"groups", fit->groups},
         {"mean", fit->mean},
         {"sd", fit->sd},
         {"nu_0", fit->nu_0},
         {"rho", fit->rho ? ordered_json(*fit->rho) : ordered_json(nullptr)},
         {"assumed_rho", fit->assumed_rho ? ordered_json(*fit->assumed_rho) : ordered_json(nullptr)},
         {"effective_readings", fit->effective_readings},
         {"ks_distance", fit->ks_distance},
         {"normal_is_plausible", fit->normal_is_plausible}});
  }
  const std::optional<double> rho = pooled_rho(fits);
  out["rho"] = rho ? ordered_json(*rho) : ordered_json(nullptr);
  ordered_json table = ordered_json::array(), inseparable = ordered_json::array();
  for (size_t i = 0; i < fits.size(); ++i) {
    ordered_json row = ordered_json::array();
    for (size_t j = 0; j < fits.size(); ++j) {
      const auto prior = [&](size_t c) { return calibrated_prior(fits[c].mean, fits[c].sd, fits[c].nu_0); };
      const double confusion = i == j ? 0.5 : confusion_after_one_touch(prior(i), prior(j));
      row.push_back(confusion);
      if (j > i && confusion >= kInseparable)
        inseparable.push_back({{"classes", {names[i], names[j]}}, {"confusion", confusion}});
    }
    table.push_back(row);
  }
  out["confusion"] = table;
  out["inseparable"] = inseparable;
  return json_text(out, 2);
}

}  // namespace felt
