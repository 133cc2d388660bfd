#include "io/doctor/geometry_findings.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/text.h"

namespace felt {
namespace {

/// Fewer pairs that tell accuse nothing: those of three frames, each seen from both sides, are hardly independent.
constexpr int kLeastDecidedPairs = 5;

/// What was told is right, though `best`, a little beside it, fits best.
std::string right_enough(const std::string& told, const std::string& best) {
  return told + ", within what sensors differ by (" + best + " fits best)";
}

class Findings {
public:
  Findings(const GeometrySample& sample, const Reading& best) : sample_(sample), best_(best), scores_(scores(best)) {}

  std::vector<PairScore> scores(const Reading& reading) const {
    return cross_project(sample_.frames, sample_.pairs, sample_.trajectory, sample_.camera, reading);
  }
  /// Adds a finding on one component: `other` is the best reading with that component as it is read now (where `best`
  /// differs in it) or as the likeliest alternative (where it does not).
  void add(const std::string& topic, bool differs, const std::string& belief, const std::string& remedy,
           const std::vector<Reading>& others, double least_gain = kLeastGain) {
    Finding finding{topic, false, 0, belief, "", ""};
    Comparison least;
    std::vector<PairScore> rival;
    for (const Reading& other : others) {
      const std::vector<PairScore> candidate = scores(other);
      const Comparison comparison = compare(candidate, scores_);
      if (!rival.empty() && comparison.gain >= least.gain) continue;
      least = comparison;
      rival = candidate;
    }
    finding.confidence = std::clamp(least.confidence(), 0.5, 0.99);
    const Agreement mine = agreement_of(scores_), theirs = agreement_of(rival);
    // Rendered surfaces that meet exactly, but only some of them, do so by their shape: walls slid along themselves.
    const bool by_shape =
        sample_.frames.size() < kFewFrames && mine.residual <= kNearestPixel && mine.meets < kNearlyAll;
    const bool enough = least.decided >= kLeastDecidedPairs && !by_shape;
    finding.faulty = differs && enough && convincing(least, least_gain);
    finding.evidence = std::to_string(least.won) + " of " + std::to_string(least.decided) +
                       " frame pairs that tell fit better: " + percent_text(mine.meets) +
                       " of points in view meet the other surface (" + percent_text(mine.residual) + " off), against " +
                       percent_text(theirs.meets) + " (" + percent_text(theirs.residual) + " off)" +
                       (differs ? " as read now" : " otherwise");
    if (finding.faulty) finding.remedy = remedy;
    if (differs && !finding.faulty) finding.belief += "; not clearly better than as read now";
    list.push_back(finding);
  }

