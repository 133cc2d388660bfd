#pragma once

#include <Eigen/Core>
#include <functional>
#include <string>
#include <vector>

#include "mapping/map.h"

namespace felt::test {

/// Signed distance in metres at a world point, positive in front of the surface.
using SignedDistance = std::function<double(const Eigen::Vector3d& p)>;
/// Class slot at a world point, -1 for none.
using LabelAt = std::function<int(const Eigen::Vector3d& p)>;

/// Classes named `names`, ids 1, 2, ..., besides an ignored class with id 0.
ClassTable class_table(const std::vector<std::string>& names);

/// A map with the exact signed distance wherever it is within the truncation (4 voxels) inside the box, weight 5 there,
/// and `counts` observations of the class that `label_at` gives within 1.5 voxels of the surface.
Map labelled_map(double voxel_size_m, const Eigen::Vector3d& lo, const Eigen::Vector3d& hi, const SignedDistance& sdf,
                 const ClassTable& classes, const LabelAt& label_at, float counts = 4);

/// A floor of 0.4 m by 0.4 m about the origin, facing z, in voxels of 20 mm, of wood (slot 0) and ice (slot 1) as
/// `label_at` says, with friction as a property: prior means 0.4 and 0.1, both of standard deviation `prior_sd`.
Map floor_of_wood_and_ice(const LabelAt& label_at, double prior_sd = 0.05, float counts = 4);
/// The slots of that floor: wood where x < 0, else ice.
int wood_then_ice(const Eigen::Vector3d& p);
/// That floor after a touch at the origin that read a friction of 0.3.
Map touched_floor(const LabelAt& label_at);

/// Adds `count` observations of a class to one voxel; the block must exist.
void add_evidence(Map& map, const Index3& voxel, int slot, float count);

/// Observations of all classes in a voxel of a block, what they share evenly included.
double total_evidence(const Block& block, int offset);

}  // namespace felt::test
