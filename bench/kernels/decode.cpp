// Decoders of depth PNG and colour JPEG side by side, on recorded frames held in memory. Pixels are compared first: a
// decoder that differs from libpng's or libjpeg's result ends the program.
//
//   FELTMAP_DATA=<folder of sequences> bench_decode
#include <benchmark/benchmark.h>
#include <spng.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "io/files/text_input.h"
#include "io/images/depth_decode.h"
#include "io/images/image_decode.h"

namespace {

namespace fs = std::filesystem;
using Files = std::vector<std::string>;

/// Up to `limit` files below `folder` whose name ends so.
Files files_ending(const fs::path& folder, const std::string& ending, size_t limit) {
  std::vector<fs::path> paths;
  if (fs::is_directory(folder))
    for (const auto& entry : fs::directory_iterator(folder))
      if (entry.path().filename().string().ends_with(ending)) paths.push_back(entry.path());
  std::sort(paths.begin(), paths.end());
  Files files;
  for (size_t i = 0; i < paths.size() && i < limit; ++i) files.push_back(felt::read_whole_file(paths[i]));
  return files;
}

std::span<const uint8_t> bytes_of(const std::string& file) {
  return {reinterpret_cast<const uint8_t*>(file.data()), file.size()};
}

cv::Mat opencv_decoded(const std::string& file, int flags) {
  return cv::imdecode(cv::Mat(1, int(file.size()), CV_8U, const_cast<char*>(file.data())), flags);
}

felt::Image<uint16_t> gray_by_opencv(const std::string& file) {
  const cv::Mat mat = opencv_decoded(file, cv::IMREAD_UNCHANGED);
  felt::Image<uint16_t> image(mat.cols, mat.rows);
  for (int v = 0; v < mat.rows; ++v) std::copy_n(mat.ptr<uint16_t>(v), mat.cols, image.row(v));
  return image;
}

felt::Image<uint16_t> gray_by_spng(const std::string& file) {
  spng_ctx* context = spng_ctx_new(0);
  spng_set_png_buffer(context, file.data(), file.size());
  spng_ihdr header{};
  spng_get_ihdr(context, &header);
  felt::Image<uint16_t> image(int(header.width), int(header.height));
  spng_decode_image(context, image.data(), image.size() * 2, SPNG_FMT_PNG, 0);
  spng_ctx_free(context);
  return image;
}

felt::Image<uint16_t> gray_by_us(const std::string& file) { return felt::decode_gray16(bytes_of(file), "benchmark"); }

felt::ColorImage color_by_opencv(const std::string& file) {
  const cv::Mat bgr = opencv_decoded(file, cv::IMREAD_COLOR);
  felt::ColorImage image(bgr.cols, bgr.rows);
  cv::Mat rgba(bgr.rows, bgr.cols, CV_8UC4, image.data());
  cv::cvtColor(bgr, rgba, cv::COLOR_BGR2RGBA);
  return image;
}

felt::ColorImage color_by_us(const std::string& file) { return felt::decode_color(bytes_of(file), "benchmark"); }

/// Rendered depth in metres, stored by OpenCV as floating-point TIFF or EXR.
Files as_float_files(const Files& pngs, const std::string& ending, const std::vector<int>& parameters) {
  Files files;
  for (const std::string& png : pngs) {
    cv::Mat metres;
    opencv_decoded(png, cv::IMREAD_UNCHANGED).convertTo(metres, CV_32F, 1 / 6553.5);
    std::vector<uint8_t> bytes;
    cv::imencode(ending, metres, bytes, parameters);
    files.emplace_back(bytes.begin(), bytes.end());
  }
  return files;
}

felt::Image<float> metres_by_opencv(const std::string& file) {
  const cv::Mat mat = opencv_decoded(file, cv::IMREAD_UNCHANGED);
  felt::Image<float> image(mat.cols, mat.rows);
  for (int v = 0; v < mat.rows; ++v) std::copy_n(mat.ptr<float>(v), mat.cols, image.row(v));
  return image;
}

felt::Image<float> metres_by_us(const std::string& file) {
  return std::get<felt::Image<float>>(felt::decode_depth(bytes_of(file), "benchmark"));
}

template <typename Decode>
void time_decoder(const std::string& name, const Files& files, Decode decode) {
  benchmark::RegisterBenchmark(name.c_str(), [&files, decode](benchmark::State& state) {
    size_t i = 0;
    int64_t pixels = 0;
    for (auto _ : state) {
      const auto image = decode(files[i++ % files.size()]);
      pixels += int64_t(image.size());
      benchmark::DoNotOptimize(image.data());
    }
    state.counters["Mpixel/s"] = benchmark::Counter(double(pixels) / 1e6, benchmark::Counter::kIsRate);
  })->Unit(benchmark::kMillisecond);
}

template <typename Decode>
void require_equal(const std::string& what, const Files& files, Decode ours, Decode theirs) {
  for (size_t i = 0; i < files.size(); ++i)
    if (!(ours(files[i]) == theirs(files[i]))) {
      std::fprintf(stderr, "%s: file %zu: pixels differ\n", what.c_str(), i);
      std::exit(1);
    }
  std::printf("%s: %zu files, every pixel equal\n", what.c_str(), files.size());
}

}  // namespace

