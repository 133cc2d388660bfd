#include "apps/options/perception_options.h"

#include <fstream>
#include <nlohmann/json.hpp>

#include "apps/command.h"
#include "apps/options/number_checks.h"
#include "core/error.h"
#include "core/text.h"
#include "io/files/content_hash.h"
#include "io/files/text_input.h"

namespace felt::apps {
namespace {

/// Names a network by its description and its weights.
std::string content_of_network(const std::filesystem::path& description) {
  ContentHash hash;
  hash.add(read_whole_file(description));
  std::ifstream weights(read_net_description(description).file, std::ios::binary);
  for (std::string part(size_t(1) << 20, '\0');
       weights.read(part.data(), std::streamsize(part.size())), weights.gcount() > 0;)
    hash.add(std::string_view(part).substr(0, size_t(weights.gcount())));
  return hash.digits();
}

}  // namespace

void add_perception_options(CLI::App& command, PerceptionSettings& settings, const std::string& net_option) {
  const Perception standard;
  const char* group = "Perception";
  command
      .add_option(net_option, settings.network,
                  "Segment the colour images with the network that this file describes (net.yaml)")
      ->option_text("FILE")
      ->group(group);
  command
      .add_option("--top", settings.top,
                  "Probabilities of a pixel's m likeliest classes instead of its label [0: label]")
      ->check(CLI::Range(0, kMostTopClasses))
      ->group(group);
  add_choice(command, "--vote", settings.vote, kSegmentSourceNames,
             "Give the pixels of a segment one class: geometric (from depth), instances (images or masks), or none")
      ->default_str(name_of(kSegmentSourceNames, standard.vote))
      ->group(group);
  command.add_option("--masks", settings.masks, "Folder of instance images, or of a folder of masks for each frame")
      ->group(group);
  command
      .add_option("--segment-color", settings.color_step,
                  "Geometric segments also end where colour steps by this, grey levels; 0: colour does not matter")
      ->default_str(number_text(standard.segments.color_step))
      ->check(finite())
      ->check(CLI::Range(0.0, kLargestColorStep))
      ->group(group);
}

void require_use(PerceptionSettings& settings, const PerceptionSources& from, bool keeps_instances,
                 Problems& problems) {
  const PerceptionSettings& line = from.command_line;
  const auto complain = [&](bool on_line, const std::string& option, const std::string& key, const std::string& needs) {
    if (on_line)
      problems.add_of_usage(describe_mismatch(option, "what it is for", needs, "none"));
    else
      problems.add(describe_mismatch(from.file + ": " + key, "what it is for", needs, "none"));
  };
  if (settings.top.value_or(0) > 0 && settings.network.empty())
    complain(line.top.has_value(), "--top", "top", from.net_option);
  if (settings.color_step && !settings.votes_by(SegmentSource::geometric)) {
    if (line.color_step || !line.vote)
      complain(line.color_step.has_value(), "--segment-color", "segment_color", "--vote geometric");
    settings.color_step.reset();
  }
  if (!settings.masks.empty() && !settings.votes_by(SegmentSource::instances) && !keeps_instances) {
    if (!line.masks.empty() || !line.vote) complain(!line.masks.empty(), "--masks", "masks", from.users_of_masks);
    settings.masks.clear();
  }
}

Perception perception_of(const PerceptionSettings& settings, const ClassTable& classes) {
  Perception perception;
  perception.top = settings.top.value_or(perception.top);
  perception.vote = settings.vote.value_or(perception.vote);
  perception.segments.color_step = settings.color_step.value_or(perception.segments.color_step);
  if (!settings.network.empty())
    perception.segmenter = std::make_shared<const Segmenter>(read_net_description(settings.network), classes);
  return perception;
}

nlohmann::ordered_json to_json(const PerceptionSettings& settings) {
  const Perception standard;
  nlohmann::ordered_json json;
  if (!settings.network.empty()) {
    json["segmenter"] = settings.network.string();
    json["segmenter_content"] = content_of_network(settings.network);
  }
  json["top"] = settings.top.value_or(standard.top);
  json["vote"] = name_of(kSegmentSourceNames, settings.vote.value_or(standard.vote));
  if (!settings.masks.empty()) json["masks"] = settings.masks.string();
  if (settings.votes_by(SegmentSource::geometric))
    json["segment_color"] = settings.color_step.value_or(standard.segments.color_step);
  return json;
}

}  // namespace felt::apps
