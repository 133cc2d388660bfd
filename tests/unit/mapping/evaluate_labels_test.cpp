#include "mapping/evaluation/evaluate_labels.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "core/error.h"
#include "mapping/surface/marching_cubes.h"
#include "mapping/touch/touch_update.h"
#include "tests/support/labelled_map.h"

using namespace felt;
using namespace felt::test;

namespace {

constexpr double kVoxel = 0.02;

/// A wall a metre in front of the origin, wood on the left and stone on the right of x = 0, each seen nine times.
Map two_walls() {
  return labelled_map(
      kVoxel, {-0.6, -0.4, 0.9}, {0.6, 0.4, 1.1}, [](const Eigen::Vector3d& p) { return 1.0 - p.z(); },
      class_table({"wood", "stone", "moss"}), [](const Eigen::Vector3d& p) { return p.x() < 0 ? 0 : 1; }, 9);
}

const PinholeCamera kCamera{40, 40, 19.5, 14.5, 40, 30};

/// Labels of the view from the origin: `left` and `right` of column 20 by id, depth 1 m everywhere but in row 0.
struct View {
  LabelImage labels{40, 30};
  DepthImage depth_m{40, 30, 1.0f};
  View(uint16_t left, uint16_t right) {
    for (int v = 0; v < 30; ++v)
      for (int u = 0; u < 40; ++u) labels(u, v) = u < 20 ? left : right;
    for (int u = 0; u < 40; ++u) depth_m(u, 0) = 0;
  }
  ReferenceView reference() const { return {&labels, &depth_m, 0.1, 4}; }
};

LabelScores scores_of(const Map& map, const View& view, const ClassTable& truth, bool images = false, double z = 0) {
  const RayCaster caster(map);
  const VoxelBeliefs beliefs(map);
  LabelScores scores(map.classes.size());
  const Eigen::Isometry3d T_world_camera(Eigen::Translation3d(0, 0, z));
  add_view(scores, predict_labels(caster, beliefs, kCamera, T_world_camera, 4), view.reference(),
           TruthClasses(map.classes, truth), images);
  return scores;
}

}  // namespace

TEST_CASE("labels of a view are counted by true and predicted class, pixels without depth or truth are not") {
  const Map map = two_walls();
  // Seen from the origin the wall covers the image.
  const LabelScores right = scores_of(map, View(1, 2), {});
  CHECK(right.counts.count(0, 0) == right.counts.count(1, 1));
  CHECK(right.counts.count(0, 1) + right.counts.count(1, 0) == 0);
  CHECK(right.counts.total() == 40 * 29);
  CHECK(right.counts.without_prediction(0) == 0);
  const LabelScores wrong = scores_of(map, View(1, 3), {});
  CHECK(wrong.counts.count(2, 1) == right.counts.count(1, 1));
  CHECK(wrong.counts.iou(2) == 0);
  CHECK(wrong.counts.mean_iou() == Approx(wrong.counts.iou(0) / 2));
  // From a metre farther back it covers 0.6 m * 40 px / 2 m = 12 columns on either side, and 8 rows.
  const LabelScores far = scores_of(map, View(1, 2), {}, false, -1);
  CHECK(far.counts.total() == 40 * 29);
  CHECK(double(far.counts.count(0, 0)) == Approx(12 * 16).epsilon(0.15));
  CHECK(far.counts.without_prediction(0) == 20 * 29 - far.counts.count(0, 0));
  const LabelScores half = scores_of(map, View(0, 2), {});  // id 0 is ignored
  CHECK(half.counts.total() == 20 * 29);
}

TEST_CASE("classes of the truth are matched by name, and those that the map does not have are left out") {
  const Map map = two_walls();
  const ClassTable truth({{7, "stone", {}, false}, {8, "wood", {}, false}, {9, "lava", {}, false}});
  const LabelScores scores = scores_of(map, View(8, 9), truth);
  CHECK(scores.counts.pixel_accuracy() > 0.9);
  CHECK(scores.counts.total() == 20 * 29);
  CHECK(scores.foreign == 20 * 29);
  CHECK_THROWS_AS(TruthClasses(map.classes, ClassTable({{1, "lava", {}, false}})), Error);
}

TEST_CASE("calibration and class images follow from the Dirichlet's mean") {
  const Map map = two_walls();
  const LabelScores scores = scores_of(map, View(1, 2), {}, true);
  // Nine of one class on one prior count of each of three: 10/12, and all of them are right.
  CHECK(scores.calibration.ece() == Approx(1 - 10.0 / 12));
  CHECK(scores.calibration.nll() == Approx(-std::log(10.0 / 12)));
  CHECK(scores.calibration.count() == scores.counts.count(0, 0) + scores.counts.count(1, 1));
  CHECK(scores.images.images() == 2);
  // A hit pixel differs by 2/12 in its own image and by 1/12 in the other; a pixel of the truth without surface by 1
  // and 0.
  const double hit = double(scores.calibration.count()), lost = double(scores.counts.total()) - hit;
  const double squares = (hit * (4 + 1) / 144 + lost) / (2 * 40 * 30);
  CHECK(scores.images.psnr_db() == Approx(-10 * std::log10(squares)).epsilon(1e-6));
}

