// The paper's two robots: a quadruped before ice that looks like snow, and an arm before a door that may be pushed or
// pulled. Both in maps, with the density of the next reading before and after.
#include <cmath>
#include <numbers>

#include "bench/paper/experiments.h"
#include "inference/mixture.h"
#include "io/pictures/plot_svg.h"
#include "io/simulation/furniture.h"
#include "io/simulation/render_sequence.h"
#include "io/simulation/scene_library.h"
#include "io/simulation/touches.h"
#include "mapping/fusion/tsdf_integrator.h"
#include "mapping/surface/render.h"
#include "mapping/touch/touch_update.h"

namespace felt::paper {
namespace {

PlotSeries density(const std::string& name, const StudentTMixture& m, double from, double to, int color,
                   PlotSeries::Style style = PlotSeries::Style::line) {
  PlotSeries series{name, {}, {}, color, style};
  for (int i = 0; i <= 400; ++i) {
    series.x.push_back(from + (to - from) * i / 400);
    series.y.push_back(pdf(m, series.x.back()));
  }
  return series;
}

std::vector<Frame> frames_of(const Scene& scene, LabelSet labels, int frames) {
  RenderOptions options;
  options.label_set = labels;
  options.noise = DepthNoise{};
  return render_sequence(scene, standard_trajectory(scene, frames), simulated_camera(320, 240), options);
}

Map fused(std::vector<Frame> frames, const ClassTable& classes, const Property& property, double voxel_m) {
  Map map(voxel_m, 4 * voxel_m);
  map.classes = classes;
  map.properties = PropertyTable({property});
  IntegrationScratch scratch;
  for (Frame& frame : frames) {
    frame.instances = {};
    integrate(map, frame, {}, scratch);
  }
  return map;
}

void ice_crossing(const Options& options, Checks& checks) {
  const Scene scene = make_scene("ice_crossing");
  std::vector<Frame> frames = frames_of(scene, LabelSet::material, options.quick ? 6 : 24);
  for (Frame& frame : frames)
    for (uint16_t& id : frame.labels)
      if (id == kIce) id = kSnow;
  const Property friction = simulated_properties()[0];
  std::printf(
      "\n## Crossing ice\n\n%zu frames in which vision takes the ice for snow; one touch of the ice in each of three "
      "trials (the paper's readings). A static gait is chosen where E[friction] of the region is at most 0.25.\n\n"
      "| reading | E[friction] before | after | P(friction <= 0.25) before | after | P(ice) after | gait | region, m2 "
      "|\n"
      "|---|---|---|---|---|---|---|---|\n",
      frames.size());
  std::vector<Plot> plots;
  for (const double reading : {0.139, 0.156, 0.628}) {
    Map map = fused(frames, scene.materials, friction, 0.03);
    TouchRequest request;
    request.point_m = {0.2, 0.1, 0};
    request.property = friction.name;
    request.value = reading;
    const TouchEffect effect = apply_touch(map, resolve_touch(map, request));
    const StudentTMixture &before = effect.before.next_reading[0], &after = effect.after.next_reading[0];
    const double expected = mean(after).value_or(NAN);
    const bool is_static = expected <= 0.25;
    const RegionSummary region = summarize(map, map.touches.touches[0].region, request.region);
    const auto ice = size_t(*map.classes.slot_of_name("ice"));
    std::printf("| %.3f | %.3f | %.3f | %.3f | %.3f | %.3f | %s | %.2f |\n", reading, mean(before).value_or(NAN),
                expected, cdf(before, 0.25), cdf(after, 0.25), effect.after.class_probability[ice],
                is_static ? "static" : "as before", region.area_m2);
    const bool slippery = reading < 0.25;
    checks.better("ice in a map, reading " + std::to_string(reading) + (slippery ? ": 0.25 - E" : ": E - 0.25"),
                  slippery ? 0.25 - expected : expected - 0.25, 0);
    char title[64];
    std::snprintf(title, sizeof title, "Ice taken for snow, reading %.3f", reading);
    plots.push_back({title,
                     "friction",
                     "density of the next reading",
                     {density("before", before, 0, 1, -1, PlotSeries::Style::dashed), density("after", after, 0, 1, 0)},
                     {{reading, "reading"}, {0.25, "static gait"}}});
  }
  if (!options.out.empty()) write_plot_svg(options.out / "ice_crossing.svg", plots, 3);
}

/// The door's label images in halves: some frames take it for one kind, the others for the other.
void door(const Options& options, Checks& checks) {
  const Scene scene = make_scene("door");
  std::vector<Frame> frames = frames_of(scene, LabelSet::semantic, 20);
  const uint16_t kPush = 101, kPull = 102;
  for (size_t i = 0; i < frames.size(); ++i)
    for (uint16_t& id : frames[i].labels) id = id == kDoor ? (i % 2 == 0 ? kPush : kPull) : 0;
  const ClassTable classes({{0, "none", {}, true},
                            {kPush, "push door", {200, 80, 60, 255}, false},
                            {kPull, "pull door", {60, 110, 200, 255}, false}});
  Property force;
  force.name = "force";
  force.unit = "N";
  force.rho = 0;
  force.priors = {{"push door", {-20, std::sqrt(10), 6}}, {"pull door", {20, std::sqrt(10), 6}}};
  Map map = fused(frames, classes, force, 0.03);
  std::printf(
      "\n## A door\n\n%zu frames, every other one takes the door for a push door; model `mixture`, projection `kl`. "
      "Force that opens it, N; prior -20 and +20, variance 10, worth six readings. The voxel at the first contact:\n\n"
      "| reading | push: weight | location | variance | pull: weight | location | variance "
      "|\n|---|---|---|---|---|---|---|\n",
      frames.size());
  TouchRequest request;
  request.point_m = scene.path[1].look_at_m;
  // The contact is where the middle of the path looks at: on the door's front.
  {
    const RayCaster caster(map);
    const Eigen::Vector3d from = scene.path[1].position_m, to = scene.path[1].look_at_m;
    const auto s = caster.cast(from, to - from, 0, 3);
    if (s) request.point_m = from + *s * (to - from);
  }
  request.property = force.name;
  request.model = TouchModel::mixture;
  const Index3 voxel = find_contact(map, request.point_m, {}).voxel;
  Beliefs untouched(map);
  Belief scalar = untouched.at(voxel);
  const auto print = [](const std::string& what, const Belief& b) {
    std::printf("| %s | %.3f | %.1f | %.1f | %.3f | %.1f | %.1f |\n", what.c_str(), b.class_probability[0],
                b.nig[0][0].tau, plug_in_variance(b.nig[0][0]), b.class_probability[1], b.nig[0][1].tau,
                plug_in_variance(b.nig[0][1]));
  };
  print("before", scalar);
  const StudentTMixture before = scalar.next_reading[0];
  std::vector<PlotSeries> series = {density("before", before, -100, 100, -1, PlotSeries::Style::dashed)};
  std::vector<PlotMarker> markers;
  const double push_variance = plug_in_variance(scalar.nig[0][0]);
  int n = 0;
  for (const double reading : {57.0, -38.0, 44.0, -51.0, 31.0, -29.0}) {
    request.value = reading;
    request.stamp_s = ++n;
    add_touch(map, resolve_touch(map, request));
    Beliefs beliefs(map);
    const Belief belief = beliefs.at(voxel);
    char name[16];
    std::snprintf(name, sizeof name, "%.0f", reading);
    print(name, belief);
    if (n == 1) {
      checks.better("door in a map: push variance moves by less than 2 % under a pull",
                    0.02 - std::abs(plug_in_variance(belief.nig[0][0]) / push_variance - 1), 0);
      checks.better("door in a map: pull variance grows at least fivefold",
                    plug_in_variance(belief.nig[0][1]) / plug_in_variance(scalar.nig[0][1]) - 5, 0);
    }
    if (n == 1 || n == 6)
      series.push_back(density(n == 1 ? "after one" : "after six", belief.next_reading[0], -100, 100, n == 1 ? 0 : 1));
    markers.push_back({reading, name});
  }
  if (!options.out.empty())
    write_plot_svg(options.out / "door.svg",
                   {{"A door: push or pull?", "force, N", "density of the next reading", series, markers}});
}

}  // namespace

void situations(const Options& options, Checks& checks) {
  ice_crossing(options, checks);
  door(options, checks);
}

}  // namespace felt::paper
