#include "io/sequence/decode_ahead.h"

#include <algorithm>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "core/stopwatch.h"

namespace felt {

int64_t frame_bytes(const SequenceInfo& info) {
  const int64_t per_pixel = int64_t(sizeof(float)) + (info.has_color ? 4 : 0) + (info.has_labels ? 2 : 0) +
                            (info.has_instances ? 2 : 0) + (info.has_probabilities ? 6 * info.probability_ranks : 0);
  return per_pixel * info.camera.width * info.camera.height;
}

/// Frame i goes to slot i % capacity. A thread claims the next frame only while its slot is free, so at most `capacity`
/// frames are decoded or being decoded.
struct DecodeAhead::State {
  struct Slot {
    std::optional<ReadResult> frame;
    std::exception_ptr fault;
    bool ready = false;
  };

  const SequenceReader& reader;
  const std::atomic<bool>* cancel;
  std::mutex mutex;
  std::condition_variable frame_ready, slot_free;
  std::vector<Slot> slots;
  int64_t count, claimed, taken;
  bool stop = false;
  double decode_s = 0, wait_s = 0;
  std::vector<std::thread> workers;

  State(const SequenceReader& r, const DecodeAheadOptions& options)
      : reader(r), cancel(options.cancel), count(r.size()), claimed(options.first), taken(options.first) {
    const int64_t by_bytes = options.max_bytes / std::max<int64_t>(1, frame_bytes(r.info()));
    const int64_t least = std::max(1, options.threads);
    slots.resize(size_t(std::max(least, std::min(options.max_frames, by_bytes))));
  }

  Slot& slot(int64_t i) { return slots[size_t(i % int64_t(slots.size()))]; }
  bool can_claim() const { return claimed < count && claimed < taken + int64_t(slots.size()); }

  /// Decodes the next unclaimed frame with the lock released meanwhile.
  void decode_one(std::unique_lock<std::mutex>& lock) {
    const int64_t i = claimed++;
    lock.unlock();
    const Stopwatch watch;
    Slot result;
    try {
      result.frame = reader.read(i);
    } catch (...) {
      result.fault = std::current_exception();
    }
    result.ready = true;
    const double spent_s = watch.seconds();
    lock.lock();
    slot(i) = std::move(result);
    decode_s += spent_s;
    frame_ready.notify_one();
  }

  void work() {
    std::unique_lock lock(mutex);
    while (true) {
      slot_free.wait(lock, [&] { return stop || claimed >= count || can_claim(); });
      if (stop || claimed >= count) return;
      decode_one(lock);
    }
  }

  std::optional<ReadResult> next() {
    std::unique_lock lock(mutex);
    if (taken >= count) return std::nullopt;
    Slot& mine = slot(taken);
    while (!mine.ready) {
      if (cancel != nullptr && *cancel) return std::nullopt;
      if (can_claim()) {
        decode_one(lock);
        continue;
      }
      const Stopwatch watch;
      frame_ready.wait(lock, [&] { return mine.ready; });
      wait_s += watch.seconds();
    }
    if (cancel != nullptr && *cancel) return std::nullopt;
    Slot result = std::exchange(mine, Slot());
    ++taken;
    slot_free.notify_one();
    lock.unlock();
    if (result.fault) std::rethrow_exception(result.fault);
    return std::move(result.frame);
  }
};

DecodeAhead::DecodeAhead(const SequenceReader& reader, const DecodeAheadOptions& options)
    : state_(std::make_unique<State>(reader, options)) {
  try {
    for (int i = 1; i < options.threads; ++i) state_->workers.emplace_back([this] { state_->work(); });
  } catch (const std::system_error&) {
    // The system gives no more threads: those there are and the consumer decode all frames.
  }
}

DecodeAhead::~DecodeAhead() {
  {
    const std::scoped_lock lock(state_->mutex);
    state_->stop = true;
  }
  state_->slot_free.notify_all();
  for (std::thread& worker : state_->workers) worker.join();
}

std::optional<ReadResult> DecodeAhead::next() { return state_->next(); }

double DecodeAhead::decode_s() const {
  const std::scoped_lock lock(state_->mutex);
  return state_->decode_s;
}

double DecodeAhead::wait_s() const {
  const std::scoped_lock lock(state_->mutex);
  return state_->wait_s;
}

int64_t DecodeAhead::capacity() const { return int64_t(state_->slots.size()); }

}  // namespace felt
