#include "io/simulation/scene_file.h"

#include <catch2/catch.hpp>

#include "core/error.h"
#include "io/simulation/scene_library.h"
#include "io/simulation/touches.h"
#include "io/tables/property_yaml.h"
#include "tests/support/data.h"

using namespace felt;

TEST_CASE("a scene survives its file") {
  for (const std::string& name : scene_names()) {
    const Scene scene = make_scene(name), read = parse_scene(scene_json(scene, R"({"seed": 3})"), name);
    INFO(name);
    CHECK(read.name == scene.name);
    CHECK(read.description == scene.description);
    CHECK(read.bounds.isApprox(scene.bounds));
    CHECK(read.light_m == scene.light_m);
    REQUIRE(read.primitives.size() == scene.primitives.size());
    for (size_t i = 0; i < scene.primitives.size(); ++i) {
      const Primitive &a = scene.primitives[i], &b = read.primitives[i];
      CHECK(a.name == b.name);
      CHECK(a.shape == b.shape);
      CHECK(a.half_size_m == b.half_size_m);
      CHECK((a.T_world_shape.matrix() - b.T_world_shape.matrix()).cwiseAbs().maxCoeff() < 1e-12);
      CHECK(std::tie(a.semantic, a.material, a.instance) == std::tie(b.semantic, b.material, b.instance));
      CHECK(a.texture == b.texture);
    }
    REQUIRE(read.path.size() == scene.path.size());
    CHECK(read.path.back().look_at_m == scene.path.back().look_at_m);
  }
}

TEST_CASE("every fault of a scene file is reported with its line") {
  const auto message = [](const std::string& text) -> std::string {
    try {
      parse_scene(text, "s.yaml");
    } catch (const ConfigError& e) {
      return e.what();
    }
    return "accepted";
  };
  using Catch::Contains;
  const std::string good =
      "bounds_m: [[0, 0, 0], [1, 1, 1]]\n"
      "primitives:\n"
      "  - {shape: box, half_size_m: [1, 1, 1], position_m: [0, 0, 0], semantic: box, material: wood, instance: 1}\n"
      "path: [{position_m: [3, 0, 1], look_at_m: [0, 0, 0]}]\n";
  CHECK(message(good) == "accepted");
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    text.replace(text.find(from), from.size(), to);
    return message(text);
  };
  CHECK_THAT(with("shape: box", "shape: torus"),
             Contains("s.yaml:3: shape") && Contains("sphere") && Contains("'torus'"));
  CHECK_THAT(with("shape: box", "name: \"a\\N\", shape: box"), Contains("s.yaml:3: name") && Contains("UTF-8"));
  CHECK_THAT(with("shape: box", "shape: box, shape: sphere"),
             Contains("s.yaml:3: key: expected each once, found 'shape'"));
  CHECK_THAT(with("half_size_m: [1, 1, 1], ", ""), Contains("s.yaml:3: half_size_m") && Contains("found nothing"));
  CHECK_THAT(with("material: wood", "material: jelly"), Contains("s.yaml:3: material"));
  CHECK_THAT(with("half_size_m: [1, 1, 1]", "half_size_m: [1, -1, 1]"), Contains("half_size_m"));
  CHECK_THAT(with("position_m: [0, 0, 0]", "position_m: [0, .nan, 0]"), Contains("position_m") && Contains("'.nan'"));
  CHECK_THAT(with("instance: 1", "instance: 70000"), Contains("instance"));
  CHECK_THAT(with("[[0, 0, 0], [1, 1, 1]]", "[[0, 0, 0], [1, 0, 1]]"), Contains("s.yaml:1: bounds_m"));
  CHECK_THAT(with("look_at_m: [0, 0, 0]", "look_at_m: [3, 0, 0]"), Contains("s.yaml:4: way-point"));
  CHECK_THAT(with("path:", "paths:"), Contains("'paths'") && Contains("path: expected a list"));
  CHECK_THAT(message("[1, 2"), Contains("s.yaml:"));
  CHECK_THAT(message("hello"), Contains("a mapping"));
  CHECK_THAT(message(""), Contains("a mapping"));
  CHECK_THROWS_AS(read_scene("/nonexistent/scene.yaml"), IoError);
}