TEST_CASE("labels after a touch are those of the touched state, voxel for voxel") {
  Map map = two_walls();
  Property friction;
  friction.name = "friction";
  friction.priors = {{"wood", {0.37, 0.05, 50}}, {"stone", {0.5, 0.05, 50}}, {"moss", {0.1, 0.05, 50}}};
  map.properties = PropertyTable({friction});
  for (const TouchModel model : {TouchModel::material, TouchModel::mixture}) {
    TouchRequest request;
    request.point_m = {0.2, model == TouchModel::material ? 0.0 : 0.1, 1};
    request.property = "friction";
    request.value = 0.11;
    request.model = model;
    request.stamp_s = double(model == TouchModel::mixture);
    add_touch(map, resolve_touch(map, request));
    const VoxelBeliefs all(map);
    Beliefs one(map);
    std::vector<double> p(3);
    for (const Index3 voxel : {Index3{10, 0, 50}, {-10, 0, 50}, {3, 4, 51}, {10, 5, 52}}) {
      const VoxelRef at{map.store.find(block_of_voxel(voxel)), uint16_t(offset_in_block(voxel))};
      const Belief expected = one.at(voxel);
      all.class_probability(at, p);
      for (size_t c = 0; c < 3; ++c) CHECK(p[c] == Approx(expected.class_probability[c]).epsilon(1e-9));
      const StudentTMixture next = all.next_reading(at, 0);
      for (size_t c = 0; c < 3; ++c) {
        CHECK(next.component[c].location == Approx(expected.next_reading[0].component[c].location));
        CHECK(next.weight[c] == Approx(expected.next_reading[0].weight[c]).epsilon(1e-9));
      }
    }
  }
  const LabelScores scores = scores_of(map, View(1, 3), {});
  CHECK(scores.counts.count(2, 2) > 400);  // the right half is moss now
}

TEST_CASE("a labelled mesh is evaluated as the map that it shows") {
  const Map map = two_walls();
  TriangleMesh mesh = extract_mesh(map, {.normals = false, .colors = false});
  mesh.labels.clear();
  for (const auto& p : mesh.positions) mesh.labels.push_back(p.x() < 0 ? 1 : 2);
  const TruthClasses classes(map.classes, {});
  const LabelledMesh labelled(mesh, "label", "mesh");
  LabelScores view(3);
  add_view(view, predict_labels(labelled, classes, kCamera, Eigen::Isometry3d::Identity(), 4), View(1, 2).reference(),
           classes, false);
  const LabelScores expected = scores_of(map, View(1, 2), {});
  CHECK(std::abs(double(view.counts.count(0, 0)) - double(expected.counts.count(0, 0))) <= 29);  // one column
  CHECK(view.calibration.count() == 0);

  // The other way round the mesh is the truth, for the map and for itself.
  LabelScores of_map(3), of_mesh(3);
  const GeometryOptions options{.samples = 20000};
  add_surface(of_map, map, VoxelBeliefs(map), labelled, classes, options, nullptr);
  add_surface(of_mesh, labelled, classes, labelled, classes, options, nullptr);
  CHECK(of_map.counts.total() == 20000);
  CHECK(of_map.counts.pixel_accuracy() > 0.98);
  CHECK(of_mesh.counts.pixel_accuracy() == 1);
  for (uint16_t& label : mesh.labels) label = uint16_t(3 - label);
  LabelScores swapped(3);
  add_surface(swapped, map, VoxelBeliefs(map), LabelledMesh(mesh, "label", "mesh"), classes, options, nullptr);
  CHECK(swapped.counts.pixel_accuracy() < 0.02);
  // Labels of triangles come first where they bear the name, and no other name stands for those of vertices.
  mesh.triangle_scalars.push_back({"material", std::vector<float>(mesh.triangles.size(), 7.0f)});
  CHECK(LabelledMesh(mesh, "material", "mesh").label(0, {0, 0, 0}) == 7);
  CHECK(LabelledMesh(mesh, "label", "mesh").label(0, {0, 0, 0}) != 7);
  CHECK_THROWS_AS(LabelledMesh(mesh, "materials", "mesh"), Error);
  mesh.labels.clear();
  CHECK_THROWS_AS(LabelledMesh(mesh, "label", "mesh"), Error);
}
