// What a reader adds to decoding: every recorded sequence through its reader, one thread, beside nothing but the
// decoders that `reconstruct` uses on the same files in memory, and beside OpenCV on them.
//   bench_readers
#include <cstdint>
#include <fstream>
#include <functional>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "bench/support/bench.h"
#include "io/files/system_memory.h"
#include "io/images/depth_decode.h"
#include "io/images/image_decode.h"

namespace {

using namespace felt;

std::string bytes_of(const ImageSource& source) {
  if (source.empty()) return {};
  std::ifstream file(source.path, std::ios::binary);
  file.seekg(std::streamoff(source.offset));
  if (source.bytes == 0) return {std::istreambuf_iterator<char>(file), {}};
  std::string bytes(source.bytes, '\0');
  file.read(bytes.data(), std::streamsize(bytes.size()));
  return bytes;
}

std::span<const uint8_t> as_bytes(const std::string& text) {
  return {reinterpret_cast<const uint8_t*>(text.data()), text.size()};
}

/// The images of one frame in memory, as stored.
struct Stored {
  std::string depth, color, labels, instances;
  bool deflated = false;  ///< depth is a bare zlib stream, as in .sens
};

/// Milliseconds a frame, the best of three rounds.
double ms_a_frame(size_t frames, const std::function<void(size_t)>& work) {
  double best = 1e9;
  for (int round = 0; round < 3; ++round)
    best = std::min(best, bench::seconds([&] {
                      for (size_t i = 0; i < frames; ++i) work(i);
                    }));
  return 1e3 * best / double(frames);
}

void decode_by_opencv(const std::string& bytes, int flags) {
  cv::imdecode(cv::Mat(1, int(bytes.size()), CV_8U, const_cast<char*>(bytes.data())), flags);
}

void run(const std::string& name) {
  const std::filesystem::path path = bench::recorded(name);
  const SequenceListing listing = list_sequence(path);
  const std::unique_ptr<SequenceReader> reader = open_sequence(path);
  const size_t count = std::min<size_t>(size_t(reader->size()), 40);
  std::vector<Stored> stored;
  for (size_t i = 0; i < count; ++i) {
    const FrameRecord& frame = listing.frames[i];
    stored.push_back({bytes_of(frame.depth), bytes_of(frame.color), bytes_of(frame.labels), bytes_of(frame.instances),
                      frame.depth.codec == ImageSource::Codec::zlib_u16});
  }
  size_t read = 0;
  const double whole =
      ms_a_frame(count, [&](size_t i) { read += std::holds_alternative<Frame>(reader->read(int64_t(i))); });
  const double chosen = ms_a_frame(count, [&](size_t i) {
    const Stored& s = stored[i];
    if (s.deflated)
      decode_u16_values(as_bytes(s.depth), true, listing.width, listing.height, "benchmark");
    else
      decode_depth(as_bytes(s.depth), "benchmark");
    if (!s.color.empty()) decode_color(as_bytes(s.color), "benchmark");
    if (!s.labels.empty()) decode_gray16(as_bytes(s.labels), "benchmark");
    if (!s.instances.empty()) decode_gray16(as_bytes(s.instances), "benchmark");
  });
  std::printf("| %s | %s | %zu of %zu | %.2f | %.2f | %.2f |", name.c_str(), listing.layout.c_str(), read / 3, count,
              whole, chosen, whole / chosen);
  if (stored[0].deflated) {
    std::printf(" - | - |\n");
    return;
  }
  const double opencv = ms_a_frame(count, [&](size_t i) {
    decode_by_opencv(stored[i].depth, cv::IMREAD_UNCHANGED);
    if (!stored[i].color.empty()) decode_by_opencv(stored[i].color, cv::IMREAD_COLOR);
    if (!stored[i].labels.empty()) decode_by_opencv(stored[i].labels, cv::IMREAD_UNCHANGED);
    if (!stored[i].instances.empty()) decode_by_opencv(stored[i].instances, cv::IMREAD_UNCHANGED);
  });
  std::printf(" %.2f | %.2f |\n", opencv, whole / opencv);
}

}  // namespace

int main() {
  cv::setNumThreads(1);
  keep_freed_memory();  // as the program does, for all three
  std::printf(
      "| sequence | layout | frames | reader, ms a frame | decoders alone, ms | times | OpenCV's decoders, ms | times "
      "|\n|---|---|---|---|---|---|---|---|\n");
  for (const char* name : {"7scenes_redkitchen", "7scenes_redkitchen_png", "tum_fr1_rpy", "house_living_rendered",
                           "icl_livingroom_maskrcnn", "labelfusion_shelf", "apc_shelf_probs", "open3d_redwood_5",
                           "scannet_sens_small", "sun3d_nvblox_5"})
    run(name);
}
