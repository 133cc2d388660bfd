#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <memory>
#include <vector>

#include "mapping/touch/touch_view.h"

namespace felt {

/// What is believed of a property: mean and standard deviation of the next reading, unit of the property; NaN where
/// they do not exist, or where the voxel has neither labels nor touches.
struct PropertyEstimate {
  float mean = 0, sd = 0;
  bool touched = false;
};

/// The views of every touched block, shared by the properties of a map.
using TouchViews = std::shared_ptr<const std::vector<TouchView>>;

/// A property over the whole map, for grids, meshes and pictures: touched voxels from their touches, labelled ones from
/// the priors of their classes in closed form. Within f32 what `Beliefs::at` gives: two numbers a voxel, for millions
/// of voxels, where `VoxelBeliefs` gives whole distributions. The map must outlive it and stay as it is; `at` and
/// `copy` may be called from several threads at once.
class PropertyView {
public:
  PropertyView(const Map& map, int property, TouchViews touched);

  PropertyEstimate at(const Index3& voxel) const;
  /// Mean and sd of the 512 voxels of a block of the map.
  void copy(const Block& block, float* mean, float* sd) const;

private:
  /// What the classes add up to at a voxel.
  struct Sums {
    double evidence = 0;     ///< above the priors
    Eigen::Array3d moments;  ///< of all concentrations, as `moments_`
  };

  /// The sums of the voxels of a block from offset `first` on.
  template <size_t n>
  void gather(const Block& block, int first, std::array<Sums, n>& voxels) const;
  /// By the block's view where touches reach, else by the sums.
  PropertyEstimate answer(const TouchView* view, int offset, const Sums& voxel) const;
  PropertyEstimate estimate(const Eigen::Array3d& moments) const;

  const Map& map_;
  int property_;
  TouchViews touched_;
  double origin_ = 0;  ///< mean of the classes' means, so that no variance is a difference of large numbers
  /// What one unit of concentration adds, by slot: 1, the mean less origin, the variance plus the square of that; zero
  /// for a class without a prior.
  std::vector<Eigen::Array3d> moments_;
  Eigen::Array3d prior_ = Eigen::Array3d::Zero(), even_ = Eigen::Array3d::Zero();  ///< of no evidence; of one even unit
};

}  // namespace felt
