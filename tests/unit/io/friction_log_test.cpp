#include "io/readings/friction_log.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "core/error.h"

using namespace felt;

namespace {

/// A finger comes down, is pushed until it breaks away at `stick` times the normal force, slides at `slide` and lifts.
std::string simulated_log(double stick, double slide, double noise_n, const Eigen::Vector3d& normal, uint32_t seed) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> noise(0, noise_n);
  const Eigen::Vector3d n = normal.normalized(), t = n.unitOrthogonal();
  std::string csv = "time,fx,fy,fz,tx\n";
  for (int i = 0; i < 2500; ++i) {
    const double time = i * 0.002;
    const double load = time < 0.5 || time > 4.5 ? 0 : 20 * std::min({1.0, (time - 0.5) / 0.2, (4.5 - time) / 0.2});
    const double ratio = time < 1 ? 0 : time < 1.5 ? stick * (time - 1) / 0.5 : time < 4.3 ? slide : 0;
    const Eigen::Vector3d f = load * (n + ratio * t) + Eigen::Vector3d(noise(rng), noise(rng), noise(rng)) +
                              0.3 * std::sin(2 * std::numbers::pi * 50 * time) * t;
    char line[160];
    snprintf(line, sizeof line, "%.4f,%.5f,%.5f,%.5f,0\n", time, f.x(), f.y(), f.z());
    csv += line;
  }
  return csv;
}

void refused(const std::string& text, const FrictionSettings& settings, const std::string& reason) {
  CHECK_THROWS_WITH(friction_reading(parse_force_log(text, "log.csv"), settings), Catch::Contains(reason));
}

}  // namespace

TEST_CASE("a log of known friction gives its kinetic value and its static peak") {
  for (const double mu : {0.139, 0.31, 0.628}) {
    FrictionSettings settings;
    settings.normal = {0.2, -0.4, 2};
    const ForceLog log = parse_force_log(simulated_log(1.25 * mu, mu, 0.2, settings.normal, 5), "log.csv");
    const FrictionReading reading = friction_reading(log, settings);
    INFO("mu " << mu);
    CHECK(reading.kinetic_mean == Approx(mu).epsilon(0.02));
    CHECK(std::abs(reading.kinetic_mean - mu) < 3 * reading.kinetic_sd);
    CHECK(reading.kinetic_sd < 0.02);
    // The low-pass takes a little off a peak as sharp as this one.
    CHECK(reading.static_peak > 1.1 * mu);
    CHECK(reading.static_peak < 1.27 * mu);
    CHECK(log.time_s[reading.peak] == Approx(1.5).margin(0.05));
    CHECK(log.time_s[reading.slide_begin] > 1.5);
    CHECK(log.time_s[reading.slide_end] < 4.3);
  }
}

TEST_CASE("the sign of the sensor does not matter") {
  FrictionSettings settings;
  const ForceLog log = parse_force_log(simulated_log(0.4, 0.35, 0.1, settings.normal, 1), "log.csv");
  ForceLog mirrored = log;
  for (Eigen::Vector3d& f : mirrored.force_n) f = -f;
  CHECK(friction_reading(mirrored, settings).kinetic_mean ==
        Approx(friction_reading(log, settings).kinetic_mean).epsilon(1e-12));
}

TEST_CASE("the low-pass has no delay, keeps slow signals and stops fast ones by the squared Butterworth gain") {
  const double rate = 500, cutoff = 10;
  for (const double frequency : {1.0, 10.0, 40.0}) {
    std::vector<double> wave;
    for (int i = 0; i < 2000; ++i) wave.push_back(std::sin(2 * std::numbers::pi * frequency * i / rate));
    const std::vector<double> out = low_pass_zero_phase(wave, rate, cutoff);
    const double w = std::tan(std::numbers::pi * frequency / rate) / std::tan(std::numbers::pi * cutoff / rate);
    const double gain = 1 / (1 + std::pow(w, 4));
    for (size_t i = 500; i < 1500; ++i) REQUIRE(out[i] == Approx(gain * wave[i]).margin(1e-6));
  }
}

TEST_CASE("a log of a spreadsheet is read as any other") {
  const FrictionSettings settings;
  const std::string plain = simulated_log(0.4, 0.35, 0.1, settings.normal, 1);
  std::string exported = "\xef\xbb\xbf";
  for (const char c : plain)
    exported += c == ',' ? std::string(";") : c == '\n' ? std::string("\r\n") : std::string(1, c);
  const ForceLog log = parse_force_log(exported, "log.csv"), expected = parse_force_log(plain, "log.csv");
  CHECK(log.time_s == expected.time_s);
  CHECK(log.force_n == expected.force_n);
}

TEST_CASE("a log without what it takes says so") {
  const FrictionSettings settings;
  const std::string good = simulated_log(0.4, 0.35, 0.1, settings.normal, 1);
  CHECK_THROWS_WITH(parse_force_log("t,fx,fz\n", "log.csv"), Catch::Contains("log.csv:1") && Catch::Contains("fy"));
  CHECK_THROWS_WITH(parse_force_log("t,fx,fy,fz\n0,1,2,nan\n0,1,2\n1,1,2\n", "log.csv"),
                    "log.csv:2: cell: expected a finite number, found 'nan' (and 2 more faults)");
  CHECK_THROWS_WITH(parse_force_log("t,fx,fy,fz\n1,0,0,1\n1,0,0,1\n", "log.csv"),
                    Catch::Contains("after the line before"));
  CHECK_THROWS_WITH(parse_force_log("", "log.csv"), Catch::Contains("empty file"));
  CHECK_THROWS_WITH(parse_force_log("t,fx,fy,fz\n0,0,0,1\n", "log.csv"), Catch::Contains("at least 16"));
  CHECK_THROWS_AS(read_force_log("/does/not/exist.csv"), IoError);
  FrictionSettings other = settings;
  other.contact_n = 100;
  refused(good, other, "contact");
  other = settings;
  other.normal = {0, 0, 0};
  refused(good, other, "a direction");
  other = settings;
  other.cutoff_hz = 400;
  refused(good, other, "half the rate");
  std::string still = "t,fx,fy,fz\n";
  for (int i = 0; i < 100; ++i) still += std::to_string(i * 0.01) + ",1,0,0\n";
  refused(still, settings, "normal force");
  std::string pressed = "t,fx,fy,fz\n";
  for (int i = 0; i < 100; ++i) pressed += std::to_string(i * 0.01) + ",0,0,9\n";
  refused(pressed, settings, "sliding");
}

