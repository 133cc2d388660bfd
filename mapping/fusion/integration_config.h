#pragma once

namespace felt {

struct LabelEvidence;

/// What a depth pixel says about the signed distance of a voxel at camera depth z on its ray.
enum class DistanceModel {
  optical_axis,   ///< d - z
  ray,            ///< (d - z) |r|, r = (x/z, y/z, 1): distance along the viewing ray
  tangent_plane,  ///< (d - z) |n . r|: distance to the plane through the pixel's surface point with its normal n
};

/// Weight of one observation at depth d (metres), before drop-off.
enum class WeightModel {
  constant,        ///< 1
  inverse_square,  ///< 1 / d^2, 1 at one metre
  sensor_noise,    ///< (sigma(1 m) / sigma(d))^2, sigma(d) = 1.2 mm + 1.9 mm (d - 0.4)^2: Nguyen, Izadi, Lovell 2012
                   ///< (Kinect)
};

/// Settings of class fusion.
struct LabelConfig {
  /// Voxels nearer than this to the surface take labels, in voxels: a band of its own, not the truncation, so that
  /// labels do not bleed through thin things.
  float band_vox = 1.0f;
  float evidence = 1.0f;       ///< what one observation adds: below 1 tempers correlated frames
  float max_evidence = 0.0f;   ///< cap of a voxel's total evidence; older evidence fades beyond it; 0: no cap
  bool spread_dropped = true;  ///< of top-m probabilities: what the kept classes lack goes to the others evenly
  /// A view adds `evidence` in full where the camera moved this far, or turned this much, from every earlier view, and
  /// in proportion less where it is nearer to one: near-identical views repeat their mistakes. 0: every view in full.
  float novelty_m = 0.0f, novelty_deg = 0.0f;
  bool instances = false;  ///< also vote for the instance ids of voxels
  /// What a label says about the true class (mapping/fusion/label_evidence.h); null: what it says. Must outlive the
  /// fusion.
  const LabelEvidence* likelihood = nullptr;
};

/// Settings of depth fusion that do not change between frames.
struct IntegrationConfig {
  float min_depth_m = 0.1f;  ///< nearer pixels are not used
  float max_depth_m = 4.0f;  ///< farther pixels are not used
  DistanceModel distance = DistanceModel::ray;
  WeightModel weight = WeightModel::constant;
  float max_weight = 255.0f;  ///< cap of the summed weight: an old map stays able to change
  /// Behind the surface the weight falls linearly from 1 at this distance (in voxels) to 0 at the truncation.
  float dropoff_start_vox = 1.0f;
  /// Also fuse "free" (+truncation) into observed voxels in front of the band, as far as blocks exist.
  bool carve = false;
  /// Voxels nearer than this to the surface, in voxels, take colour: those that colour of the mesh is interpolated
  /// from.
  float color_band_vox = 2.0f;
  LabelConfig labels;
};

}  // namespace felt
