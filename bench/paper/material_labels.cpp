#include <cmath>
#include <string>
#include <utility>

#include "bench/paper/experiments.h"
#include "bench/paper/label_simulation.h"

namespace felt::paper {
namespace {

struct Method {
  const char* name;
  Vision vision;
  bool printed_property_prior;
};
constexpr Method kOurs{"**ours**: calibrated vision and property prior", Vision::calibrated, false};
constexpr Method kTheirVision{"the paper's vision prior, our property prior", Vision::paper, false};
constexpr Method kTheirs{"the paper's vision and property prior", Vision::paper, true};
constexpr Method kTold{"the paper's vision prior, told that it is wrong, our property prior", Vision::told, false};

/// Accuracy after one touch as the paper prints it (its Table II); its macro average.
constexpr double kPrinted[kClasses] = {0.83, 0.77, 0.79, 0.82, 0.83, 0.85, 0.99, 0.84};

void print_row(const char* where, int touches, const char* method, const LabelOutcome& o) {
  std::printf("| %s | %d | %s |", where, touches, method);
  for (const double a : o.accuracy) std::printf(" %.2f |", a);
  std::printf(" **%.3f** | %.3f | %.3f | %.3f | %.1f |\n", o.macro(), 1.96 * o.macro_error(), o.calibration.ece(),
              o.binary_cross_entropy, o.psnr_db());
  std::fflush(stdout);
}

void print_header(const char* first) {
  std::printf("\n| %s | touches | method |", first);
  for (const Material& m : kMaterials) std::printf(" %s |", m.name);
  std::printf(" macro | ± 95 %% | ECE | cross entropy, nat | PSNR, dB |\n|---|---|---|");
  for (size_t i = 0; i < kClasses + 5; ++i) std::printf("---|");
  std::printf("\n");
}

LabelExperiment experiment(Places places, const Method& method, int touches, double rho = 0, double assumed = 0) {
  return {places, method.vision, method.printed_property_prior, touches, rho, assumed};
}

void both_protocols(int regions, bool quick, Checks& checks) {
  print_header("places");
  print_row("—", 0, "vision only, the paper's belief",
            simulate_labels(experiment(Places::everywhere, kTheirVision, 0), regions));
  print_row("—", 0, "vision only, calibrated", simulate_labels(experiment(Places::everywhere, kOurs, 0), regions));
  std::printf("| where wrong | 1 | the paper, as printed |");
  double printed = 0;
  for (const double a : kPrinted) std::printf(" %.2f |", a), printed += a / kClasses;
  std::printf(" **%.2f** | | | | |\n", printed);
  for (const int touches : {1, 2, 3, 5}) {
    const auto run = [&](const char* where, Places places, const Method& method) {
      const LabelOutcome o = simulate_labels(experiment(places, method, touches), regions);
      print_row(where, touches, method.name, o);
      return o;
    };
    const auto expect = [&](const char* what, const LabelOutcome& o, double one, double two, double three, double five,
                            double digit = 0.001) {
      const double expected = touches == 1 ? one : touches == 2 ? two : touches == 3 ? three : five;
      if (expected > 0)
        checks.within(std::string(what) + ", touches: " + std::to_string(touches), o.macro(), o.macro_error(), expected,
                      digit);
    };
    const char* wrong = "where wrong";
    expect("paper's protocol, its vision and property prior", run(wrong, Places::where_wrong, kTheirs), 0.827, 0, 0, 0);
    expect("paper's protocol, its vision prior", run(wrong, Places::where_wrong, kTheirVision), 0.863, 0, 0.914, 0);
    expect("paper's protocol, told that vision is wrong", run(wrong, Places::where_wrong, kTold), 0.885, 0, 0.929, 0);
    run(wrong, Places::where_wrong, kOurs);
    const char* all = "everywhere";
    expect("honest, the paper's vision and property prior", run(all, Places::everywhere, kTheirs), 0.345, 0, 0, 0);
    expect("honest, the paper's vision prior", run(all, Places::everywhere, kTheirVision), 0.70, 0.75, 0.78, 0, 0.01);
    expect("honest, ours", run(all, Places::everywhere, kOurs), 0.830, 0.863, 0.884, 0.913);
    LabelExperiment projected = experiment(Places::everywhere, kTheirVision, touches);
    projected.projected_concentrations = true;
    const LabelOutcome literal = simulate_labels(projected, regions);
    print_row(all, touches, "the paper's update read literally: largest projected concentration", literal);
    if (touches == 1) {
      const double vision = simulate_labels(experiment(Places::everywhere, kTheirVision, 0), regions).macro();
      checks.within("projected concentrations never change a label: accuracy less vision's", literal.macro() - vision,
                    0, 0, 1e-9);
    }
    run("at random", Places::at_random, kOurs);
    if (quick && touches != 1) continue;
    // Two milliseconds a place: fewer regions, and the same ones where each is touched equally often.
    const int fewer = quick ? 50 : 300;
    const LabelOutcome suggested = simulate_labels(experiment(Places::suggested, kOurs, touches), fewer);
    print_row("by `suggest`, fewer regions", touches, kOurs.name, suggested);
    const LabelOutcome equal = simulate_labels(experiment(Places::everywhere, kOurs, touches), fewer);
    print_row("everywhere, the same regions", touches, kOurs.name, equal);
    const PairedDifference gain = compare(suggested, equal);
    const std::string claim = "places by `suggest` less each region equally, touches: " + std::to_string(touches);
    if (quick)
      checks.not_worse(claim, gain.difference, gain.error);
    else
      checks.better(claim, gain.difference, gain.error);
  }
}

void correlated_readings(int regions, Checks& checks) {
  std::printf("\nReadings correlated within a region (everywhere, calibrated vision and property prior):\n");
  print_header("correlation");
  for (const double rho : {0.5, 0.8})
    for (const bool modelled : {false, true}) {
      LabelOutcome fewer;
      for (const int touches : {1, 2, 3, 4, 5}) {
        const LabelExperiment e = experiment(Places::everywhere, kOurs, touches, rho, modelled ? rho : 0);
        const LabelOutcome o = simulate_labels(e, regions);
        char name[16];
        std::snprintf(name, sizeof name, "%.1f", rho);
        print_row(name, touches, modelled ? "**ours**: modelled" : "taken as independent", o);
        const LabelOutcome before = std::exchange(fewer, o);
        if (!modelled || touches == 1) continue;
        const PairedDifference step = compare(o, before);
        checks.not_worse(std::string("correlation ") + name + " modelled: touch " + std::to_string(touches) +
                             " over touch " + std::to_string(touches - 1),
                         step.difference, step.error);
        if (rho == 0.8) {
          constexpr double kExpected[] = {0.831, 0.843, 0.852, 0.859, 0.866};
          checks.within(std::string("correlation 0.8 modelled, touches: ") + std::to_string(touches), o.macro(),
                        o.macro_error(), kExpected[touches - 1]);
        }
      }
    }
}

/// Several touches as Algorithm 1 prints them: each compared with the prior, the updated parameters not fed back.
void without_feedback(int regions, Checks& checks) {
  std::printf(
      "\nUpdated parameters not fed back (everywhere; correlation 0.8 taken as independent in the second part):\n");
  print_header("correlation");
  const auto run = [&](const char* rho, LabelExperiment e, const char* method, double expected, double digit) {
    e.fed_back = false;
    const LabelOutcome o = simulate_labels(e, regions);
    print_row(rho, e.touches, method, o);
    checks.within(std::string("not fed back, ") + method + ", touches: " + std::to_string(e.touches), o.macro(),
                  o.macro_error(), expected, digit);
  };
  constexpr double kPrintedPrior[] = {0.345, 0.23, 0.22}, kIndependent[] = {0.831, 0.827, 0.796, 0.766, 0.742};
  for (int t = 1; t <= 3; ++t)
    run("0", experiment(Places::everywhere, kTheirs, t), kTheirs.name, kPrintedPrior[t - 1], t == 1 ? 0.001 : 0.01);
  for (int t = 1; t <= 5; ++t)
    run("0.8", experiment(Places::everywhere, kOurs, t, 0.8, 0), "taken as independent", kIndependent[t - 1], 0.001);
}

}  // namespace

void material_labels(const Options& options, Checks& checks) {
  const int regions = options.quick ? 400 : 6000;
  std::printf("\n## Material labels\n\n%d regions of each class; intervals are 1.96 standard errors.\n", regions);
  both_protocols(regions, options.quick, checks);
  correlated_readings(regions, checks);
  without_feedback(regions, checks);
}

}  // namespace felt::paper