  std::vector<Finding> list;

private:
  const GeometrySample& sample_;
  Reading best_;
  std::vector<PairScore> scores_;
};

/// Where hardly any point meets the other surface under the best reading, the components say nothing.
std::optional<Finding> nothing_fits(const std::vector<PairScore>& best, const std::vector<PairScore>& now,
                                    size_t frames, bool thorough) {
  const Agreement agreement = agreement_of(best);
  if (agreement.meets >= kLeastMeeting) return std::nullopt;
  Finding finding{"fit", true, std::clamp(1 - agreement.meets, 0.5, 0.97), "", "", ""};
  finding.evidence = percent_text(agreement.meets) + " of points in view meet the other surface under the best, " +
                     percent_text(agreement_of(now).meets) + " as read now";
  // Views that do not overlap meet nowhere, however sound.
  if (frames < kFewFrames || agreement.pairs < 3 || 2 * size_t(agreement.pairs) < best.size()) {
    finding.faulty = false;
    finding.confidence = 0.5;
    finding.belief = "it cannot be told whether poses, depth and camera fit: too few views overlap";
    return finding;
  }
  finding.belief = "no reading of poses, depth and camera that was tried fits";
  finding.remedy = thorough
                       ? "no option mends it: look whether poses and images are of the same recording, and whether "
                         "depth kept its 16 bits"
                       : "see whether --intrinsics, --stamp-offset or poses of another recording are at fault";
  return finding;
}

Reading with_delay(Reading reading, double delay) {
  reading.pose_delay = delay;
  return reading;
}
Reading with_focal(Reading reading, double factor) {
  reading.focal_factor = factor;
  return reading;
}

void add_depth_scale(const GeometrySample& sample, const Reading& best, Findings& findings) {
  // Rival scales: the one read now where the best differs, else the other known ones.
  const double scale = sample.depth_scale / best.depth_factor;
  const bool scale_differs = std::abs(std::log(best.depth_factor)) > 0.05;
  std::vector<Reading> scales;
  for (const double known : kDepthScales) {
    Reading other = best;
    other.depth_factor = scale_differs ? 1 : sample.depth_scale / known;
    if (std::abs(std::log(other.depth_factor / best.depth_factor)) > 0.05) scales.push_back(other);
    if (scale_differs) break;
  }
  if (scales.empty()) {
    scales.push_back(best);
    scales.back().depth_factor = 1.3;
  }
  const std::string best_scale = number_text(scale, "%.6g"), counts = "stored depth counts ", a_metre = " a metre";
  findings.add("depth-scale", scale_differs,
               scale_differs || best.depth_factor == 1
                   ? counts + best_scale + a_metre
                   : right_enough(counts + number_text(sample.depth_scale, "%.6g") + a_metre, best_scale),
               "--depth-scale " + best_scale, scales);
}

void add_focal_length(const GeometrySample& sample, const Reading& best, Findings& findings) {
  const PinholeCamera camera = camera_of(sample.camera, best);
  const bool focal_differs = std::abs(std::log(best.focal_factor)) > 0.06;
  const std::string given_focal = "the given focal length is right",
                    best_focal = number_text(camera.fx, "%.4g") + " pixels, " + number_text(best.focal_factor, "%.3f") +
                                 " times the given,";
  findings.add("focal-length", focal_differs,
               focal_differs            ? "a focal length of " + best_focal + " fits best"
               : best.focal_factor == 1 ? given_focal
                                        : right_enough(given_focal, best_focal),
               intrinsics_option(camera.fx, camera.fy, camera.cx, camera.cy),
               focal_differs ? std::vector<Reading>{with_focal(best, 1)}
                             : std::vector<Reading>{with_focal(best, best.focal_factor * 1.1),
                                                    with_focal(best, best.focal_factor / 1.1)});
}

/// Whether poses are those of the moments at which depth was taken.
void add_stamp_offset(const GeometrySample& sample, const Reading& best, Findings& findings) {
  const double spacing = sample.trajectory.spacing, delay = best.pose_delay;
  if (!(spacing > 0)) return;
  if (sample.frames.size() < kFewFrames) {
    findings.list.push_back({"stamp-offset", false, 0.5,
                             "it cannot be told from " + std::to_string(sample.frames.size()) +
                                 " frames whether poses are those of the moments at which depth was taken",
                             "", ""});
    return;
  }
  // Real sensors are up to 25 ms apart; frames that only have numbers are taken for 30 a second.
  const bool delay_differs = std::abs(delay) > (sample.stamped ? 0.025 : std::max(0.75, 0.15 * spacing));
  const std::string at_once = "poses are those of the moments at which depth was taken",
                    best_delay = number_text(std::abs(delay), "%.3g") + (sample.stamped ? " s" : " frame numbers") +
                                 (delay > 0 ? " later" : " earlier");
  findings.add("stamp-offset", delay_differs,
               delay_differs ? "poses fit best when taken " + best_delay + " than depth is stamped"
               : delay == 0  ? at_once
                             : right_enough(at_once, best_delay),
               "--stamp-offset " + number_text(sample.stamp_offset - delay, "%.4f"),
               delay_differs
                   ? std::vector<Reading>{with_delay(best, 0)}
                   : std::vector<Reading>{with_delay(best, delay + spacing), with_delay(best, delay - spacing)},
               // Slow cameras gain little from right stamps, but sound recordings gain nothing from wrong ones.
               0.02);
}

}  // namespace

std::vector<Finding> geometry_findings(const GeometrySample& sample, const Reading& best, bool thorough) {
  Findings findings(sample, best);
  const Reading& now = sample.now;
  if (auto finding = nothing_fits(findings.scores(best), findings.scores(now), sample.frames.size(), thorough))
    return {*finding};

  Reading other = best;
  if (best.w_first) {
    other = now;
    findings.add("quaternions", true, "quaternions of the poses are written w x y z",
                 "no option mends it: write them x y z w, the real part last", {other});
    other = best;
  }
  other.convention.world_to_camera ^= true;
  findings.add("pose-convention", best.convention.world_to_camera != now.convention.world_to_camera,
               best.convention.world_to_camera ? "poses are world-to-camera" : "poses are camera-to-world",
               "--pose-convention " + to_string(best.convention), {other});
  other = best;
  other.convention.opengl_axes ^= true;
  findings.add("camera-axes", best.convention.opengl_axes != now.convention.opengl_axes,
               best.convention.opengl_axes ? "camera axes are OpenGL's (y up, z backward)"
                                           : "camera axes are OpenCV's (y down, z forward)",
               "--pose-convention " + to_string(best.convention), {other});

  add_depth_scale(sample, best, findings);
  other = best;
  other.ray_length ^= true;
  findings.add("depth-along", best.ray_length != now.ray_length,
               best.ray_length ? "depth is the length of the ray" : "depth lies along the optical axis",
               best.ray_length ? "--ray-length" : "--no-ray-length", {other});
  if (best.swapped_camera) {
    const PinholeCamera camera = camera_of(sample.camera, best);
    other = best;
    other.swapped_camera = false;
    findings.add("image-size", true, "the camera is that of an image with width and height exchanged",
                 intrinsics_option(camera.fx, camera.fy, camera.cx, camera.cy),
                 // The principal point, by now nearer to the middle of the image, speaks for it too.
                 {other}, kLeastGain - (off_center(sample.camera) - off_center(camera)));
  }
  if (thorough) {
    add_focal_length(sample, best, findings);
    add_stamp_offset(sample, best, findings);
  }
  return findings.list;
}

}  // namespace felt
