// The whole `reconstruct --segmenter` against the network alone on the same number of threads.
//
//   bench_perception FELTMAP NET.yaml SEQUENCE [frames=40] [threads=2] [rounds=3]
//
// Alone: each thread runs a network of its own on inputs that are ready, taken from all over the frames. Both alternate
// within one run; medians and their ratio are printed, of the time by the clock and of the processors' (which other
// programs disturb less). Fails where the command did not fuse every frame or made no labels.
#include <sys/resource.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "bench/support/bench.h"
#include "io/segmentation/segmenter.h"

namespace {
namespace fs = std::filesystem;

using Networks = std::vector<std::unique_ptr<felt::Network>>;

/// A thread for each network.
double network_alone_s(const Networks& networks, const std::vector<felt::Planes>& inputs, int frames) {
  std::atomic<int> next = 0;
  return felt::bench::seconds([&] {
    std::vector<std::thread> workers;
    for (const auto& network : networks)
      workers.emplace_back([&, own = network.get()] {
        for (int i; (i = next++) < frames;) own->run(inputs[size_t(i) % inputs.size()]);
      });
    for (std::thread& worker : workers) worker.join();
  });
}

/// Processor time of this process (RUSAGE_SELF) or of its children that have ended (RUSAGE_CHILDREN).
double processor_s(int who) {
  rusage usage{};
  getrusage(who, &usage);
  const auto seconds = [](const timeval& t) { return double(t.tv_sec) + 1e-6 * double(t.tv_usec); };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

/// Times of one way, a value for each round.
struct Times {
  std::vector<double> clock_s, processor_s;

  template <class Work>
  void add(int who, const Work& work) {
    const double before = ::processor_s(who);
    clock_s.push_back(work());
    processor_s.push_back(::processor_s(who) - before);
  }
};

}  // namespace

int main(int argc, char** argv) {
  if (argc < 4) {
    std::fprintf(stderr, "usage: bench_perception FELTMAP NET.yaml SEQUENCE [frames] [threads] [rounds]\n");
    return 2;
  }
  const auto number = [&](int i, int otherwise) { return argc > i ? std::atoi(argv[i]) : otherwise; };
  const int frames = number(4, 40), threads = number(5, 2), rounds = number(6, 3);
  const felt::Segmenter segmenter(felt::read_net_description(argv[2]), {});
  const felt::NetModel model = felt::load_net_model(segmenter.description());
  const auto reader = felt::open_sequence(argv[3]);
  std::vector<felt::Planes> inputs;
  const int64_t available = std::min<int64_t>(frames, reader->size()), kept = std::min<int64_t>(8, available);
  for (int64_t i = 0; i < kept; ++i) {
    const felt::ReadResult result = reader->read(i * available / kept);
    if (const auto* frame = std::get_if<felt::Frame>(&result)) inputs.push_back(segmenter.input_of(frame->color));
  }
  const fs::path out = fs::temp_directory_path() / "feltmap-bench-perception";
  const std::string command = std::string("'") + argv[1] + "' reconstruct '" + argv[3] + "' --segmenter '" + argv[2] +
                              "' --frames 0:" + std::to_string(frames) + " --out '" + out.string() +
                              "' --force --quiet --threads " + std::to_string(threads);
  Times alone, whole;
  nlohmann::json report;
  for (int round = 0; round < rounds; ++round) {
    Networks networks;
    for (int i = 0; i < threads; ++i) networks.push_back(felt::open_network(model));
    alone.add(RUSAGE_SELF, [&] { return network_alone_s(networks, inputs, frames); });
    int status = 0;
    whole.add(RUSAGE_CHILDREN, [&] { return felt::bench::seconds([&] { status = std::system(command.c_str()); }); });
    if (status != 0) return 1;
    report = nlohmann::json::parse(std::ifstream(out / "report.json"));
    if (report["frames"]["fused"] != frames || report["bytes"]["classes"] == 0) {
      std::fprintf(stderr, "the command fused %s frames\n", report["frames"]["fused"].dump().c_str());
      return 1;
    }
  }
  const auto compare = [&](const char* what, const std::vector<double>& a, const std::vector<double>& b) {
    const double alone_s = felt::bench::median(a), whole_s = felt::bench::median(b);
    std::printf("%s: network alone %.2f s, whole command %.2f s, ratio %.3f\n", what, alone_s, whole_s,
                whole_s / alone_s);
  };
  std::printf("%d frames, %d threads\n", frames, threads);
  compare("clock", alone.clock_s, whole.clock_s);
  compare("processors", alone.processor_s, whole.processor_s);
  std::printf("last run, seconds of threads: %s\n", report["time_s"].dump().c_str());
  fs::remove_all(out);
  return 0;
}
