// Files to frames, decoded ahead beside a consumer that is busy for a while with every frame, as fusion is.
//
//   bench_decode_ahead SEQUENCE [frames] [busy_ms]
//
// Prints, for 1, 2 and 3 threads, the time of the whole and the bound: (decoding alone on one thread + busy) / cores.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "io/sequence/decode_ahead.h"
#include "io/sequence/open_sequence.h"

namespace {

double now_s() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

struct Run {
  double total_s, decode_s, wait_s;
  int64_t frames;
};

Run run(const felt::SequenceReader& reader, int threads, double busy_ms) {
  const double start = now_s();
  felt::DecodeAhead ahead(reader, {.threads = threads});
  int64_t frames = 0;
  while (const auto frame = ahead.next()) {
    ++frames;
    for (const double until = now_s() + busy_ms / 1e3; now_s() < until;) {
    }
  }
  return {now_s() - start, ahead.decode_s(), ahead.wait_s(), frames};
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: bench_decode_ahead SEQUENCE [frames] [busy_ms]\n");
    return 2;
  }
  felt::SequenceOptions options;
  if (argc > 2) options.frames.last = std::atoll(argv[2]);
  const double busy_ms = argc > 3 ? std::atof(argv[3]) : 1.0;
  const auto reader = felt::open_sequence(argv[1], options);
  run(*reader, 1, 0);  // the files are in the page cache from here on
  const Run alone = run(*reader, 1, 0);
  std::printf("decoding alone, 1 thread: %.2f ms a frame\n", 1e3 * alone.total_s / double(alone.frames));
  for (const int threads : {1, 2, 3, 4}) {
    std::vector<Run> runs;
    for (int i = 0; i < 5; ++i) runs.push_back(run(*reader, threads, busy_ms));
    std::sort(runs.begin(), runs.end(), [](const Run& a, const Run& b) { return a.total_s < b.total_s; });
    const Run& median = runs[2];
    const double bound_s = (alone.total_s + busy_ms * 1e-3 * double(alone.frames)) / std::min(threads, 2);
    std::printf("%d threads, %.1f ms busy: %.2f ms a frame, %.2f of the bound; waited %.2f ms a frame\n", threads,
                busy_ms, 1e3 * median.total_s / double(median.frames), median.total_s / bound_s,
                1e3 * median.wait_s / double(median.frames));
  }
  return 0;
}
