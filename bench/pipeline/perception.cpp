// The whole `reconstruct --segmenter` against OpenCV's dnn module called directly on the same cores.
//
//   bench_perception FELTMAP NET.yaml SEQUENCE [frames=40] [threads=2] [rounds=3]
//
// Directly, in two ways, on inputs that are ready and from all over the frames: one network that uses all threads,
// which is what a program gets that calls the library, and a network for each thread, which uses the cores better and
// is what the command does. Networks are loaded before the time starts. All three alternate within one run; medians and
// their ratios are printed, of the time by the clock and of the processors' (which other programs disturb less). Fails
// where the command did not fuse every frame or made no labels.
#include <sys/resource.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/core/utility.hpp>
#include <opencv2/dnn.hpp>
#include <string>
#include <thread>
#include <vector>

#include "bench/support/bench.h"
#include "io/segmentation/segmenter.h"

namespace {
namespace fs = std::filesystem;

std::vector<cv::dnn::Net> loaded(const felt::NetModel& model, int count) {
  std::vector<cv::dnn::Net> nets;
  for (int i = 0; i < count; ++i) {
    nets.push_back(cv::dnn::readNetFromONNX(model.bytes.data(), model.bytes.size()));
    nets.back().enableFusion(false);  // as the command runs it, for the sake of right results
  }
  return nets;
}

/// Runs each network on a thread of its own and with as many threads of the library's.
double direct_s(const felt::NetModel& model, std::vector<cv::dnn::Net> nets, int library_threads,
                const std::vector<felt::Planes>& inputs, int frames) {
  cv::setNumThreads(library_threads);
  std::atomic<int> next = 0;
  const auto work = [&](cv::dnn::Net& net) {
    for (int i; (i = next++) < frames;) {
      const felt::Planes& input = inputs[size_t(i) % inputs.size()];
      const int shape[] = {1, input.count, input.height, input.width};
      net.setInput(cv::Mat(4, shape, CV_32F, const_cast<float*>(input.value.data())), model.description.input);
      net.forward(model.description.output);
    }
  };
  return felt::bench::seconds([&] {
    std::vector<std::thread> workers;
    for (cv::dnn::Net& net : nets) workers.emplace_back(work, std::ref(net));
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
  Times direct, direct_each, whole;
  nlohmann::json report;
  for (int round = 0; round < rounds; ++round) {
    std::vector<cv::dnn::Net> one = loaded(model, 1), several = loaded(model, threads);
    direct.add(RUSAGE_SELF, [&] { return direct_s(model, std::move(one), threads, inputs, frames); });
    direct_each.add(RUSAGE_SELF, [&] { return direct_s(model, std::move(several), 1, inputs, frames); });
    int status = 0;
    whole.add(RUSAGE_CHILDREN, [&] { return felt::bench::seconds([&] { status = std::system(command.c_str()); }); });
    if (status != 0) return 1;
    report = nlohmann::json::parse(std::ifstream(out / "report.json"));
    if (report["frames"]["fused"] != frames || report["bytes"]["classes"] == 0) {
      std::fprintf(stderr, "the command fused %s frames\n", report["frames"]["fused"].dump().c_str());
      return 1;
    }
  }
  std::printf("%d frames, %d threads, seconds by the clock (of processors)\n", frames, threads);
  const double whole_s = felt::bench::median(whole.clock_s), whole_processor_s = felt::bench::median(whole.processor_s);
  std::printf("whole command:                  %.2f (%.2f)\n", whole_s, whole_processor_s);
  const auto compare = [&](const char* what, const Times& alone) {
    const double clock_s = felt::bench::median(alone.clock_s), processor_s = felt::bench::median(alone.processor_s);
    std::printf("%-31s %.2f (%.2f), whole command %.3f (%.3f) of it\n", what, clock_s, processor_s, whole_s / clock_s,
                whole_processor_s / processor_s);
  };
  compare("one network on all threads:", direct);
  compare("a network for each thread:", direct_each);
  std::printf("last run, seconds of threads: %s\n", report["time_s"].dump().c_str());
  fs::remove_all(out);
  return 0;
}
