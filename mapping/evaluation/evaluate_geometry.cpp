#include "mapping/evaluation/evaluate_geometry.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "core/error.h"
#include "core/median.h"

namespace felt {
namespace {
using Eigen::Vector3d;
using Eigen::Vector3f;

/// What samples of one mesh find on the other.
struct Nearest {
  std::vector<double> distance_m;
  std::vector<double> alignment;  ///< |n . n'|
};

Vector3d normal_of(const TriangleMesh& mesh, uint32_t triangle) {
  const Triangle& t = mesh.triangles[triangle];
  const Vector3d a = mesh.positions[t[0]].cast<double>();
  return (mesh.positions[t[1]].cast<double>() - a).cross(mesh.positions[t[2]].cast<double>() - a).normalized();
}

Nearest nearest_on(const SurfaceSamples& samples, const TriangleMesh& mesh, const TriangleTree& tree) {
  Nearest found;
  found.distance_m.resize(samples.positions.size());
  found.alignment.resize(samples.positions.size());
  tbb::parallel_for(size_t(0), samples.positions.size(), [&](size_t i) {
    const auto nearest = tree.nearest(samples.positions[i].cast<double>());
    found.distance_m[i] = nearest.distance_m;
    found.alignment[i] = std::abs(normal_of(mesh, nearest.triangle).dot(samples.normals[i].cast<double>()));
  });
  return found;
}

double mean(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v;
  return sum / double(values.size());
}

double share_below(const std::vector<double>& values, double threshold) {
  return double(std::count_if(values.begin(), values.end(), [&](double v) { return v < threshold; })) /
         double(values.size());
}

bool sees(const ObservingCameras& c, const Eigen::Isometry3d& T_world_camera, const Vector3d& p,
          const TriangleTree& scene) {
  const Vector3d q = T_world_camera.inverse(Eigen::Isometry) * p;
  if (!(q.z() >= c.min_depth_m && q.z() <= c.max_depth_m)) return false;
  const Eigen::Vector2d pixel = c.camera.project(q);
  if (!(pixel.x() >= -0.5 && pixel.x() < c.camera.width - 0.5 && pixel.y() >= -0.5 &&
        pixel.y() < c.camera.height - 0.5))
    return false;
  const Vector3d origin = T_world_camera.translation(), direction = p - origin;
  const double limit = 1 - c.occlusion_tolerance_m / direction.norm();
  return scene.first_hit(origin, direction, limit).triangle == TriangleTree::kNone;
}

SurfaceSamples samples_of(const TriangleMesh& mesh, const GeometryOptions& options, const char* which) {
  SurfaceSamples samples = sample_surface(mesh, options.samples, options.seed);
  if (samples.positions.empty())
    throw Error(describe_mismatch("evaluation", which, "triangles with area",
                                  std::to_string(mesh.triangles.size()) + " triangles without"));
  return samples;
}

}  // namespace

SurfaceSamples seen_samples(const SurfaceSamples& samples, const ObservingCameras& cameras, const TriangleTree& scene) {
  std::vector<uint8_t> seen(samples.positions.size());
  tbb::parallel_for(size_t(0), seen.size(), [&](size_t i) {
    const Vector3d p = samples.positions[i].cast<double>();
    seen[i] = std::any_of(cameras.T_world_camera.begin(), cameras.T_world_camera.end(),
                          [&](const Eigen::Isometry3d& T) { return sees(cameras, T, p, scene); });
  });
  SurfaceSamples kept;
  for (size_t i = 0; i < seen.size(); ++i) {
    if (!seen[i]) continue;
    kept.positions.push_back(samples.positions[i]);
    kept.normals.push_back(samples.normals[i]);
    kept.triangles.push_back(samples.triangles[i]);
  }
  return kept;
}

GeometryScores evaluate_geometry(const TriangleMesh& reconstruction, const TriangleMesh& reference,
                                 const GeometryOptions& options, const ObservingCameras* cameras) {
  SurfaceSamples ours = samples_of(reconstruction, options, "reconstruction");
  SurfaceSamples truth = samples_of(reference, options, "reference mesh");
  const TriangleTree our_tree(reconstruction), truth_tree(reference);
  GeometryScores scores;
  if (cameras != nullptr) {
    const auto all = double(truth.positions.size());
    truth = seen_samples(truth, *cameras, truth_tree);
    if (truth.positions.empty())
      throw Error(describe_mismatch("evaluation", "reference mesh", "a part that some camera sees", "none"));
    scores.reference_seen = double(truth.positions.size()) / all;
    if (options.cull_reconstruction) {
      const auto before = double(ours.positions.size());
      ours = seen_samples(ours, *cameras, truth_tree);
      if (ours.positions.empty())
        throw Error(describe_mismatch("evaluation", "reconstruction", "a part that some camera sees", "none"));
      scores.reconstruction_seen = double(ours.positions.size()) / before;
    }
  }
  const Nearest accuracy = nearest_on(ours, reference, truth_tree),
                completion = nearest_on(truth, reconstruction, our_tree);
  scores.samples_reconstruction = ours.positions.size();
  scores.samples_reference = truth.positions.size();
  scores.accuracy_mean_m = mean(accuracy.distance_m);
  scores.accuracy_median_m = median(accuracy.distance_m);
  double squares = 0;
  for (const double d : accuracy.distance_m) squares += d * d;
  scores.accuracy_rms_m = std::sqrt(squares / double(accuracy.distance_m.size()));
  scores.completion_mean_m = mean(completion.distance_m);
  scores.completion_median_m = median(completion.distance_m);
  scores.precision = share_below(accuracy.distance_m, options.threshold_m);
  scores.recall = share_below(completion.distance_m, options.threshold_m);
  const double sum = scores.precision + scores.recall;
  scores.f_score = sum > 0 ? 2 * scores.precision * scores.recall / sum : 0;
  scores.normal_consistency = 0.5 * (mean(accuracy.alignment) + mean(completion.alignment));
  return scores;
}

}  // namespace felt
