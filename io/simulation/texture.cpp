#include "io/simulation/texture.h"

#include <array>
#include <cmath>

#include "io/simulation/random.h"

namespace felt {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

float srgb_encode(float linear) {
  return linear <= 0.0031308f ? 12.92f * linear : 1.055f * std::pow(linear, 1 / 2.4f) - 0.055f;
}
float srgb_decode(float s) { return s <= 0.04045f ? s / 12.92f : std::pow((s + 0.055f) / 1.055f, 2.4f); }

/// Uniform in [0, 1) per cell of the integer lattice.
float lattice(int64_t x, int64_t y, int64_t z, uint64_t seed) {
  return float(mix64(mix64(uint64_t(x) * 0x8da6b343u + uint64_t(y) * 0xd8163841u + uint64_t(z) * 0xcb1ab31fu) ^ seed) >>
               40) *
         0x1p-24f;
}

/// Trilinear value noise in [0, 1], smooth across cells.
float value_noise(const Vector3d& p, uint64_t seed) {
  const Vector3d cell = p.array().floor();
  const Vector3f f = (p - cell).cast<float>();
  const Vector3f s = f.array() * f.array() * (3 - 2 * f.array());
  const int64_t x = int64_t(cell.x()), y = int64_t(cell.y()), z = int64_t(cell.z());
  const auto mix = [](float a, float b, float t) { return a + (b - a) * t; };
  const auto edge = [&](int dy, int dz) {
    return mix(lattice(x, y + dy, z + dz, seed), lattice(x + 1, y + dy, z + dz, seed), s.x());
  };
  return mix(mix(edge(0, 0), edge(1, 0), s.y()), mix(edge(0, 1), edge(1, 1), s.y()), s.z());
}

float fractal_noise(const Vector3d& p, uint64_t seed) {
  return 0.65f * value_noise(p, seed) + 0.35f * value_noise(p * 2.7, seed + 1);
}

/// The two coordinates along a face, from the face's dominant normal axis.
Eigen::Vector2d face_coordinates(const Vector3d& p, const Vector3d& n) {
  const Vector3d a = n.cwiseAbs();
  if (a.z() >= a.x() && a.z() >= a.y()) return {p.x(), p.y()};
  if (a.x() >= a.y()) return {p.y(), p.z()};
  return {p.x(), p.z()};
}

/// How far between the two colours a pattern is at a point, in [0, 1].
float pattern_mix(const Texture& t, const Vector3d& p, const Vector3d& n, uint64_t seed) {
  const double inverse = 1 / t.scale_m;
  switch (t.pattern) {
    case Pattern::plain:
      return 0.25f * fractal_noise(p * inverse * 4, seed);
    case Pattern::noise:
      return fractal_noise(p * inverse, seed);
    case Pattern::checker: {
      // Shifted by an irrational amount, so that no face of a solid coincides with a border between cells.
      const Vector3d c = (p * inverse + Vector3d::Constant(0.3819660113)).array().floor();
      const float grain = 0.12f * value_noise(p * inverse * 6, seed);
      return (int64_t(c.x() + c.y() + c.z()) & 1) != 0 ? 1 - grain : grain;
    }
    case Pattern::wood: {
      const Eigen::Vector2d uv = face_coordinates(p, n) * inverse;
      const int64_t board = int64_t(std::floor(uv.y()));
      const double along = uv.x() * 0.35 + 7.1 * double(lattice(board, 0, 0, seed + 2));
      const float tint = 0.45f * lattice(board, int64_t(std::floor(along * 0.4)), 1, seed);
      const float grain = value_noise({along * 1.3, uv.y() * 9, double(board)}, seed + 3);
      const bool gap = uv.y() - double(board) < 0.03;
      return gap ? 1.0f : std::min(1.0f, tint + 0.4f * grain);
    }
    case Pattern::tiles: {
      const Eigen::Vector2d uv = face_coordinates(p, n) * inverse, cell = uv.array().floor(), f = uv - cell;
      if (f.x() < 0.04 || f.y() < 0.04) return 1.0f;
      return 0.3f * lattice(int64_t(cell.x()), int64_t(cell.y()), 2, seed) + 0.15f * value_noise(p * inverse * 5, seed);
    }
    case Pattern::stripes: {
      const Eigen::Vector2d uv = face_coordinates(p, n) * inverse;
      const float band = lattice(int64_t(std::floor(uv.x())), 0, 3, seed);
      return 0.85f * band + 0.15f * value_noise(p * inverse * 12, seed);
    }
    case Pattern::picture: {
      const Eigen::Vector2d uv = face_coordinates(p, n) * inverse;
      const float hills = float(0.25 * std::sin(uv.x() * 2.2 + double(seed % 7)) + 0.12 * std::sin(uv.x() * 5.1));
      const float land = uv.y() < hills ? 1.0f : 0.0f;
      return std::min(1.0f, 0.75f * land + 0.35f * fractal_noise(p * inverse * 2, seed));
    }
  }
  return 0;
}

}  // namespace

uint8_t srgb_byte(float linear) {
  static const auto table = [] {
    std::array<uint8_t, 4097> t{};
    for (int i = 0; i <= 4096; ++i) t[i] = uint8_t(std::lround(255 * std::min(1.0f, srgb_encode(float(i) / 4096))));
    return t;
  }();
  return table[size_t(std::min(std::max(linear, 0.0f), 1.0f) * 4096 + 0.5f)];
}

float linear_value(uint8_t srgb) {
  static const auto table = [] {
    std::array<float, 256> t{};
    for (int i = 0; i < 256; ++i) t[i] = srgb_decode(float(i) / 255);
    return t;
  }();
  return table[srgb];
}

Vector3f texture_color(const Texture& t, const Vector3d& p_shape, const Vector3d& n_shape, uint64_t seed) {
  const float m = pattern_mix(t, p_shape, n_shape, seed);
  const Vector3f a{linear_value(t.first.r), linear_value(t.first.g), linear_value(t.first.b)};
  const Vector3f b{linear_value(t.second.r), linear_value(t.second.g), linear_value(t.second.b)};
  return a + (b - a) * m;
}

}  // namespace felt
