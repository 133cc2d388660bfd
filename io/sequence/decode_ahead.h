#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>

#include "io/sequence/reader.h"

namespace felt {

struct DecodeAheadOptions {
  /// Threads that decode, the consumer's included: n - 1 workers run beside it, and `next` decodes too instead of
  /// waiting. 1: everything happens within `next`.
  int threads = 1;
  int64_t first = 0;                          ///< position of the first frame
  int64_t max_frames = 16;                    ///< decoded and not yet taken; at least `threads` are allowed
  int64_t max_bytes = int64_t(256) << 20;     ///< of those frames' images, by the size of the sequence's camera
  const std::atomic<bool>* cancel = nullptr;  ///< once true, `next` gives nothing more
};

/// Decodes a sequence ahead of its consumer with bounded memory and hands the frames over strictly in recorded order,
/// so that results do not depend on the number of threads.
class DecodeAhead {
public:
  /// `reader` must outlive this object.
  DecodeAhead(const SequenceReader& reader, const DecodeAheadOptions& options);
  /// Stops the workers; waits for the frames that are being decoded.
  ~DecodeAhead();
  DecodeAhead(const DecodeAhead&) = delete;
  DecodeAhead& operator=(const DecodeAhead&) = delete;

  /// The next frame in order, or nothing after the last or once cancelled. Rethrows what `read` threw for this frame.
  /// To be called from one thread.
  std::optional<ReadResult> next();

  /// Time spent decoding, summed over threads.
  double decode_s() const;
  /// Time that `next` spent waiting with nothing left to decode.
  double wait_s() const;
  /// Frames that may be decoded ahead, from both limits.
  int64_t capacity() const;

private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Bytes that one decoded frame of the sequence takes.
int64_t frame_bytes(const SequenceInfo& info);

}  // namespace felt
