#pragma once

#include "inference/material.h"
#include "inference/mixture.h"
#include "io/readings/infer_request.h"

namespace felt {

/// One reading by the f32 batch kernel that a map runs (inference/batch/mixture.h), as a batch of one voxel whose
/// locations are stored less those of the prior. `valid` false: the state was kept. Throws FormatError for numbers
/// that the kernel refuses.
MixtureUpdate mixture_update_f32(const InferRequest& request);

/// Class posterior and view of exact readings by the f32 batch kernel (inference/batch/material.h).
struct MaterialView {
  std::vector<double> p;  ///< class probabilities
  double surprise = 0;
  MomentMatchedView view;
};
MaterialView material_view_f32(const InferRequest& request);

}  // namespace felt
