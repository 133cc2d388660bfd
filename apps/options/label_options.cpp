#include "apps/options/label_options.h"

#include <nlohmann/json.hpp>

#include "apps/command.h"
#include "apps/options/number_checks.h"
#include "core/error.h"
#include "io/files/content_hash.h"
#include "io/files/text_input.h"
#include "io/tables/confusion_file.h"
#include "mapping/labels/ignored_classes.h"

namespace felt::apps {
void add_label_options(CLI::App& command, LabelSettings& s) {
  const LabelConfig standard = standard_labels();
  const auto bracketed = [](float value) { return " [" + nlohmann::json(short_decimal(value)).dump() + "]"; };
  const char* group = "Labels";
  command
      .add_option("--label-band", s.band_vox,
                  "Voxels on either side of the surface that take labels" + bracketed(standard.band_vox))
      ->group(group);
  command
      .add_option("--label-evidence", s.evidence,
                  "What one observation adds to a class; below 1 for frames that repeat each other's mistakes" +
                      bracketed(standard.evidence))
      ->group(group);
  command
      .add_option("--label-cap", s.max_evidence,
                  "Most evidence of a voxel: beyond it the past fades, 0: no cap" + bracketed(standard.max_evidence))
      ->group(group);
  command
      .add_option(
          "--label-novelty", s.novelty_m,
          "Metres the camera must have moved for a view to count in full; 0: all do" + bracketed(standard.novelty_m))
      ->group(group);
  command
      .add_option("--label-turn", s.novelty_deg,
                  "The same in degrees turned: the greater of both counts" + bracketed(standard.novelty_deg))
      ->group(group);
  command
      .add_option("--class-prior", s.class_prior,
                  "Concentration of every class before anything was seen [1; of k > 8 classes 8/k]")
      ->group(group);
  command
      .add_option("--confusion", s.confusion,
                  "What the network takes for what: CSV or YAML, for example of calibrate-labels")
      ->option_text("FILE")
      ->group(group);
  command
      .add_option("--ignore-classes", s.ignore_classes,
                  "Names, such as person: their pixels neither label nor build surface")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->group(group);
  add_switch(command, "--instances", s.instances, "Keep the instance id of every voxel")->group(group);
}

LabelConfig standard_labels() {
  LabelConfig config;
  // Beyond about 55 frames a touch can no longer correct a network that was wrong all along.
  config.max_evidence = 50;
  return config;
}

LabelConfig label_config(const LabelSettings& settings) {
  LabelConfig config = standard_labels();
  const auto choose = [](float& value, const std::optional<double>& given) {
    if (given) value = float(*given);
  };
  choose(config.band_vox, settings.band_vox);
  choose(config.evidence, settings.evidence);
  choose(config.max_evidence, settings.max_evidence);
  choose(config.novelty_m, settings.novelty_m);
  choose(config.novelty_deg, settings.novelty_deg);
  config.instances = settings.instances.value_or(config.instances);
  config.spread_dropped = settings.spread_rest.value_or(config.spread_dropped);
  return config;
}

void add_to_json(const LabelSettings& settings, const LabelConfig& config, nlohmann::ordered_json& json) {
  json["label_band_vox"] = short_decimal(config.band_vox);
  json["label_evidence"] = short_decimal(config.evidence);
  json["label_cap"] = short_decimal(config.max_evidence);
  json["label_novelty_m"] = short_decimal(config.novelty_m);
  json["label_turn_deg"] = short_decimal(config.novelty_deg);
  json["spread_rest"] = config.spread_dropped;
  if (settings.class_prior) json["class_prior"] = *settings.class_prior;
  if (!settings.confusion.empty()) {
    json["confusion"] = settings.confusion.string();
    json["confusion_content"] = content_hash(read_whole_file(settings.confusion));
  }
  if (!settings.ignore_classes.empty()) json["ignore_classes"] = settings.ignore_classes;
  json["instances"] = config.instances;
}

PreparedClasses prepare_classes(const LabelSettings& settings, const ClassTable& table) {
  PreparedClasses prepared;
  IgnoredClasses ignored = ignored_classes(table, settings.ignore_classes, "--ignore-classes");
  prepared.ignored_ids = std::move(ignored.ids);
  prepared.table = std::move(ignored.table);
  if (settings.class_prior && !prepared.table.empty()) {
    std::vector<ClassInfo> classes = prepared.table.classes();
    for (ClassInfo& c : classes) c.prior = *settings.class_prior;
    prepared.table = ClassTable(std::move(classes));
  }
  if (settings.confusion.empty()) return prepared;
  if (prepared.table.empty())
    throw ConfigError(describe_mismatch("--confusion", "class table", "one in the sequence or by --classes", "none"));
  prepared.likelihood = std::make_shared<const LabelEvidence>(
      label_evidence(read_confusion_counts(settings.confusion, prepared.table), prepared.table.size()));
  return prepared;
}

}  // namespace felt::apps
