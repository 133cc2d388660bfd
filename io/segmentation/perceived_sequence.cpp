#include "io/segmentation/perceived_sequence.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "core/error.h"
#include "mapping/labels/segment_voting.h"

namespace felt {
namespace {

/// Classes of a pixel that a vote looks at where only the winner is kept.
constexpr int kPooledClasses = 5;

/// Adds the time until its end to a sum.
class Timer {
public:
  explicit Timer(std::atomic<int64_t>& sum_ns) : sum_ns_(sum_ns) {}
  ~Timer() { sum_ns_ += std::chrono::nanoseconds(std::chrono::steady_clock::now() - start_).count(); }
  Timer(const Timer&) = delete;
  Timer& operator=(const Timer&) = delete;

private:
  std::atomic<int64_t>& sum_ns_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

class PerceivedSequence final : public SequenceReader {
public:
  PerceivedSequence(std::unique_ptr<SequenceReader> sequence, const Perception& perception)
      : sequence_(std::move(sequence)), perception_(perception), info_(sequence_->info()) {
    const auto need = [&](bool there, const char* who, const char* what, const char* found) {
      if (!there) throw FormatError(describe_mismatch(info_.path.string(), who, what, found));
    };
    if (perception_.segmenter != nullptr) {
      need(info_.has_color, "segmenter", "a sequence read with its colour", "no colour images");
      info_.classes = perception_.segmenter->classes();
      info_.has_labels = perception_.top == 0;
      info_.has_probabilities = perception_.top > 0;
      info_.probability_ranks = perception_.top;
    }
    if (perception_.vote == SegmentSource::none) return;
    need(info_.has_labels || info_.has_probabilities, "vote", "a sequence with labels, or a segmenter", "neither");
    if (perception_.vote == SegmentSource::instances)
      need(info_.has_instances, "vote", "instance images or masks", "none");
  }

  const SequenceInfo& info() const override { return info_; }
  int64_t size() const override { return sequence_->size(); }

  FrameName name(int64_t i) const override { return sequence_->name(i); }
  ReadResult read(int64_t i) const override {
    if (perception_.skip && perception_.skip(name(i).index)) return SkippedFrame{name(i).index, kAlreadyThere, ""};
    ReadResult result = sequence_->read(i);
    if (auto* frame = std::get_if<Frame>(&result)) label(*frame);
    return result;
  }

private:
  void label(Frame& frame) const {
    if (perception_.segmenter != nullptr) {
      const Timer timer(perception_.times->network_ns);
      frame.labels = {};
      const int kept = std::max(perception_.vote == SegmentSource::none ? 1 : kPooledClasses, perception_.top);
      frame.probabilities = perception_.segmenter->segment(frame.color, kept, frame.index);
    }
    if (perception_.vote != SegmentSource::none) vote(frame);
    if (perception_.segmenter == nullptr || perception_.top > 0) return;
    frame.labels = most_probable_labels(frame.probabilities);
    frame.probabilities = {};
  }

  void vote(Frame& frame) const {
    const Timer timer(perception_.times->vote_ns);
    const Image<uint16_t> segments = segments_of(frame, perception_.vote, perception_.segments);
    if (segments.empty()) return;
    if (!frame.probabilities.empty())
      pool_probabilities(segments, 0, frame.probabilities);
    else if (!frame.labels.empty())
      vote_labels(segments, perception_.least_share, frame.labels);
  }

  std::unique_ptr<SequenceReader> sequence_;
  Perception perception_;
  SequenceInfo info_;
};

}  // namespace

std::unique_ptr<SequenceReader> perceived_sequence(std::unique_ptr<SequenceReader> sequence,
                                                   const Perception& perception) {
  if (!perception.active()) return sequence;
  return std::make_unique<PerceivedSequence>(std::move(sequence), perception);
}

}  // namespace felt
