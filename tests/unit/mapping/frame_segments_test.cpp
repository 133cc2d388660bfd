#include "mapping/labels/frame_segments.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>

#include "mapping/labels/frame_segment_kernels.h"
#include "mapping/labels/segment_voting.h"
#include "tests/support/simd_targets.h"
#include "tests/support/views.h"

namespace felt::test {
namespace {

constexpr int kWidth = 160, kHeight = 120;
const PinholeCamera kCamera{150, 150, 79.5, 59.5, kWidth, kHeight};

/// Depth of the nearest of planes n . p = c in front of the camera.
DepthImage planes(const std::vector<std::pair<Eigen::Vector3d, double>>& all) {
  DepthImage depth(kWidth, kHeight);
  for (int v = 0; v < kHeight; ++v)
    for (int u = 0; u < kWidth; ++u) {
      double nearest = 0;
      for (const auto& [n, c] : all) {
        const double z = c / n.dot(kCamera.ray(u, v));
        if (z > 0 && (nearest == 0 || z < nearest)) nearest = z;
      }
      depth(u, v) = float(nearest);
    }
  return depth;
}

std::map<uint16_t, int> sizes(const Image<uint16_t>& segments) {
  std::map<uint16_t, int> count;
  for (const uint16_t s : segments) ++count[s];
  return count;
}

/// Share of the pixels for which `side` holds that lie in the segment most of them have.
template <typename Side>
double purity(const Image<uint16_t>& segments, const Side& side) {
  std::map<uint16_t, int> count;
  int all = 0, most = 0;
  for (int v = 0; v < segments.height(); ++v)
    for (int u = 0; u < segments.width(); ++u)
      if (side(u, v)) most = std::max(most, ++count[segments(u, v)]), ++all;
  return double(most) / all;
}

}  // namespace

TEST_CASE("a ball before a wall is one segment and the wall another", "[segments]") {
  const Frame frame = ball_before_wall(Eigen::Isometry3d::Identity());
  const Image<uint16_t> segments = frame_segments(frame.depth_m, frame.camera);
  const auto on_ball = [&](int u, int v) { return frame.depth_m(u, v) < 1.8f; };
  std::map<uint16_t, int> count = sizes(segments);
  count.erase(0);  // pixels of the rim, a step of depth from each other
  CHECK(count.size() == 2);
  CHECK(purity(segments, on_ball) > 0.95);
  CHECK(purity(segments, [&](int u, int v) { return !on_ball(u, v); }) == 1);
  CHECK(segments(0, 0) == 1);  // in the order of the first pixel
  CHECK(segments(80, 60) == 2);
}

TEST_CASE("two walls that meet are parted within two pixels of their edge", "[segments]") {
  // A room's corner seen from 1.5 m: the edge is the line x = 0.
  for (const double angle_deg : {40.0, 90.0}) {
    const double a = angle_deg / 2 * 3.14159265358979 / 180;
    const Eigen::Vector3d left(-std::sin(a), 0, std::cos(a)), right(std::sin(a), 0, std::cos(a));
    const double c = 1.5 * std::cos(a);
    const Image<uint16_t> segments = frame_segments(planes({{left, c}, {right, c}}), kCamera);
    INFO(angle_deg);
    CHECK(purity(segments, [](int u, int) { return u < 78; }) == 1);
    CHECK(purity(segments, [](int u, int) { return u > 81; }) == 1);
    CHECK(segments(20, 60) != segments(140, 60));
    CHECK(sizes(segments).size() == 2);
  }
}

TEST_CASE("parallel surfaces are parted by a step of depth and joined without one", "[segments]") {
  for (const auto& [step_m, parts] : {std::pair{0.05f, 2}, {0.0f, 1}}) {
    DepthImage depth(kWidth, kHeight, 1.2f);
    for (int v = 0; v < kHeight; ++v)
      for (int u = 70; u < kWidth; ++u) depth(u, v) += step_m;
    const Image<uint16_t> segments = frame_segments(depth, kCamera);
    CHECK(int(sizes(segments).size()) == parts);
    if (parts == 2) CHECK(purity(segments, [](int u, int) { return u < 70; }) == 1);
  }
}

TEST_CASE("what was not measured has no segment", "[segments]") {
  DepthImage depth(kWidth, kHeight, 1.2f);
  const float faulty[] = {0, -1, std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()};
  for (int v = 0; v < kHeight; ++v)
    for (int u = 60; u < 80; ++u) depth(u, v) = faulty[(u + v) % 4];
  const Image<uint16_t> segments = frame_segments(depth, kCamera);
  for (int v = 0; v < kHeight; ++v)
    for (int u = 0; u < kWidth; ++u) REQUIRE((segments(u, v) == 0) == (u >= 60 && u < 80));
  CHECK(sizes(segments).size() == 3);  // the wall on either side, and nothing between
}

TEST_CASE("noise and small pieces do not break a wall, however the working memory was used before", "[segments]") {
  Random random(3);
  const Eigen::Vector3d tilted = Eigen::Vector3d(0.3, -0.2, 1).normalized();
  DepthImage depth = planes({{tilted, 1.2}});
  for (float& d : depth) d += float(random.between(-0.0015, 0.0015));
  FrameSegmentScratch scratch;
  frame_segments(DepthImage(31, 17, 1.0f), kCamera, {}, {}, scratch);
  const Image<uint16_t> segments = frame_segments(depth, kCamera, {}, {}, scratch);
  CHECK(sizes(segments).size() == 1);
  CHECK(segments == frame_segments(depth, kCamera));
}

TEST_CASE("colour parts a surface where it counts", "[segments]") {
  const DepthImage depth(kWidth, kHeight, 1.2f);
  ColorImage color(kWidth, kHeight, {90, 90, 90, 255});
  for (int v = 30; v < 90; ++v)
    for (int u = 40; u < 120; ++u) color(u, v) = {150, 90, 60, 255};
  FrameSegmentSettings settings;
  settings.color_step = 0;
  CHECK(sizes(frame_segments(depth, kCamera, color, settings)).size() == 1);
  settings.color_step = 40;
  const Image<uint16_t> segments = frame_segments(depth, kCamera, color, settings);
  CHECK(sizes(segments).size() == 2);
  CHECK(purity(segments, [](int u, int v) { return u >= 42 && u < 118 && v >= 32 && v < 88; }) == 1);
  CHECK(segments(80, 60) != segments(10, 10));
}

TEST_CASE("images of any size are cut", "[segments]") {
  for (int width = 1; width < 12; ++width)
    for (int height = 1; height < 12; ++height) {
      FrameSegmentSettings settings;
      settings.min_pixels = 1;
      settings.color_step = 20;
      const Image<uint16_t> segments =
          frame_segments(DepthImage(width, height, 1.0f), kCamera, ColorImage(width, height), settings);
      REQUIRE(segments.width() == width);
      REQUIRE(segments.height() == height);
      for (const uint16_t s : segments) REQUIRE(s == 1);
    }
  CHECK(frame_segments({}, kCamera).empty());
}

TEST_CASE("every SIMD target gives the scalar version's bits for runs of every length", "[segments]") {
  constexpr int kAcross = 90, kRows = 16, kMiddle = 8, kReach = 3;
  constexpr size_t kPixels = size_t(kAcross) * kRows;
  Random random(12);
  std::vector<float> depth(kPixels), step(kPixels), normal[3];
  std::vector<Rgba8> color(kPixels);
  for (auto& plane : normal) plane.resize(kPixels);
  for (size_t p = 0; p < kPixels; ++p) {
    const bool measured = random() > 0.15;
    depth[p] = measured ? float(random.between(1.0, 1.03)) : 0.0f;
    step[p] = measured ? 0.02f : -1.0f;
    const Eigen::Vector3d n(random.between(-0.2, 0.2), random.between(-0.2, 0.2), 1);
    for (int c = 0; c < 3; ++c) normal[c][p] = float(n.normalized()[c]);
    // Few values, so that differences of exactly the limit are among them.
    const auto level = [&] { return uint8_t(90 + 10 * int(5 * random())); };
    color[p] = {level(), level(), level(), uint8_t(255 * random())};
  }
  const size_t row = size_t(kAcross) * kMiddle;
  const DepthRow here{&depth[row], &step[row]};
  const float* const normals[3] = {&normal[0][row], &normal[1][row], &normal[2][row]};
  const SurfaceRow surface{here, {normals[0], normals[1], normals[2]}, 1 / 150.0f, 1 / 140.0f, 44, 7, 0.97f, 0.2f};
  NormalView view{150, 140, 44, 7, kAcross, kReach, true, true, true, true};

  // All that the kernels make of one run, one after the other.
  const auto results = [&](int first, int end, bool scalar) {
    std::vector<float> out(9 * kAcross, -7);
    std::vector<uint8_t> joined(4 * kAcross, 1);
    float *const a = out.data(), *const b = a + kAcross, *const c = a + 2 * kAcross;
    for (const std::ptrdiff_t stride : {std::ptrdiff_t(1), std::ptrdiff_t(kAcross)}) {
      const bool rows = stride == 1;
      float* const plane = rows ? a : b;
      (scalar ? smooth_row_scalar : smooth_row)(here, stride, 2, first, end, here.depth, plane);
      float* const means[3] = {c + (rows ? 0 : 3) * kAcross, c + (rows ? 1 : 4) * kAcross,
                               c + (rows ? 2 : 5) * kAcross};
      (scalar ? smooth_normal_row_scalar : smooth_normal_row)(here, stride, 2, first, end, normals, means, rows);
      uint8_t* const pairs = joined.data() + (rows ? 0 : kAcross);
      (scalar ? join_row_scalar : join_row)(surface, kMiddle, stride, first, end, pairs);
      (scalar ? part_row_by_normals_scalar : part_row_by_normals)(surface, stride, kReach, first, end, pairs);
      (scalar ? part_row_by_color_scalar : part_row_by_color)(&color[row], stride, 1800, first, end,
                                                              joined.data() + (rows ? 2 : 3) * kAcross);
    }
    // The sides in turn, so that none is used that the image has not.
    std::vector<float> slopes;
    for (int without = 0; without < 5; ++without) {
      view.left = without != 1, view.right = without != 2, view.up = without != 3, view.down = without != 4;
      std::vector<float> made(3 * kAcross, -7);
      float* const to[3] = {made.data(), made.data() + kAcross, made.data() + 2 * kAcross};
      (scalar ? normal_row_scalar : normal_row)(view, here, kMiddle, first, end, to);
      slopes.insert(slopes.end(), made.begin(), made.end());
    }
    out.insert(out.end(), slopes.begin(), slopes.end());
    return std::pair(out, joined);
  };
  size_t parted = 0, kept = 0;
  for (int first = 4; first < 8; ++first)
    for (int end = first + 1; end <= kAcross - 5; end += end < 45 ? 1 : 13) {
      const auto expected = results(first, end, true);
      for (const uint8_t j : expected.second) ++(j != 0 ? kept : parted);
      on_every_simd_target([&](const std::string& name) {
        INFO(name << ", pixels " << first << " to " << end);
        const auto found = results(first, end, false);
        REQUIRE(std::memcmp(found.first.data(), expected.first.data(), sizeof(float) * found.first.size()) == 0);
        REQUIRE(found.second == expected.second);
      });
    }
  CHECK(parted > 1000);
  CHECK(kept > 1000);
}

TEST_CASE("every SIMD target cuts the same segments", "[segments]") {
  Random random(5);
  Frame frame = ball_before_wall(Eigen::Isometry3d::Identity(), 163, 121);
  for (float& d : frame.depth_m) d = random() < 0.05 ? 0.0f : d + float(random.between(-0.002, 0.002));
  FrameSegmentSettings settings;
  settings.min_pixels = 20;
  Image<uint16_t> first;
  on_every_simd_target([&](const std::string& name) {
    INFO(name);
    const Image<uint16_t> segments = frame_segments(frame.depth_m, frame.camera, frame.color, settings);
    if (first.empty()) first = segments;
    CHECK(segments == first);
  });
  CHECK(sizes(first).size() > 2);
}

TEST_CASE("labels of a segment become what most of its pixels say, where enough of them do", "[segments]") {
  Image<uint16_t> segments(6, 2, 0);
  LabelImage labels(6, 2, 9);
  const uint16_t numbers[] = {4, 4, 4, 4, 7, 7, 4, 0, 0, 7, 7, 7};
  const uint16_t given[] = {3, 3, 2, kNoLabel, 5, 6, 3, 1, 2, 8, 6, 5};
  std::copy(std::begin(numbers), std::end(numbers), segments.data());
  std::copy(std::begin(given), std::end(given), labels.data());
  LabelImage voted = labels;
  vote_labels(segments, 0.5, voted);
  // Segment 4: three of four say 3. Segment 7: 5 and 6 twice each of five, too few. No segment: as it was.
  CHECK(std::vector<uint16_t>(voted.begin(), voted.end()) == std::vector<uint16_t>{3, 3, 3, 3, 5, 6, 3, 1, 2, 8, 6, 5});
  vote_labels(segments, 0.0, labels);
  CHECK(labels(4, 0) == 5);
  CHECK(labels(3, 1) == 5);
}

TEST_CASE("pooled probabilities are the mean over the segment", "[segments]") {
  Random random(8);
  constexpr int kPixels = 40, kTop = 3, kClasses = 6;
  Image<uint16_t> segments(8, 5, 0);
  ProbabilityImage image{8, 5, kTop, std::vector<uint16_t>(kPixels * kTop), std::vector<float>(kPixels * kTop)};
  std::map<uint16_t, std::map<uint16_t, double>> sum;
  std::map<uint16_t, int> count;
  for (int p = 0; p < kPixels; ++p) {
    const auto s = uint16_t(3 * random()), first = uint16_t(kClasses * random());
    segments.data()[p] = s;
    const double a = random.between(0.5, 0.8);
    const float probability[kTop] = {float(a), float(0.7 * (1 - a)), float(0.3 * (1 - a))};
    if (p == 11) continue;  // without a prediction
    ++count[s];
    for (int r = 0; r < kTop; ++r) {
      image.class_id[size_t(p * kTop + r)] = uint16_t((first + r) % kClasses);
      image.probability[size_t(p * kTop + r)] = probability[r];
      sum[s][uint16_t((first + r) % kClasses)] += double(probability[r]);
    }
  }
  segments.data()[11] = 1;
  const ProbabilityImage before = image;
  for (const double own : {0.0, 0.25}) {
    ProbabilityImage pooled = before;
    pool_probabilities(segments, own, pooled);
    for (int p = 0; p < kPixels; ++p) {
      const uint16_t s = segments.data()[p];
      std::map<uint16_t, double> expected;
      for (int r = 0; r < kTop; ++r)
        expected[before.class_id[size_t(p * kTop + r)]] += (s == 0    ? 1
                                                            : p == 11 ? 0
                                                                      : own) *
                                                           double(before.probability[size_t(p * kTop + r)]);
      if (s != 0)
        for (const auto& [c, total] : sum[s]) expected[c] += (p == 11 ? 1 : 1 - own) * total / count[s];
      std::vector<double> order;
      for (const auto& [c, value] : expected) order.push_back(value);
      std::sort(order.rbegin(), order.rend());
      for (size_t r = 0; r < kTop; ++r) {
        const size_t at = size_t(p) * kTop + r;
        const double value = r < order.size() ? order[r] : 0;
        REQUIRE(double(pooled.probability[at]) == Approx(value).margin(1e-6));
        if (value > 0) REQUIRE(expected[pooled.class_id[at]] == Approx(value).margin(1e-6));
      }
    }
  }
}

}  // namespace felt::test
