#include "io/simulation/shape_cast.h"

#include <algorithm>
#include <cmath>

// Compiled once per instruction set and chosen when the program starts; every version rounds alike, as contraction is
// off. Sanitizers do not support functions chosen that early.
#if defined(__x86_64__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define FELTMAP_VECTORIZED __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define FELTMAP_VECTORIZED
#endif

namespace felt {
namespace {

using Eigen::Vector3d;

/// Entry and exit of the slab |p| <= half along one axis. A ray inside a face's plane gives 0 * inf = NaN, which the
/// comparisons of the callers pass over.
inline void clip_to_slab(double half, double o, double d, double& near, double& far) {
  const double inverse = 1 / d, a = (-half - o) * inverse, b = (half - o) * inverse;
  const double enter = b < a ? b : a, leave = b < a ? a : b;
  near = enter > near ? enter : near;
  far = leave < far ? leave : far;
}

FELTMAP_VECTORIZED void cast_span_at_box(const double* half, const double* R, const double* o, int number,
                                         RaySpan& span) {
  // R is column-major: direction = column 0 * x + column 1 * y + column 2.
  const double base_x = R[3] * span.y + R[6], base_y = R[4] * span.y + R[7], base_z = R[5] * span.y + R[8];
  for (int i = 0; i < RaySpan::kWidth; ++i) {
    double near = -HUGE_VAL, far = HUGE_VAL;
    clip_to_slab(half[0], o[0], R[0] * span.x[i] + base_x, near, far);
    clip_to_slab(half[1], o[1], R[1] * span.x[i] + base_y, near, far);
    clip_to_slab(half[2], o[2], R[2] * span.x[i] + base_z, near, far);
    const double t = span.t[i];
    const bool nearer = (near > 0) & (near <= far) & ((near < t) | ((near == t) & (number < span.nearest[i])));
    span.t[i] = nearer ? near : t;
    span.nearest[i] = nearer ? number : span.nearest[i];
  }
}

FELTMAP_VECTORIZED void cast_span_at_plane(const double* R, double height, int number, RaySpan& span) {
  const double base_z = R[5] * span.y + R[8];
  for (int i = 0; i < RaySpan::kWidth; ++i) {
    const double down = R[2] * span.x[i] + base_z, hit = -height / down, t = span.t[i];
    const bool nearer = (down < 0) & ((hit < t) | ((hit == t) & (number < span.nearest[i])));
    span.t[i] = nearer ? hit : t;
    span.nearest[i] = nearer ? number : span.nearest[i];
  }
}

}  // namespace

ShapeHit cast_at_shape(ShapeKind shape, const Vector3d& half, const Vector3d& o, const Vector3d& d) {
  switch (shape) {
    case ShapeKind::plane:
      if (d.z() < 0 && o.z() > 0) return {-o.z() / d.z(), Vector3d::UnitZ()};
      break;
    case ShapeKind::box: {
      double near = -HUGE_VAL, far = HUGE_VAL;
      int axis = 0;
      for (int i = 0; i < 3; ++i) {
        const double before = near;
        clip_to_slab(half[i], o[i], d[i], near, far);
        if (near > before) axis = i;
      }
      if (near > 0 && near <= far) return {near, (d[axis] < 0 ? 1.0 : -1.0) * Vector3d::Unit(axis)};
      break;
    }
    case ShapeKind::sphere: {
      const double a = d.squaredNorm(), b = o.dot(d), c = o.squaredNorm() - half.x() * half.x(), disc = b * b - a * c;
      if (c > 0 && b < 0 && disc >= 0) {
        const double t = c / (-b + std::sqrt(disc));  // the stable form of (-b - sqrt) / a
        return {t, (o + t * d).normalized()};
      }
      break;
    }
    case ShapeKind::cylinder: {
      const double r = half.x(), h = half.z();
      const double cap = d.z() < 0 ? h : -h, t_cap = (cap - o.z()) / d.z();
      if (std::abs(o.z()) > h && t_cap > 0 && t_cap < HUGE_VAL) {
        const double x = o.x() + t_cap * d.x(), y = o.y() + t_cap * d.y();
        if (x * x + y * y <= r * r) return {t_cap, Vector3d(0, 0, cap > 0 ? 1 : -1)};
      }
      const double a = d.x() * d.x() + d.y() * d.y(), b = o.x() * d.x() + o.y() * d.y();
      const double c = o.x() * o.x() + o.y() * o.y() - r * r, disc = b * b - a * c;
      if (c > 0 && b < 0 && disc >= 0) {
        const double t = c / (-b + std::sqrt(disc)), z = o.z() + t * d.z();
        if (std::abs(z) <= h) return {t, Vector3d((o.x() + t * d.x()) / r, (o.y() + t * d.y()) / r, 0)};
      }
      break;
    }
  }
  return {};
}

void cast_span_at_shape(const Primitive& shape, const Eigen::Matrix3d& R_shape_camera, const Vector3d& o, int number,
                        RaySpan& span) {
  if (shape.shape == ShapeKind::box) {
    cast_span_at_box(shape.half_size_m.data(), R_shape_camera.data(), o.data(), number, span);
    return;
  }
  if (shape.shape == ShapeKind::plane) {
    if (o.z() > 0) cast_span_at_plane(R_shape_camera.data(), o.z(), number, span);
    return;
  }
  const Vector3d base = R_shape_camera.col(1) * span.y + R_shape_camera.col(2);
  for (int i = 0; i < RaySpan::kWidth; ++i) {
    const double t =
        cast_at_shape(shape.shape, shape.half_size_m, o, Vector3d(R_shape_camera.col(0) * span.x[i] + base)).t;
    if (t < span.t[i] || (t == span.t[i] && number < span.nearest[i])) span.t[i] = t, span.nearest[i] = number;
  }
}

}  // namespace felt
