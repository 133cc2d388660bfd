#include "io/settings/label_settings.h"

#include "core/error.h"
#include "core/text.h"

namespace felt {

LabelSettings overlaid(LabelSettings first, const LabelSettings& second) {
  const auto fill = [](auto& value, const auto& other) {
    if (!value) value = other;
  };
  fill(first.band_vox, second.band_vox);
  fill(first.evidence, second.evidence);
  fill(first.max_evidence, second.max_evidence);
  fill(first.novelty_m, second.novelty_m);
  fill(first.novelty_deg, second.novelty_deg);
  fill(first.class_prior, second.class_prior);
  fill(first.instances, second.instances);
  fill(first.spread_rest, second.spread_rest);
  if (first.confusion.empty()) first.confusion = second.confusion;
  if (first.ignore_classes.empty()) first.ignore_classes = second.ignore_classes;
  return first;
}

std::vector<std::string> problems_of(const LabelSettings& settings) {
  std::vector<std::string> problems;
  const auto expect = [&](const std::optional<double>& value, bool zero_is_fine, const char* option, const char* what) {
    // Sums of what is counted are 32-bit floats.
    constexpr double kLargest = 1e6;
    if (!value || ((*value > 0 || (zero_is_fine && *value == 0)) && *value <= kLargest)) return;
    problems.push_back(describe_mismatch(
        option, what, zero_is_fine ? "a number from 0 to 1e6" : "a number above 0, up to 1e6", number_text(*value)));
  };
  expect(settings.band_vox, false, "--label-band", "voxels");
  expect(settings.evidence, false, "--label-evidence", "evidence of an observation");
  expect(settings.max_evidence, true, "--label-cap", "evidence of a voxel");
  expect(settings.novelty_m, true, "--label-novelty", "metres");
  expect(settings.novelty_deg, true, "--label-turn", "degrees");
  expect(settings.class_prior, false, "--class-prior", "prior of a class");
  return problems;
}

}  // namespace felt
