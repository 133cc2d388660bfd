#include "apps/perception_options.h"

#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "apps/command.h"
#include "apps/number_checks.h"
#include "io/files/content_hash.h"
#include "io/files/text_input.h"

namespace felt::apps {
namespace {

const std::map<std::string, SegmentSource> kSources = {
    {"none", SegmentSource::none}, {"geometric", SegmentSource::geometric}, {"instances", SegmentSource::instances}};

}  // namespace

void PerceptionArguments::add_to(CLI::App& command, const char* group, const char* net_option) {
  CLI::Option* const network = command.add_option(
      net_option, net, "Segment the colour images with the network that this file describes (net.yaml)");
  network->option_text("FILE")->group(group);
  command.add_option("--top", top, "Probabilities of a pixel's m likeliest classes instead of its label [0: label]")
      ->check(CLI::Range(0, 64))
      ->needs(network)
      ->group(group);
  add_choice(command, "--vote", vote, kSources,
             "Give the pixels of a segment one class: geometric (from depth), instances (images or masks), or none")
      ->default_str(name_of(kSources, vote))
      ->group(group);
  command.add_option("--masks", instances, "Folder of instance images, or of a folder of masks for each frame")
      ->group(group);
  command
      .add_option("--segment-color", color_step,
                  "Geometric segments also end where colour steps by this, grey levels; 0: colour does not matter")
      ->capture_default_str()
      ->check(finite())
      ->check(CLI::Range(0.0, 450.0))
      ->group(group);
}

Perception perception_of(const PerceptionArguments& arguments, const ClassTable& classes) {
  Perception perception;
  perception.top = arguments.top;
  perception.vote = arguments.vote;
  perception.segments.color_step = arguments.color_step;
  if (!arguments.net.empty())
    perception.segmenter = std::make_shared<const Segmenter>(read_net_description(arguments.net), classes);
  return perception;
}

nlohmann::ordered_json to_json(const PerceptionArguments& arguments) {
  nlohmann::ordered_json json;
  if (!arguments.net.empty()) {
    json["segmenter"] = arguments.net.string();
    json["segmenter_content"] = content_hash(read_whole_file(arguments.net));
  }
  json["top"] = arguments.top;
  json["vote"] = name_of(kSources, arguments.vote);
  if (!arguments.instances.empty()) json["masks"] = arguments.instances.string();
  if (arguments.vote == SegmentSource::geometric) json["segment_color"] = arguments.color_step;
  return json;
}

}  // namespace felt::apps