namespace {

/// Pressed with 20 N from 1 s to `lift_s`, at 500 Hz, with F_t/F_n of `ratio(t)` and noise and an offset of the sensor.
template <typename Ratio>
ForceLog pressed_log(double lift_s, double idle_s, double noise_n, double offset_n, const Ratio& ratio) {
  std::mt19937 rng(3);
  std::normal_distribution<double> noise(0, noise_n);
  ForceLog log;
  for (int i = 0; double(i) * 0.002 < lift_s + 2 * idle_s; ++i) {
    const double time = i * 0.002, t = time - idle_s;
    const double load = t < 0 || t > lift_s ? 0 : 20 * std::min({1.0, t / 0.1, (lift_s - t) / 0.1});
    log.time_s.push_back(time);
    log.force_n.emplace_back(load * ratio(t) + noise(rng) + offset_n, noise(rng), load + noise(rng));
  }
  return log;
}

}  // namespace

TEST_CASE("a foot that is pressed, or pulled and sticks, did not slide") {
  const auto found = [](const ForceLog& log) {
    CHECK_THROWS_WITH(friction_reading(log, {}), Catch::Contains("sliding: expected at least 16 samples of steady"));
  };
  found(pressed_log(3, 1, 0.1, 0, [](double) { return 0.0; }));
  found(pressed_log(5, 1, 0.1, 0, [](double t) { return 0.08 * t; }));
  found(pressed_log(4, 1, 0.05, 0, [](double t) { return t < 1 ? 0 : 0.15 * (t - 1); }));
}

TEST_CASE("what a sensor reads without contact is taken off") {
  for (const double offset_n : {0.5, 1.0, -2.0}) {
    const FrictionReading reading =
        friction_reading(pressed_log(4, 1, 0.1, offset_n, [](double t) { return t < 1 ? 0.16 * t : 0.139; }), {});
    INFO("offset " << offset_n);
    CHECK(reading.kinetic_mean == Approx(0.139).epsilon(0.02));
    CHECK(reading.static_peak == Approx(0.155).margin(0.01));
    CHECK(reading.offset_n.x() == Approx(offset_n).margin(0.02));
    CHECK(reading.offset_n.z() == Approx(0).margin(0.02));
  }
}

TEST_CASE("a tool's weight along the normal is taken off, however it compares with a contact") {
  for (const double weight_n : {0.5, 1.1, 3.0, -2.0, -3.0}) {
    ForceLog log = pressed_log(4, 2, 0.05, 0.5, [](double t) { return t < 1 ? 0.6 * t : 0.5; });
    for (Eigen::Vector3d& f : log.force_n) f.z() += weight_n;
    const FrictionReading reading = friction_reading(log, {});
    INFO("weight " << weight_n);
    CHECK(reading.kinetic_mean == Approx(0.5).epsilon(0.01));
    CHECK(reading.static_peak == Approx(0.59).margin(0.02));
    CHECK(reading.offset_n.z() == Approx(weight_n).margin(0.02));
    CHECK(log.time_s[reading.contact_begin] == Approx(2).margin(0.05));
    CHECK(log.time_s[reading.slide_begin] > 3);
  }
  // A log that starts and ends in contact has nothing to take off.
  ForceLog pressed = pressed_log(6, 0, 0.05, 0, [](double t) { return t < 2 ? 0.25 * t : 0.4; });
  pressed.time_s = {pressed.time_s.begin() + 100, pressed.time_s.end() - 100};
  pressed.force_n = {pressed.force_n.begin() + 100, pressed.force_n.end() - 100};
  CHECK(friction_reading(pressed, {}).offset_n.norm() == 0);
  CHECK(friction_reading(pressed, {}).kinetic_mean == Approx(0.4).epsilon(0.01));
}

TEST_CASE("touch-down, lift-off and long waiting leave the static peak alone") {
  for (const double mu : {0.05, 0.3}) {
    const FrictionReading reading =
        friction_reading(pressed_log(4, 10, 0.5, 0, [&](double t) { return t < 1 ? 1.2 * mu * t : mu; }), {});
    INFO("mu " << mu);
    CHECK(reading.kinetic_mean == Approx(mu).margin(0.01));
    CHECK(reading.static_peak == Approx(1.15 * mu).margin(0.02));
  }
}

TEST_CASE("a slow pull before a short slide is no part of it") {
  const ForceLog log = pressed_log(8.2, 0.5, 0.1, 0, [](double t) {
    return t < 6 ? 0.36 * t / 6 : t < 6.05 ? 0.36 - (t - 6) * 1.2 : 0.3;
  });
  const FrictionReading reading = friction_reading(log, {});
  CHECK(reading.kinetic_mean == Approx(0.3).epsilon(0.02));
  CHECK(reading.kinetic_sd < 0.02);
  CHECK(log.time_s[reading.slide_begin] > 6.5);
  CHECK(reading.static_peak > 0.34);
  CHECK(log.time_s[reading.peak] == Approx(6.5).margin(0.1));
}
