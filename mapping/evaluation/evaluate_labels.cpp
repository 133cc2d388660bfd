#include "mapping/evaluation/evaluate_labels.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <string>

#include "core/error.h"

namespace felt {
namespace {
using Eigen::Vector3d;

constexpr int kBands = 16;  ///< of rows or samples: parts that are scored in parallel and added up in order

/// Scores parts `first .. end` of `count` things in parallel: `score(first, end, part)`.
template <typename Score>
void add_in_parallel(LabelScores& scores, int count, Score score) {
  std::vector<LabelScores> parts(kBands, LabelScores(scores.counts.classes()));
  tbb::parallel_for(0, kBands, [&](int band) {
    score(int(int64_t(count) * band / kBands), int(int64_t(count) * (band + 1) / kBands), parts[size_t(band)]);
  });
  for (const LabelScores& part : parts) scores += part;
}

/// True slot of a pixel, or a negative number where it does not count.
int true_slot(const ReferenceView& truth, const TruthClasses& classes, int u, int v) {
  const float depth = (*truth.depth_m)(u, v);
  if (!(depth >= truth.min_depth_m && depth <= truth.max_depth_m)) return TruthClasses::kUnlabelled;
  return classes.slot_of_id((*truth.labels)(u, v));
}

void add_class_images(LabelScores& scores, const LabelPrediction& prediction, const Image<int16_t>& truth) {
  const std::set<int16_t> present(truth.begin(), truth.end());
  std::vector<int16_t> slots;
  for (const int16_t slot : present)
    if (slot >= 0) slots.push_back(slot);
  std::vector<Image<float>> said(slots.size(), Image<float>(truth.width(), truth.height(), 0));
  tbb::parallel_for(0, truth.height(), [&](int v) {
    std::vector<double> p(size_t(scores.counts.classes()));
    for (int u = 0; u < truth.width(); ++u)
      if (truth(u, v) >= 0 && prediction.probability(u, v, p))
        for (size_t i = 0; i < slots.size(); ++i) said[i](u, v) = float(p[size_t(slots[i])]);
  });
  std::vector<ClassImageScores> parts(slots.size());
  tbb::parallel_for(size_t(0), slots.size(), [&](size_t i) {
    Image<float> is(truth.width(), truth.height(), 0);
    for (size_t pixel = 0; pixel < is.size(); ++pixel) is.data()[pixel] = truth.data()[pixel] == slots[i];
    parts[i].add(said[i], is);
  });
  for (const ClassImageScores& part : parts) scores.images += part;
}

SurfaceSamples samples_of(const LabelledMesh& reference, const GeometryOptions& options,
                          const ObservingCameras* cameras) {
  SurfaceSamples samples = sample_surface(reference.mesh(), options.samples, options.seed);
  return cameras == nullptr ? samples : seen_samples(samples, *cameras, reference.tree());
}

/// Counts each sample: `predict(point, part, truth)` adds the prediction to its part.
template <typename Predict>
void add_samples(LabelScores& scores, const SurfaceSamples& samples, const LabelledMesh& reference,
                 const TruthClasses& classes, Predict predict) {
  add_in_parallel(scores, int(samples.positions.size()), [&](int first, int end, LabelScores& part) {
    for (int i = first; i < end; ++i) {
      const Vector3d p = samples.positions[size_t(i)].cast<double>();
      const int truth = classes.slot_of_id(reference.label(samples.triangles[size_t(i)], p));
      part.foreign += truth == TruthClasses::kForeign;
      if (truth >= 0) predict(p, part, truth);
    }
  });
}

}  // namespace

TruthClasses::TruthClasses(const ClassTable& evaluated, const ClassTable& truth) {
  const ClassTable& table = truth.empty() ? evaluated : truth;
  bool any = false;
  for (const ClassInfo& c : table.classes()) {
    if (c.ignore) continue;
    const std::optional<int> slot = evaluated.slot_of_name(c.name);
    if (slot_.size() <= c.id) slot_.resize(size_t(c.id) + 1, kUnlabelled);
    slot_[c.id] = slot.value_or(kForeign);
    any = any || slot;
  }
  if (!any)
    throw Error(describe_mismatch("evaluation", "classes of the truth", "some that the evaluated classes have by name",
                                  "none of " + std::to_string(table.size())));
}

LabelPrediction predict_labels(const RayCaster& caster, const VoxelBeliefs& beliefs, const PinholeCamera& camera,
                               const Eigen::Isometry3d& T_world_camera, double max_depth_m) {
  const auto view = std::make_shared<RenderedView>(
      caster.render(camera, T_world_camera, {.max_depth_m = max_depth_m, .normals = false, .color = false}));
  LabelPrediction prediction{Image<int16_t>(camera.width, camera.height, -1), {}};
  tbb::parallel_for(0, camera.height, [&](int v) {
    for (int u = 0; u < camera.width; ++u)
      if (view->voxel(u, v).block != BlockStore::kNone)
        prediction.slot(u, v) = int16_t(beliefs.strongest_class(view->voxel(u, v)));
  });
  prediction.probability = [view, &beliefs](int u, int v, std::span<double> p) {
    if (view->voxel(u, v).block == BlockStore::kNone) return false;
    beliefs.class_probability(view->voxel(u, v), p);
    return true;
  };
  return prediction;
}

LabelledMesh::LabelledMesh(TriangleMesh mesh, const std::string& label_name, const std::string& where)
    : mesh_(std::move(mesh)), tree_(mesh_) {
  triangle_label_ = TriangleMesh::find(mesh_.triangle_scalars, label_name);
  if (triangle_label_ != nullptr || (!mesh_.labels.empty() && label_name == kVertexLabels)) return;
  std::string found =
      mesh_.labels.empty() ? "none" : std::string("vertex labels, which are called '") + kVertexLabels + "'";
  for (const MeshScalars& s : mesh_.triangle_scalars)
    found += (&s == &mesh_.triangle_scalars[0] ? ", but: " : " ") + s.name;
  throw Error(describe_mismatch(where, "labels", "'" + label_name + "' of triangles or vertices", found));
}

uint16_t LabelledMesh::label(uint32_t triangle, const Vector3d& point) const {
  if (triangle_label_ != nullptr) {
    const float id = (*triangle_label_)[triangle];
    return id >= 0 && id < float(kNoLabel) ? uint16_t(id) : kNoLabel;
  }
  const Triangle& t = mesh_.triangles[triangle];
  const auto distance = [&](uint32_t vertex) { return (mesh_.positions[vertex].cast<double>() - point).squaredNorm(); };
  return mesh_
      .labels[*std::min_element(t.begin(), t.end(), [&](uint32_t a, uint32_t b) { return distance(a) < distance(b); })];
}

LabelPrediction predict_labels(const LabelledMesh& mesh, const TruthClasses& classes, const PinholeCamera& camera,
                               const Eigen::Isometry3d& T_world_camera, double max_depth_m) {
  LabelPrediction prediction{Image<int16_t>(camera.width, camera.height, -1), {}};
  const Vector3d origin = T_world_camera.translation();
  tbb::parallel_for(0, camera.height, [&](int v) {
    for (int u = 0; u < camera.width; ++u) {
      // The direction has length 1 along the optical axis, so distances are depths.
      const Vector3d direction = T_world_camera.linear() * camera.ray(u, v);
      const TriangleTree::Hit hit = mesh.tree().first_hit(origin, direction, max_depth_m);
      if (hit.triangle == TriangleTree::kNone) continue;
      const int slot = classes.slot_of_id(mesh.label(hit.triangle, origin + hit.distance * direction));
      prediction.slot(u, v) = int16_t(std::max(slot, -1));
    }
  });
  return prediction;
}

LabelScores& LabelScores::operator+=(const LabelScores& other) {
  counts += other.counts;
  calibration += other.calibration;
  images += other.images;
  views += other.views, foreign += other.foreign;
  return *this;
}

void add_view(LabelScores& scores, const LabelPrediction& prediction, const ReferenceView& truth,
              const TruthClasses& classes, bool class_images) {
  const int width = truth.labels->width(), height = truth.labels->height();
  Image<int16_t> counted(width, height, -1);
  add_in_parallel(scores, height, [&](int first, int end, LabelScores& part) {
    std::vector<double> p(size_t(part.counts.classes()));
    for (int v = first; v < end; ++v)
      for (int u = 0; u < width; ++u) {
        const int slot = true_slot(truth, classes, u, v);
        part.foreign += slot == TruthClasses::kForeign;
        if (slot < 0) continue;
        counted(u, v) = int16_t(slot);
        part.counts.add(slot, prediction.slot(u, v));
        if (prediction.probability && prediction.probability(u, v, p)) part.calibration.add(p, slot);
      }
  });
  if (class_images && prediction.probability) add_class_images(scores, prediction, counted);
  ++scores.views;
}

void add_surface(LabelScores& scores, const Map& map, const VoxelBeliefs& beliefs, const LabelledMesh& reference,
                 const TruthClasses& classes, const GeometryOptions& options, const ObservingCameras* cameras) {
  add_samples(scores, samples_of(reference, options, cameras), reference, classes,
              [&](const Vector3d& p, LabelScores& part, int truth) {
                const std::optional<Index3> voxel = nearest_voxel(map, p);
                if (!voxel) return part.counts.add(truth, -1);
                const uint32_t block = map.store.find(block_of_voxel(*voxel));
                if (block == BlockStore::kNone) return part.counts.add(truth, -1);
                const VoxelRef at{block, uint16_t(offset_in_block(*voxel))};
                if (!(map.store[block].geometry->weight[at.offset] > 0)) return part.counts.add(truth, -1);
                part.counts.add(truth, beliefs.strongest_class(at));
                std::vector<double> belief(size_t(beliefs.classes()));
                beliefs.class_probability(at, belief);
                part.calibration.add(belief, truth);
              });
}

void add_surface(LabelScores& scores, const LabelledMesh& evaluated, const TruthClasses& evaluated_classes,
                 const LabelledMesh& reference, const TruthClasses& classes, const GeometryOptions& options,
                 const ObservingCameras* cameras) {
  add_samples(scores, samples_of(reference, options, cameras), reference, classes,
              [&](const Vector3d& p, LabelScores& part, int truth) {
                const auto nearest = evaluated.tree().nearest(p, options.threshold_m);
                part.counts.add(truth,
                                nearest.triangle == TriangleTree::kNone
                                    ? -1
                                    : evaluated_classes.slot_of_id(evaluated.label(nearest.triangle, nearest.point)));
              });
}

}  // namespace felt
