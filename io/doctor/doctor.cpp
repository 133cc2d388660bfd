#include "io/doctor/doctor.h"

#include <algorithm>

#include "io/doctor/color_check.h"
#include "io/doctor/encoding_check.h"
#include "io/doctor/file_check.h"
#include "io/doctor/geometry_findings.h"
#include "io/doctor/label_check.h"
#include "io/doctor/proposal.h"
#include "io/doctor/sample.h"
#include "io/doctor/trajectory_check.h"
#include "io/sequence/frame_selection.h"
#include "io/sequence/open_sequence.h"
#include "io/sequence/skip_reasons.h"

namespace felt {
namespace fs = std::filesystem;

bool Examination::faulty() const {
  return std::any_of(findings.begin(), findings.end(), [](const Finding& finding) { return finding.faulty; });
}

namespace {

void append(std::vector<Finding>& to, std::vector<Finding> from) {
  to.insert(to.end(), std::make_move_iterator(from.begin()), std::make_move_iterator(from.end()));
}

/// Faces of one scan do not overlap, and its points say how long they are: there is nothing to compare.
bool of_range_sensor(const SequenceListing& listing) {
  return listing.frames.front().depth.codec == ImageSource::Codec::scan;
}

Examination begin(const SequenceListing& listing) {
  Examination examination;
  examination.layout = listing.layout;
  examination.recorded_frames = examination.selected_frames = int64_t(listing.frames.size());
  return examination;
}

/// What became of the sampled frames when they were read, in the finding about what the files tell: images that cannot
/// be decoded, or have another size, are named; a sequence of which no frame can be read is faulty whatever the reason.
void add_skipped(const Sample& sample, Finding& finding) {
  const bool none = sample.geometry.frames.empty();
  int64_t broken = 0;
  for (const auto& [reason, frames] : sample.skipped_frames) {
    const bool of_image = is_of_broken_image(reason);
    if (of_image) broken += int64_t(frames.size());
    if (of_image || none) finding.evidence += "; " + reason + " in sampled frames " + frames_text(frames);
  }
  if (broken == 0 && !none) return;
  if (!finding.faulty || none)
    finding.belief = none ? "no sampled frame can be read"
                          : std::to_string(broken) + " sampled frames have images that cannot be read";
  finding.faulty = true;
  if (finding.remedy.empty()) finding.remedy = "copy the recording again, or leave these frames out with --frames";
}

}  // namespace

Examination examine_sequence(const fs::path& path, const SequenceOptions& options) {
  SequenceListing listing = list_sequence(path, options);
  Examination examination = begin(listing);
  select_frames(options.frames, listing);
  examination.selected_frames = int64_t(listing.frames.size());
  if (auto finding = check_stated_camera(listing)) examination.findings.push_back(std::move(*finding));
  examination.findings.push_back(check_frames(listing));
  examination.findings.push_back(check_copies(listing, *plain_reader(path, options, listing, Images::depth)));
  if (of_range_sensor(listing)) return examination;
  append(examination.findings, check_depth_images(path, options, listing));

  Sample sample = take_sample(path, options, listing, {});
  examination.sampled_frames = int64_t(sample.geometry.frames.size());
  examination.frame_pairs = int64_t(sample.geometry.pairs.size());
  examination.skipped = sample.skipped;
  for (Finding& finding : examination.findings)
    if (finding.topic == "frames") add_skipped(sample, finding);
  if (sample.geometry.frames.empty()) return examination;
  const Reading best = best_reading(sample.geometry, true);
  if (sample.geometry.pairs.size() >= 2) {
    append(examination.findings, geometry_findings(sample.geometry, best, true));
    examination.findings.push_back(
        check_trajectory(sample.geometry, best, *plain_reader(path, options, listing, Images::depth)));
  }
  if (auto finding = check_color_order(sample.geometry.frames, listing.classes, options.bgr))
    examination.findings.push_back(std::move(*finding));
  if (auto finding = check_labels(sample.geometry, best, listing.classes, options.label_offset))
    examination.findings.push_back(std::move(*finding));
  examination.proposal = propose(sample.geometry, best);
  return examination;
}

Examination examine_quickly(const fs::path& path, const SequenceOptions& options) {
  SequenceListing listing = list_sequence(path, options);
  Examination examination = begin(listing);
  if (of_range_sensor(listing)) return examination;
  const SamplePlan plan{.clusters = 3, .offsets = {0, 2, 6}, .whole_below = 9, .whole_trajectory = false};
  const Sample sample = take_sample(path, options, listing, plan);
  examination.sampled_frames = int64_t(sample.geometry.frames.size());
  examination.frame_pairs = int64_t(sample.geometry.pairs.size());
  examination.skipped = sample.skipped;
  if (sample.geometry.frames.empty()) return examination;
  const Reading best = best_reading(sample.geometry, false);
  append(examination.findings, geometry_findings(sample.geometry, best, false));
  if (auto finding = check_color_order(sample.geometry.frames, listing.classes, options.bgr))
    examination.findings.push_back(std::move(*finding));
  examination.proposal = propose(sample.geometry, best);
  return examination;
}

}  // namespace felt
