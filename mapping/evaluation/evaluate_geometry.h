#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <span>
#include <vector>

#include "core/camera.h"
#include "core/mesh.h"
#include "mapping/evaluation/mesh_distance.h"

namespace felt {

/// Cameras that recorded the scene: what none of them can have seen is no part of the reference.
struct ObservingCameras {
  PinholeCamera camera;
  std::vector<Eigen::Isometry3d> T_world_camera;
  double min_depth_m = 0.1, max_depth_m = 4.0;  ///< along the optical axis, as fused
  double occlusion_tolerance_m = 0.02;          ///< a sample this near behind the first surface still counts as seen
};

struct GeometryOptions {
  size_t samples = 200000;  ///< on each mesh
  uint64_t seed = 1;
  double threshold_m = 0.05;  ///< of completion ratio, precision, recall and F-score
  /// With cameras: samples of the reconstruction that none of them sees, in front of or on the reference, do not count
  /// either.
  bool cull_reconstruction = false;
};

/// Distances in metres between area-uniform samples of one mesh and the nearest point of the other's triangles.
struct GeometryScores {
  size_t samples_reconstruction = 0;
  size_t samples_reference = 0;    ///< that some camera saw, where cameras were given; else all
  double reference_seen = 1;       ///< share of the reference's samples that some camera saw
  double reconstruction_seen = 1;  ///< share of the reconstruction's samples that count
  double accuracy_mean_m = 0;      ///< reconstruction to reference
  double accuracy_median_m = 0;
  double accuracy_rms_m = 0;
  double completion_mean_m = 0;  ///< reference to reconstruction
  double completion_median_m = 0;
  double precision = 0;           ///< share of reconstruction samples nearer than the threshold
  double recall = 0;              ///< share of reference samples nearer than the threshold: the completion ratio
  double f_score = 0;             ///< harmonic mean of precision and recall
  double normal_consistency = 0;  ///< mean |n . n'| of triangle normals at nearest points, mean of both directions
};

/// The samples that some camera sees: in its image, within its depth range, and first on their ray against `scene`.
SurfaceSamples seen_samples(const SurfaceSamples& samples, const ObservingCameras& cameras, const TriangleTree& scene);

/// Compares a reconstruction with a reference mesh of the same frame (world, metres). With cameras, samples of the
/// reference count only where some camera sees them: in the image, within its depth range, first on their ray (against
/// the reference itself). Samples of the reconstruction all count, unless `cull_reconstruction`. Throws Error where a
/// mesh has no area or no camera sees the reference.
GeometryScores evaluate_geometry(const TriangleMesh& reconstruction, const TriangleMesh& reference,
                                 const GeometryOptions& options = {}, const ObservingCameras* cameras = nullptr);

}  // namespace felt
