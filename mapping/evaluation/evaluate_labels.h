#pragma once

#include <Eigen/Geometry>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "core/class_table.h"
#include "mapping/evaluation/evaluate_geometry.h"
#include "mapping/evaluation/evaluate_predictions.h"
#include "mapping/evaluation/mesh_distance.h"
#include "mapping/surface/render.h"
#include "mapping/touch/voxel_beliefs.h"

namespace felt {

/// Which slot of the evaluated classes a true label id means.
class TruthClasses {
public:
  static constexpr int kUnlabelled = -1;  ///< ignored by the truth, or an id that its table does not know
  static constexpr int kForeign = -2;     ///< a class that the evaluated table does not have

  /// By name where the truth brings a table, else by id of the evaluated one. Throws Error where no class of the truth
  /// is in the evaluated table.
  TruthClasses(const ClassTable& evaluated, const ClassTable& truth);

  int slot_of_id(uint16_t id) const { return id < slot_.size() ? slot_[id] : kUnlabelled; }

private:
  std::vector<int> slot_;
};

/// What is predicted for the pixels of one view.
struct LabelPrediction {
  Image<int16_t> slot;  ///< -1: none
  /// Class probabilities by slot of a pixel; false where there is none. Empty: the source knows labels only.
  std::function<bool(int u, int v, std::span<double> p)> probability;
};

/// Of a map: the voxel that a ray meets (mapping/surface/render.h). Map, caster and beliefs must outlive the result.
LabelPrediction predict_labels(const RayCaster& caster, const VoxelBeliefs& beliefs, const PinholeCamera& camera,
                               const Eigen::Isometry3d& T_world_camera, double max_depth_m);

/// What labels of vertices are called.
constexpr const char* kVertexLabels = "label";

/// A mesh whose labels are looked up: the triangle scalar `label_name` or, failing that and where that is their name,
/// the labels of vertices (a triangle's point takes its nearest corner's).
class LabelledMesh {
public:
  /// Throws Error where the mesh carries no labels of that name.
  LabelledMesh(TriangleMesh mesh, const std::string& label_name, const std::string& where);

  /// Label id at a point of a triangle.
  uint16_t label(uint32_t triangle, const Eigen::Vector3d& point) const;
  const TriangleTree& tree() const { return tree_; }
  const TriangleMesh& mesh() const { return mesh_; }

private:
  TriangleMesh mesh_;
  const std::vector<float>* triangle_label_ = nullptr;
  TriangleTree tree_;
};

LabelPrediction predict_labels(const LabelledMesh& mesh, const TruthClasses& classes, const PinholeCamera& camera,
                               const Eigen::Isometry3d& T_world_camera, double max_depth_m);

/// Scores of labels over views, or over samples of a mesh.
struct LabelScores {
  explicit LabelScores(int classes) : counts(classes) {}

  LabelCounts counts;             ///< of what the truth labels with a class that the evaluated table has
  CalibrationScores calibration;  ///< of those of them that have class probabilities
  ClassImageScores images;        ///< one image for each class that occurs in a view, where asked for
  uint64_t views = 0;
  uint64_t foreign = 0;  ///< pixels or samples of a class that the evaluated table does not have: not counted
  LabelScores& operator+=(const LabelScores& other);
};

/// The truth of one view.
struct ReferenceView {
  const LabelImage* labels = nullptr;   ///< true ids
  const DepthImage* depth_m = nullptr;  ///< pixels without depth, or outside of the range, are not counted
  double min_depth_m = 0.1, max_depth_m = 4;
};

/// Adds one view: its prediction against its true labels. In parallel; the same for any number of threads.
/// `class_images`: also the images of class probability, pixels that are not counted left out (0 in both).
void add_view(LabelScores& scores, const LabelPrediction& prediction, const ReferenceView& truth,
              const TruthClasses& classes, bool class_images);

/// Adds samples of a labelled reference mesh, spread evenly over its area; with cameras only those that one sees
/// (mapping/evaluation/evaluate_geometry.h). The prediction is that of the voxel whose centre is nearest to the sample.
void add_surface(LabelScores& scores, const Map& map, const VoxelBeliefs& beliefs, const LabelledMesh& reference,
                 const TruthClasses& classes, const GeometryOptions& options, const ObservingCameras* cameras);
/// The same of a mesh: the label of its point nearest to the sample, where that is within options.threshold_m.
void add_surface(LabelScores& scores, const LabelledMesh& evaluated, const TruthClasses& evaluated_classes,
                 const LabelledMesh& reference, const TruthClasses& classes, const GeometryOptions& options,
                 const ObservingCameras* cameras);

}  // namespace felt
