#include "io/sequence/decode_ahead.h"

#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <stdexcept>
#include <thread>

using namespace felt;

namespace {

/// Frames of uneven decoding time; every seventh is skipped. Watches how many are decoded but not yet taken.
class SlowReader final : public SequenceReader {
public:
  explicit SlowReader(int64_t count, int64_t throws_at = -1) : count_(count), throws_at_(throws_at) {
    info_.camera = {20, 20, 4, 4, 8, 8};
  }
  const SequenceInfo& info() const override { return info_; }
  int64_t size() const override { return count_; }
  FrameName name(int64_t i) const override { return {i, double(i)}; }
  ReadResult read(int64_t i) const override {
    const int64_t ahead = ++started - taken;
    for (int64_t seen = most_ahead; ahead > seen && !most_ahead.compare_exchange_weak(seen, ahead);) {
    }
    std::this_thread::sleep_for(std::chrono::microseconds((i * 37 % 5) * 200));
    if (i == throws_at_) throw std::runtime_error("disk gone");
    if (i % 7 == 3) return SkippedFrame{i, "missing pose", ""};
    Frame frame;
    frame.index = i;
    return frame;
  }

  mutable std::atomic<int64_t> started = 0, most_ahead = 0;
  std::atomic<int64_t> taken = 0;

private:
  SequenceInfo info_;
  int64_t count_, throws_at_;
};

int64_t index_of(const ReadResult& result) {
  return std::visit([](const auto& frame) { return frame.index; }, result);
}

}  // namespace

TEST_CASE("frames decoded ahead come in recorded order, bad ones included, within the bound") {
  const int threads = GENERATE(1, 2, 3, 8);
  SlowReader reader(60);
  DecodeAhead ahead(reader, {.threads = threads, .max_frames = 8});
  CHECK(ahead.capacity() == 8);
  for (int64_t i = 0; i < 60; ++i) {
    const auto result = ahead.next();
    ++reader.taken;
    REQUIRE(result);
    CHECK(index_of(*result) == i);
    CHECK(std::holds_alternative<SkippedFrame>(*result) == (i % 7 == 3));
  }
  CHECK(!ahead.next());
  CHECK(!ahead.next());
  CHECK(reader.started == 60);
  // The frame that the consumer took last is counted as taken a moment after its slot is free.
  CHECK(reader.most_ahead <= 8 + 1);
  CHECK(ahead.decode_s() > 0);
}

TEST_CASE("memory bounds the frames ahead, but every thread keeps one") {
  SlowReader reader(1);
  const int64_t bytes = frame_bytes(reader.info());
  CHECK(bytes == 8 * 8 * 4);
  CHECK(DecodeAhead(reader, {.threads = 2, .max_frames = 100, .max_bytes = 5 * bytes}).capacity() == 5);
  CHECK(DecodeAhead(reader, {.threads = 2, .max_frames = 100, .max_bytes = 1}).capacity() == 2);
}

TEST_CASE("one thread decodes nothing before it is asked") {
  SlowReader reader(5);
  DecodeAhead ahead(reader, {.threads = 1});
  CHECK(reader.started == 0);
  CHECK(ahead.next());
  CHECK(reader.started == 1);
}

TEST_CASE("decoding ends early when cancelled or when the consumer goes away") {
  SlowReader reader(100000);
  {
    std::atomic<bool> cancel = false;
    DecodeAhead ahead(reader, {.threads = 3, .max_frames = 6, .cancel = &cancel});
    CHECK(ahead.next());
    cancel = true;
    CHECK(!ahead.next());
  }
  CHECK(reader.started <= 8);
}

TEST_CASE("what reading throws reaches the consumer at the frame's turn, and later frames still come") {
  const int threads = GENERATE(1, 3);
  SlowReader reader(10, 4);
  DecodeAhead ahead(reader, {.threads = threads, .max_frames = 4});
  for (int64_t i = 0; i < 4; ++i) CHECK(index_of(*ahead.next()) == i);
  CHECK_THROWS_WITH(ahead.next(), "disk gone");
  CHECK(index_of(*ahead.next()) == 5);
}
