#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>

#include "io/segmentation/segment_source.h"
#include "io/segmentation/segmenter.h"
#include "io/sequence/reader.h"

namespace felt {

/// Time spent on perception, summed over the threads that read frames.
struct PerceptionTimes {
  std::atomic<int64_t> network_ns = 0;  ///< network, and interpolation of its output
  std::atomic<int64_t> vote_ns = 0;     ///< class-agnostic segments and voting within them
  double network_s() const { return 1e-9 * double(network_ns); }
  double vote_s() const { return 1e-9 * double(vote_ns); }
};

/// Why a frame was left out on request (`Perception::skip`).
inline constexpr const char* kAlreadyThere = "already there";

/// What is made of a frame between decoding and fusion.
struct Perception {
  std::shared_ptr<const Segmenter> segmenter;  ///< null: the labels that the sequence carries
  int top = 0;                                 ///< probabilities kept of a pixel; 0: a label
  SegmentSource vote = SegmentSource::none;    ///< segments whose pixels are given one class
  FrameSegmentSettings segments;               ///< of `geometric`
  double least_share = 0.5;  ///< of labels: what the winner of a segment must hold (mapping/labels/segment_voting.h)
  /// By frame number: frames that are not read. They come as skipped, with the reason kAlreadyThere.
  std::function<bool(int64_t)> skip;
  std::shared_ptr<PerceptionTimes> times = std::make_shared<PerceptionTimes>();

  /// Of the perceived frames of a sequence.
  const ClassTable& classes(const SequenceInfo& info) const {
    return segmenter != nullptr ? segmenter->classes() : info.classes;
  }
  bool active() const { return segmenter != nullptr || vote != SegmentSource::none; }
};

/// The sequence with its frames perceived: `read` decodes a frame, runs the segmenter on its colour and replaces its
/// labels or probabilities, and lets the pixels of each segment vote (probabilities, the segmenter's always, are pooled
/// before they become labels). As it happens within `read`, it runs ahead of fusion on the threads that decode
/// (io/sequence/decode_ahead.h). Nothing asked for: the sequence itself. `info().classes` is the segmenter's table.
/// Throws FormatError where the segmenter has no colour to see, the vote no labels, or no instances.
std::unique_ptr<SequenceReader> perceived_sequence(std::unique_ptr<SequenceReader> sequence,
                                                   const Perception& perception);

}  // namespace felt