int main(int argc, char** argv) {
  setenv("OPENCV_IO_ENABLE_OPENEXR", "1", 1);  // OpenCV leaves it off
  benchmark::Initialize(&argc, argv);
  const char* data = std::getenv("FELTMAP_DATA");
  if (data == nullptr) {
    std::fprintf(stderr, "FELTMAP_DATA: expected the folder of recorded sequences, found nothing\n");
    return 2;
  }
  const fs::path root = data;
  static const Files kinect = files_ending(root / "7scenes_redkitchen/seq-01", ".depth.png", 40),
                     rendered = files_ending(root / "house_living_rendered/results", ".png", 40),
                     tum = files_ending(root / "tum_fr1_rpy/depth", ".png", 40),
                     jpeg = files_ending(root / "7scenes_redkitchen/seq-01", ".color.jpg", 40),
                     rgb = files_ending(root / "tum_fr1_rpy/rgb", ".png", 40);
  const std::pair<const char*, const Files*> depth_sets[] = {
      {"depth_png/7scenes", &kinect}, {"depth_png/rendered", &rendered}, {"depth_png/tum", &tum}};
  for (const auto& [name, files] : depth_sets) {
    if (files->empty()) continue;
    require_equal<felt::Image<uint16_t> (*)(const std::string&)>(name, *files, gray_by_us, gray_by_opencv);
    require_equal<felt::Image<uint16_t> (*)(const std::string&)>(name, *files, gray_by_us, gray_by_spng);
    time_decoder(std::string(name) + "/opencv", *files, gray_by_opencv);
    time_decoder(std::string(name) + "/libspng", *files, gray_by_spng);
    time_decoder(std::string(name) + "/libdeflate", *files, gray_by_us);
  }
  const std::pair<const char*, const Files*> color_sets[] = {{"color_jpeg/7scenes", &jpeg}, {"color_png/tum", &rgb}};
  for (const auto& [name, files] : color_sets) {
    if (files->empty()) continue;
    require_equal<felt::ColorImage (*)(const std::string&)>(name, *files, color_by_us, color_by_opencv);
    time_decoder(std::string(name) + "/opencv", *files, color_by_opencv);
    time_decoder(std::string(name) + "/feltmap", *files, color_by_us);
  }
  static const Files tiff = as_float_files(rendered, ".tiff", {cv::IMWRITE_TIFF_COMPRESSION, 8}),
                     exr = as_float_files(rendered, ".exr", {});
  const std::pair<const char*, const Files*> float_sets[] = {{"depth_tiff/rendered", &tiff},
                                                             {"depth_exr/rendered", &exr}};
  for (const auto& [name, files] : float_sets) {
    if (files->empty()) continue;
    require_equal<felt::Image<float> (*)(const std::string&)>(name, *files, metres_by_us, metres_by_opencv);
    time_decoder(std::string(name) + "/opencv", *files, metres_by_opencv);
    time_decoder(std::string(name) + "/feltmap", *files, metres_by_us);
  }
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
