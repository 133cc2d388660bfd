#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "inference/nig.h"
#include "inference/projection.h"

namespace felt {

/// One line of `feltmap infer`, checked: every number is finite and in range, every list has the length of the prior.
struct InferRequest {
  enum class Model { mixture, material, predict };
  Model model = Model::mixture;
  std::vector<double> a;   ///< concentrations (mixture) or vision evidence (material), one a class
  std::vector<Nig> prior;  ///< one block a class; Nig{} for a class whose entries are null
  std::vector<double> psi;
  std::vector<double> noise_sd;  ///< as long as psi
  double rho = 0;
  Projection projection = Projection::kl;
  std::string title;                           ///< for plots; may be empty
  std::vector<std::string> names;              ///< of the classes, for plots; may be shorter than the prior
  std::vector<double> quantiles, below, cvar;  ///< of `predict`
};

/// Reads one JSON document. Throws FormatError "<field>: expected ..., found ..." for whatever cannot be used, with the
/// field's name also for NaN, Infinity and numbers beyond the range of a double (which JSON itself has not).
InferRequest parse_infer_request(std::string_view line);

}  // namespace felt
