#include "mapping/evaluation/evaluate_geometry.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <utility>

#include "core/error.h"
#include "tests/support/squares.h"

using namespace felt;
using namespace felt::test;

namespace {

/// Two metres above (0.5, 0.5, 0), looking down: its image ends a little over two metres from there.
ObservingCameras looking_down() {
  ObservingCameras cameras;
  cameras.camera = {300, 300, 319.5, 239.5, 640, 480};
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX()).toRotationMatrix();
  T.translation() = Eigen::Vector3d(0.5, 0.5, 2);
  cameras.T_world_camera = {T};
  return cameras;
}

}  // namespace

TEST_CASE("a mesh compared with itself is without error") {
  const TriangleMesh mesh = square(0, 1, 0);
  const GeometryScores s = evaluate_geometry(mesh, mesh, {.samples = 2000});
  CHECK(s.accuracy_mean_m == Approx(0).margin(1e-7));
  CHECK(s.completion_mean_m == Approx(0).margin(1e-7));
  CHECK(s.f_score == 1);
  CHECK(s.normal_consistency == Approx(1));
}

TEST_CASE("a shifted plane has the shift as its error, and passes only a larger threshold") {
  const TriangleMesh reference = square(0, 2, 0), shifted = square(0, 2, 0.03f);
  const GeometryScores loose = evaluate_geometry(shifted, reference, {.samples = 2000, .threshold_m = 0.04});
  CHECK(loose.accuracy_mean_m == Approx(0.03));
  CHECK(loose.accuracy_rms_m == Approx(0.03));
  CHECK(loose.completion_median_m == Approx(0.03));
  CHECK(loose.f_score == 1);
  CHECK(evaluate_geometry(shifted, reference, {.samples = 2000, .threshold_m = 0.02}).f_score == 0);
}

TEST_CASE("a reconstruction of half of the reference is accurate but incomplete") {
  // Reference: 2 x 1; reconstruction: its first half. The other half lies 0 .. 1 m away: mean 0.5 of it.
  const TriangleMesh half = square(0, 1, 0), whole = both(square(0, 1, 0), square(1, 1, 0));
  const GeometryScores s = evaluate_geometry(half, whole, {.samples = 40000, .threshold_m = 0.1});
  CHECK(s.accuracy_mean_m == Approx(0).margin(1e-7));
  CHECK(s.precision == 1);
  CHECK(s.completion_mean_m == Approx(0.25).epsilon(0.01));
  CHECK(s.recall == Approx(0.55).epsilon(0.01));
  CHECK(s.f_score == Approx(2 * 0.55 / 1.55).epsilon(0.01));
}

TEST_CASE("normals at a right angle are inconsistent") {
  TriangleMesh wall;
  wall.positions = {{0, 0, 0}, {1, 0, 0}, {1, 0, 1}, {0, 0, 1}};
  wall.triangles = {{0, 1, 2}, {0, 2, 3}};
  CHECK(evaluate_geometry(wall, square(0, 1, 0), {.samples = 500}).normal_consistency == Approx(0).margin(1e-6));
}

TEST_CASE("only what a camera saw of the reference counts") {
  // Looking down from 2 m onto a square that hides another one below it; a third one lies outside the image.
  const TriangleMesh reference = both(both(square(0, 1, 0), square(0, 1, -1)), square(20, 1, 0));
  ObservingCameras cameras = looking_down();
  const TriangleMesh reconstruction = square(0, 1, 0);
  const GeometryScores all = evaluate_geometry(reconstruction, reference, {.samples = 3000});
  const GeometryScores seen = evaluate_geometry(reconstruction, reference, {.samples = 3000}, &cameras);
  CHECK(all.recall == Approx(1 / 3.0).epsilon(0.01));
  CHECK(seen.reference_seen == Approx(1 / 3.0).epsilon(0.01));
  CHECK(seen.recall == 1);
  cameras.max_depth_m = 1.9;
  CHECK_THROWS_AS(evaluate_geometry(reconstruction, reference, {.samples = 3000}, &cameras), Error);
}

TEST_CASE("the root mean square weighs far parts more than the mean does") {
  const TriangleMesh reference = both(square(0, 1, 0), square(5, 1, 0)),
                     shifted = both(square(0, 1, 0.01f), square(5, 1, 0.03f));
  const GeometryScores s = evaluate_geometry(shifted, reference, {.samples = 4000, .threshold_m = 0.02});
  CHECK(s.accuracy_mean_m == Approx(0.02).epsilon(0.01));
  CHECK(s.accuracy_rms_m == Approx(std::sqrt((0.01 * 0.01 + 0.03 * 0.03) / 2)).epsilon(0.01));
  CHECK(s.precision == Approx(0.5).epsilon(0.01));
}

TEST_CASE("which side of a triangle its corners run round makes no normal inconsistent") {
  TriangleMesh flipped = square(0, 1, 0);
  for (Triangle& t : flipped.triangles) std::swap(t[0], t[1]);
  CHECK(evaluate_geometry(flipped, square(0, 1, 0), {.samples = 500}).normal_consistency == Approx(1));
}

TEST_CASE("what no camera saw of a reconstruction counts, unless it is culled") {
  const TriangleMesh reference = square(0, 1, 0), reconstruction = both(square(0, 1, 0), square(20, 1, 0));
  const ObservingCameras cameras = looking_down();
  GeometryOptions options{.samples = 3000};
  const GeometryScores all = evaluate_geometry(reconstruction, reference, options, &cameras);
  CHECK(all.reconstruction_seen == 1);
  CHECK(all.precision == Approx(0.5).epsilon(0.01));
  options.cull_reconstruction = true;
  const GeometryScores culled = evaluate_geometry(reconstruction, reference, options, &cameras);
  CHECK(culled.reconstruction_seen == Approx(0.5).epsilon(0.01));
  CHECK(culled.precision == 1);
}

TEST_CASE("meshes without area cannot be compared") {
  TriangleMesh point = square(0, 0, 0);
  CHECK_THROWS_AS(evaluate_geometry(point, square(0, 1, 0)), Error);
  CHECK_THROWS_AS(evaluate_geometry(square(0, 1, 0), {}), Error);
}