TEST_CASE("touches lie on surfaces of touchable material, one segment after another, with readings near the prior") {
  const Scene scene = make_scene("ice_crossing");
  const Trajectory trajectory = standard_trajectory(scene, 40);
  const PropertyTable properties = simulated_properties();
  const auto touches = simulate_touches(scene, trajectory, simulated_camera(160, 120), properties[0], {30, 0, 4});
  REQUIRE(touches.size() == 30);
  std::map<std::pair<int, int>, int> times;
  for (const SimulatedTouch& t : touches) {
    const NearestSurface nearest = nearest_surface(scene, t.position_m);
    CHECK(std::abs(nearest.distance_m) < 1e-5);
    CHECK(scene.primitives[nearest.primitive].instance == t.instance);
    CHECK(scene.primitives[nearest.primitive].material == t.material);
    const PropertyPrior& prior =
        properties[0].priors.at(scene.materials.at_slot(scene.materials.slot_of_id(t.material)).name);
    CHECK(std::abs(t.value - prior.mean) < 5 * prior.sd);
    ++times[{t.instance, t.material}];
  }
  CHECK(times.size() >= 6);  // three pieces of floor, two of snow, rock and bollard, as far as they were in view
  const auto again = simulate_touches(scene, trajectory, simulated_camera(160, 120), properties[0], {30, 0, 4});
  CHECK(touches_csv(again, "friction") == touches_csv(touches, "friction"));
  CHECK(touches_csv(touches, "friction").substr(0, 33) == "frame,x,y,z,property,value,sigma\n");
}

TEST_CASE("touches where the network is mistaken are where it is mistaken") {
  const Scene scene = make_scene("ice_crossing");
  const Trajectory trajectory = standard_trajectory(scene, 20);
  const PinholeCamera camera = simulated_camera(160, 120);
  TouchOptions options{20, 0, 4};
  options.mistaken_by = LabelNetwork{preset_confusion("poor", scene.materials), ErrorScale::scene};
  const auto touches = simulate_touches(scene, trajectory, camera, simulated_properties()[0], options);
  REQUIRE(!touches.empty());
  for (const SimulatedTouch& t : touches) {
    const SceneView view = render_view(scene, camera, trajectory[t.frame], false);
    const LabelImage predicted =
        run_network(*options.mistaken_by, scene.materials, view.materials, view.instances, 4, t.frame).labels;
    for (size_t i = 0; i < predicted.size(); ++i) {
      if (view.instances.data()[i] == t.instance && view.materials.data()[i] == t.material)
        REQUIRE(predicted.data()[i] != t.material);
    }
  }
}

TEST_CASE("readings of one thing share the stated part of their variance") {
  // One box touched often: across seeds the variance of single readings is sd^2, of which rho lies between seeds.
  const Scene scene = make_scene("plane");
  Property property = simulated_properties()[0];
  property.priors = {{"paint", {0.5, 0.01, 50}}};
  property.rho = 0.8;
  const Trajectory trajectory = standard_trajectory(scene, 2);
  double within = 0, between = 0;
  constexpr int kSeeds = 300, kEach = 4;
  for (uint64_t seed = 0; seed < kSeeds; ++seed) {
    const auto touches = simulate_touches(scene, trajectory, simulated_camera(32, 24), property, {kEach, 0, seed});
    REQUIRE(touches.size() == kEach);
    double mean = 0;
    for (const auto& t : touches) mean += t.value / kEach;
    for (const auto& t : touches) within += (t.value - mean) * (t.value - mean) / (kEach - 1) / kSeeds;
    between += (mean - 0.5) * (mean - 0.5) / kSeeds;
  }
  // Standard errors: within has 900 degrees of freedom, between 300.
  CHECK(within == Approx(0.2e-4).epsilon(4 * std::sqrt(2.0 / 900)));
  CHECK(between == Approx(0.8e-4 + 0.2e-4 / kEach).epsilon(4 * std::sqrt(2.0 / 300)));
}

TEST_CASE("the simulator's friction table is the one that ships") {
  const PropertyTable shipped = read_properties(test::source_dir() / "data" / "properties.yaml");
  CHECK(simulated_properties() == shipped);
}
