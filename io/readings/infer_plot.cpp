#include "io/readings/infer_plot.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "core/text.h"
#include "inference/dirichlet.h"
#include "inference/material.h"
#include "inference/mixture.h"
#include "inference/noise.h"
#include "inference/priors.h"
#include "io/readings/infer_request.h"

namespace felt {
namespace {

constexpr int kPoints = 400;

struct Densities {
  StudentTMixture next;  // one component a class with a prior
  std::vector<PlugInNormal> plug_in;
  std::vector<std::string> names;
};

Densities densities(const std::vector<double>& belief, const std::vector<Nig>& nig,
                    const std::vector<std::string>& names) {
  Densities d{predictive_mixture(belief, nig), plug_in_mixture(belief, nig), {}};
  for (size_t c = 0; c < nig.size(); ++c)
    if (has_prior(nig[c])) d.names.push_back(c < names.size() ? names[c] : "class " + std::to_string(c));
  return d;
}

void include(const Densities& d, double& low, double& high) {
  for (size_t c = 0; c < d.next.component.size(); ++c) {
    if (d.next.weight[c] < 1e-3) continue;
    const double reach = 4 * std::sqrt(d.next.component[c].scale2);
    low = std::min(low, d.next.component[c].location - reach);
    high = std::max(high, d.next.component[c].location + reach);
  }
}

double normal_density(const PlugInNormal& n, double x) {
  const double z = (x - n.mean) / n.sd;
  return n.weight * std::exp(-0.5 * z * z) / (n.sd * std::sqrt(2 * M_PI));
}

/// The next reading after one reading of a mixture before it is projected: sum_j r_j of the product in which class j
/// owns the reading.
struct ExactMixture {
  StudentTMixture next;
  ExactMixture(const InferRequest& in, const ClassPosterior& responsibility) {
    const double total = total_concentration(in.a) + 1;
    for (size_t c = 0; c < in.prior.size(); ++c) {
      const double r = responsibility.p[c];
      next.weight.insert(next.weight.end(), {responsibility.not_p[c] * in.a[c] / total, r * (in.a[c] + 1) / total});
      next.component.push_back(predictive(in.prior[c]));
      next.component.push_back(predictive(noisy_update(in.prior[c], in.psi[0], in.noise_sd[0]).posterior));
    }
  }
};

Plot panel(const Densities& d, const std::string& title, const std::vector<double>& readings, double low, double high,
           const std::optional<ExactMixture>& exact = {}) {
  Plot plot;
  plot.title = title;
  plot.x_label = "reading";
  plot.y_label = "density";
  std::vector<double> x(kPoints);
  for (int i = 0; i < kPoints; ++i) x[size_t(i)] = low + (high - low) * i / (kPoints - 1);
  const auto curve = [&](std::string name, int color, PlotSeries::Style style, auto density) {
    PlotSeries s{std::move(name), x, std::vector<double>(x.size()), color, style};
    std::transform(x.begin(), x.end(), s.y.begin(), density);
    plot.series.push_back(std::move(s));
  };
  curve("all classes", -1, PlotSeries::Style::line, [&](double at) { return pdf(d.next, at); });
  for (size_t c = 0; c < d.next.component.size(); ++c) {
    curve(d.names[c] + number_text(d.next.weight[c], " %.3f"), int(c), PlotSeries::Style::line,
          [&](double at) { return d.next.weight[c] * pdf(d.next.component[c], at); });
  }
  if (exact) {
    curve("before projection", -1, PlotSeries::Style::dashed, [&](double at) { return pdf(exact->next, at); });
  } else {
    curve("plug-in normal", -1, PlotSeries::Style::dashed, [&](double at) {
      double sum = 0;
      for (const PlugInNormal& n : d.plug_in) sum += normal_density(n, at);
      return sum;
    });
  }
  for (double reading : readings) plot.markers.push_back({reading, number_text(reading, "%.4g")});
  return plot;
}

}  // namespace

std::vector<Plot> infer_plots(std::string_view line, const std::string& title) {
  const InferRequest in = parse_infer_request(line);
  const Densities before = densities(in.a, in.prior, in.names);
  Densities after = before;
  std::optional<ExactMixture> exact;
  std::string outcome = ": after";
  if (in.model == InferRequest::Model::mixture) {
    const MixtureUpdate out = mixture_update(in.a, in.prior, in.psi[0], in.noise_sd[0], in.projection);
    if (out.valid) after = densities(out.a, out.nig, in.names);
    if (!out.valid) outcome = ": published moments are no prior, state kept";
    if (std::all_of(in.prior.begin(), in.prior.end(), has_prior)) exact.emplace(in, out.responsibility);
  } else if (in.model == InferRequest::Model::material) {
    const MaterialPosterior out = material_posterior(in.a, in.prior, in.psi, in.noise_sd, in.rho);
    std::vector<Nig> nig;
    for (const MaterialClass& c : out.classes) nig.push_back(c.posterior);
    after = densities(out.belief.p, nig, in.names);
  }
  double low = std::numeric_limits<double>::infinity(), high = -low;
  include(before, low, high);
  include(after, low, high);
  for (double reading : in.psi) {
    low = std::min(low, reading);
    high = std::max(high, reading);
  }
  const double margin = 0.06 * (high - low);  // a reading at the edge keeps its label
  low -= margin;
  high += margin;
  const std::string& name = in.title.empty() ? title : in.title;
  return {panel(before, name + ": before", in.psi, low, high), panel(after, name + outcome, in.psi, low, high, exact)};
}

}  // namespace felt
