#include "io/readings/infer_json.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "inference/decision.h"
#include "inference/dirichlet.h"
#include "inference/information_gain.h"
#include "inference/material.h"
#include "inference/mixture.h"
#include "inference/priors.h"
#include "io/files/json_text.h"
#include "io/readings/infer_request.h"
#include "io/readings/infer_single.h"

namespace felt {
namespace {

using nlohmann::ordered_json;

// JSON has no infinity: null.
ordered_json number(double x) { return std::isfinite(x) ? ordered_json(x) : ordered_json(nullptr); }

ordered_json list(const std::vector<double>& values) {
  ordered_json result = ordered_json::array();
  for (double x : values) result.push_back(number(x));
  return result;
}

ordered_json blocks(const std::vector<double>& a, const std::vector<Nig>& nig) {
  ordered_json tau = ordered_json::array(), kappa = tau, beta = tau, gamma = tau;
  for (const Nig& p : nig) {
    const bool absent = p == Nig{};
    tau.push_back(absent ? ordered_json(nullptr) : number(p.tau));
    kappa.push_back(absent ? ordered_json(nullptr) : number(p.kappa));
    beta.push_back(absent ? ordered_json(nullptr) : number(p.beta));
    gamma.push_back(absent ? ordered_json(nullptr) : number(p.gamma));
  }
  return {{"a", list(a)}, {"tau", tau}, {"kappa", kappa}, {"beta", beta}, {"gamma", gamma}};
}

ordered_json answer_mixture(const InferRequest& in, InferPrecision precision) {
  const MixtureUpdate out = precision == InferPrecision::f32
                                ? mixture_update_f32(in)
                                : mixture_update(in.a, in.prior, in.psi[0], in.noise_sd[0], in.projection);
  return {{"responsibility", list(out.responsibility.p)},
          {"log_evidence", number(out.responsibility.log_evidence)},
          {"posterior", blocks(out.a, out.nig)},
          {"valid", out.valid}};
}

ordered_json answer_material(const InferRequest& in, InferPrecision precision) {
  const MaterialPosterior out = material_posterior(in.a, in.prior, in.psi, in.noise_sd, in.rho);
  MaterialView shown{out.belief.p, out.belief.log_evidence,
                     moment_matched_view(out, in.prior, total_concentration(in.a) + double(in.psi.size()))};
  // Noisy readings are no statistics that planes could hold: a map computes them in f64 too.
  const bool exact = std::all_of(in.noise_sd.begin(), in.noise_sd.end(), [](double sd) { return sd == 0; });
  if (precision == InferPrecision::f32 && exact && !in.psi.empty()) shown = material_view_f32(in);
  ordered_json classes = ordered_json::array();
  for (size_t c = 0; c < in.prior.size(); ++c) {
    const MaterialClass& m = out.classes[c];
    if (!has_prior(in.prior[c])) {
      classes.push_back(nullptr);
      continue;
    }
    classes.push_back({{"log_evidence", number(m.log_evidence)},
                       {"tau", number(m.posterior.tau)},
                       {"kappa", number(m.posterior.kappa)},
                       {"beta", number(m.posterior.beta)},
                       {"gamma", number(m.posterior.gamma)},
                       {"next_location", number(m.next_here.location)},
                       {"next_scale2", number(m.next_here.scale2)},
                       {"next_dof", number(m.next_here.dof)}});
  }
  return {{"class_probability", list(shown.p)},
          {"surprise", number(shown.surprise)},
          {"class_entropy", class_entropy(shown.p)},
          {"classes", classes},
          {"posterior", blocks(shown.view.a, shown.view.nig)}};
}

// A value, or null beside the reason why there is none.
void put(ordered_json& out, const std::string& name, std::optional<double> value, const char* reason) {
  out[name] = value ? number(*value) : ordered_json(nullptr);
  if (!value) out["reason"][name] = reason;
}

ordered_json answer_predict(const InferRequest& in) {
  const StudentTMixture m = predictive_mixture(in.a, in.prior);
  const Estimate gain = information_gain(m), differential = entropy(m);
  const char* const no_mean = "needs more than 1 degree of freedom (beta > 1/2) in every class";
  const char* const beyond = "lies beyond the largest double";
  ordered_json out;
  out["location"] = number(location(m));
  put(out, "mean", mean(m), no_mean);
  put(out, "variance", variance(m), "needs more than 2 degrees of freedom (beta > 1) in every class");
  const auto each = [&](const std::vector<double>& at, auto f) {
    ordered_json values = ordered_json::array();
    for (double x : at) {
      const std::optional<double> value = f(x);
      values.push_back(value ? number(*value) : ordered_json(nullptr));
    }
    return values;
  };
  out["quantiles"] = each(in.quantiles, [&](double p) { return quantile(m, p); });
  out["below"] = each(in.below, [&](double t) { return std::optional(cdf(m, t)); });
  out["cvar_lower"] = each(in.cvar, [&](double p) { return cvar(m, p, Tail::lower); });
  out["cvar_upper"] = each(in.cvar, [&](double p) { return cvar(m, p, Tail::upper); });
  for (const char* name : {"quantiles", "cvar_lower", "cvar_upper"}) {
    for (const auto& value : out[name]) {
      if (value.is_null()) out["reason"][name] = std::string(name) == "quantiles" || mean(m) ? beyond : no_mean;
    }
  }
  out["class_entropy"] = class_entropy(m.weight);
  out["entropy"] = {{"value", number(differential.value)}, {"error", number(differential.error)}};
  out["information_gain"] = {{"value", number(gain.value)}, {"error", number(gain.error)}};
  out["modes"] = list(modes(m));
  return out;
}

ordered_json answer(const InferRequest& in, InferPrecision precision) {
  switch (in.model) {
    case InferRequest::Model::mixture:
      return answer_mixture(in, precision);
    case InferRequest::Model::material:
      return answer_material(in, precision);
    case InferRequest::Model::predict:
      break;
  }
  return answer_predict(in);
}

}  // namespace

InferAnswer infer_json_line(std::string_view line, size_t number_of_line, InferPrecision precision) {
  try {
    return {answer(parse_infer_request(line), precision).dump(), false};
  } catch (const std::exception& e) {
    // Whatever is wrong with this line, also numbers that no function has a value for: the others are answered.
    const ordered_json error{{"error", e.what()}, {"line", number_of_line}};
    return {json_text(error), true};
  }
}

}  // namespace felt
