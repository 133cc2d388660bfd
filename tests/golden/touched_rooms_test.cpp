// Touches in simulated rooms: labels from a network of known confusion, readings from the friction table.
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "inference/decision.h"
#include "io/sequence/open_sequence.h"
#include "io/simulation/depth_noise.h"
#include "io/simulation/label_network.h"
#include "io/simulation/render_sequence.h"
#include "io/simulation/scene_file.h"
#include "io/simulation/scene_library.h"
#include "io/simulation/touches.h"
#include "io/simulation/trajectory.h"
#include "mapping/fusion/label_evidence.h"
#include "mapping/fusion/tsdf_integrator.h"
#include "mapping/touch/property_view.h"
#include "mapping/touch/touch_update.h"
#include "tests/support/data.h"

using namespace felt;
using namespace felt::test;

namespace {

void fuse(Map& map, const Frame& frame, float max_evidence) {
  IntegrationConfig config;
  config.labels.max_evidence = max_evidence;
  IntegrationScratch scratch;
  integrate(map, frame, config, scratch);
}

TouchRequest request_of(const SimulatedTouch& touch) {
  TouchRequest request;
  request.stamp_s = double(touch.frame);
  request.point_m = touch.position_m;
  request.property = "friction";
  request.value = touch.value;
  return request;
}

/// What every voxel outside of a region answers, byte for byte.
std::string answers_outside(const Map& map, const Region& region) {
  const auto views = std::make_shared<const std::vector<TouchView>>(touch_views(map));
  const PropertyView friction(map, 0, views);
  std::string bytes;
  const auto put = [&](const auto& value) {
    char raw[sizeof value];
    std::memcpy(raw, &value, sizeof value);
    bytes.append(raw, sizeof value);
  };
  for (const uint32_t number : map.store.sorted()) {
    const Block& block = map.store[number];
    const Index3 f = first_voxel(block.coord);
    for (int i = 0; i < kBlockVoxels; ++i) {
      const Index3 o = voxel_of_offset(i), v{f.x + o.x, f.y + o.y, f.z + o.z};
      if (region.contains(v)) continue;
      const ClassBelief belief = class_belief_at(map, *views, v);
      const PropertyEstimate estimate = friction.at(v);
      put(belief.slot), put(belief.probability), put(belief.entropy), put(estimate.mean), put(estimate.sd);
      put(estimate.touched);
    }
  }
  return bytes;
}

/// The exact decision from the printed formulas alone: pooled counts times a Student-t of 50 degrees of freedom.
int exact_decision(const Map& map, const Region& region, const Property& friction, double psi) {
  const int k = map.classes.size();
  std::vector<double> score(size_t(k), 0.0);
  for (size_t b = 0; b < region.blocks(); ++b) {
    const Block& block = *map.store.get(region.coord[b]);
    for_each_bit(region.mask[b], [&](int i) {
      for (int c = 0; c < k; ++c) score[size_t(c)] += map.classes.prior(c);
      for (const EvidencePlane& e : block.evidence) score[e.slot] += double(e.counts->value[i]);
    });
  }
  for (int c = 0; c < k; ++c) {
    const auto prior = friction.priors.find(map.classes.at_slot(c).name);
    if (prior == friction.priors.end()) {
      score[size_t(c)] = 0;
      continue;
    }
    const double z = (psi - prior->second.mean) / (prior->second.sd * std::sqrt(51.0 / 50));
    score[size_t(c)] *= std::pow(1 + z * z / 50, -25.5) / prior->second.sd;
  }
  return most_probable_class(score);
}

}  // namespace

TEST_CASE("touched things of simulated rooms are decided as exactly, the rest of the map keeps its bits") {
  int touched = 0, seen_right = 0, felt_right = 0, exact_right = 0;
  for (int room = 1; room <= 5; ++room) {
    const Scene scene = make_scene("room" + std::to_string(room));
    const Trajectory trajectory = standard_trajectory(scene, 6);
    const PinholeCamera camera = simulated_camera(160, 120);
    RenderOptions options;
    options.label_set = LabelSet::material;
    options.with_color = false;
    const LabelNetwork network{preset_confusion("medium", scene.materials), ErrorScale::scene};
    Map map(0.05, 0.2);
    map.classes = scene.materials;
    map.properties = simulated_properties();
    for (size_t i = 0; i < trajectory.size(); ++i) {
      Frame frame = render_frame(scene, camera, trajectory[i], int64_t(i), options);
      frame.labels =
          run_network(network, scene.materials, frame.labels, frame.instances, uint64_t(room), frame.index).labels;
      // The network is right in 78 of 100 cases, and says so however often it looks: (a + n) / (k a + n) = 0.78.
      fuse(map, frame, float((0.78 * map.classes.size() - 1) / 0.22 * map.classes.prior(0)));
    }
    const std::string hash = map_hash(map);
    TouchOptions touch_options;
    touch_options.count = 12;
    touch_options.seed = uint64_t(room);
    Region reached;
    std::vector<Touch> touches;
    for (const SimulatedTouch& simulated :
         simulate_touches(scene, trajectory, camera, map.properties[0], touch_options)) {
      Touch touch;
      try {
        touch = resolve_touch(map, request_of(simulated));
      } catch (const TouchError&) {
        continue;  // a thing that the network ignored, or that no frame saw well
      }
      const int exact = exact_decision(map, touch.region, map.properties[0], simulated.value);
      const int before = most_probable_class(pooled_belief(map, touch.region));
      const uint64_t id = add_touch(map, touch);
      const Touch& recorded = *map.touches.find(id);
      const std::vector<uint32_t> alone{uint32_t(&recorded - map.touches.touches.data())};
      const int decided = most_probable_class(Beliefs(map).of(recorded.region, alone).class_probability);
      CHECK(decided == exact);
      undo_touch(map, id);
      const int truth = scene.materials.slot_of_id(simulated.material);
      ++touched;
      seen_right += before == truth;
      felt_right += decided == truth;
      exact_right += exact == truth;
      reached = united(reached, touch.region);
      touches.push_back(touch);
    }
    map.touches.touches.clear();
    REQUIRE(map_hash(map) == hash);
    const std::string before = answers_outside(map, reached);
    for (const Touch& touch : touches) add_touch(map, touch);
    CHECK(map_hash(map) != hash);
    CHECK((answers_outside(map, reached) == before));
    for (const Block& block : map.store.blocks()) CHECK(block.touch.empty() == (reached.find(block.coord) == nullptr));
  }
  // How often a touch mends a label is the models' matter (tests/golden/touch_patches_test.cpp): this network takes
  // materials for look-alikes, some of which feel alike too, and the stated belief does not know that.
  INFO(touched << " touches; right before " << seen_right << ", after " << felt_right);
  CHECK(touched >= 40);
  CHECK(felt_right == exact_right);
  CHECK(felt_right >= touched / 2);
}

TEST_CASE("touch helps labels of simulated rooms under calibrated vision, as much as the exact decision does") {
  // Calibrated: the network's confusion matrix is known, the share of each material among what is touched too, and a
  // pixel labelled j adds P(true = i | j) to class i. Mistakes are of whole things, the same in every frame.
  struct Room {
    Scene scene;
    Trajectory trajectory;
    std::vector<Frame> frames;
  };
  constexpr int kRooms = 5, kNetworks = 12, kTouches = 12;
  const PinholeCamera camera = simulated_camera(160, 120);
  const PropertyTable properties = simulated_properties();
  const Property& friction = properties[0];
  RenderOptions rendering;
  rendering.label_set = LabelSet::material;
  rendering.with_color = false;
  std::vector<Room> rooms;
  std::vector<std::vector<SimulatedTouch>> touches;  // room by room, network by network
  for (int room = 1; room <= kRooms; ++room) {
    const Scene scene = make_scene("room" + std::to_string(room));
    const Trajectory trajectory = standard_trajectory(scene, 4);
    rooms.push_back({scene, trajectory, render_sequence(scene, trajectory, camera, rendering)});
    for (int network = 0; network < kNetworks; ++network) {
      TouchOptions options;
      options.count = kTouches;
      options.seed = uint64_t(100 * room + network);
      touches.push_back(simulate_touches(scene, trajectory, camera, friction, options));
    }
  }
  std::vector<ClassInfo> infos = rooms[0].scene.materials.classes();
  for (ClassInfo& info : infos) info.prior = 1e-3;  // what is believed is what vision says
  const ClassTable materials(infos);
  const int k = materials.size();
  std::vector<double> share(size_t(k), 0.0);
  for (const auto& some : touches)
    for (const SimulatedTouch& touch : some) share[materials.slot_of_id(touch.material)] += 1;
  const ConfusionMatrix confusion = preset_confusion("medium", materials);
  std::vector<double> joint;  // of true and predicted class
  for (int i = 0; i < k; ++i)
    for (int j = 0; j < k; ++j) joint.push_back(share[size_t(i)] * confusion(i, j));
  const LabelEvidence likelihood = label_evidence(joint, k, k);
  IntegrationConfig config;
  config.labels.likelihood = &likelihood;

  int touched = 0, seen_right = 0, felt_right = 0, exact_right = 0, same = 0;
  for (size_t run = 0; run < touches.size(); ++run) {
    const Room& room = rooms[run / kNetworks];
    const LabelNetwork network{confusion, ErrorScale::scene};
    Map map(0.05, 0.2);
    map.classes = materials;
    map.properties = properties;
    IntegrationScratch scratch;
    for (const Frame& rendered : room.frames) {
      Frame frame = rendered;
      frame.labels = run_network(network, materials, frame.labels, frame.instances, run, frame.index).labels;
      integrate(map, frame, config, scratch);
    }
    for (const SimulatedTouch& simulated : touches[run]) {
      Touch touch;
      try {
        touch = resolve_touch(map, request_of(simulated));
      } catch (const TouchError&) {
        continue;  // a thing that no frame saw well
      }
      const std::vector<double> seen = pooled_belief(map, touch.region);
      const uint64_t id = add_touch(map, touch);
      const int decided = most_probable_class(Beliefs(map).of(touch.region, {0}).class_probability);
      undo_touch(map, id);
      map.touches.touches.clear();
      // The exact decision from the printed formulas alone, given what the network says there.
      const int label = most_probable_class(seen);
      std::vector<double> score(size_t(k), 0.0);
      for (int c = 0; c < k; ++c) {
        const auto prior = friction.priors.find(materials.at_slot(c).name);
        if (prior == friction.priors.end()) continue;
        const double z = (simulated.value - prior->second.mean) / (prior->second.sd * std::sqrt(51.0 / 50));
        score[size_t(c)] = seen[size_t(c)] * std::pow(1 + z * z / 50, -25.5) / prior->second.sd;
      }
      const int exact = most_probable_class(score), truth = materials.slot_of_id(simulated.material);
      ++touched;
      seen_right += label == truth;
      felt_right += decided == truth;
      exact_right += exact == truth;
      same += decided == exact;
    }
  }
  WARN(touched << " touches of " << kRooms << " rooms and " << kNetworks << " networks each; right before "
               << double(seen_right) / touched << ", after " << double(felt_right) / touched << ", exact decision "
               << double(exact_right) / touched);
  CHECK(touched >= 500);
  CHECK(same == touched);
  CHECK(felt_right == exact_right);
  // Three standard errors of a paired difference in which a tenth of the touches changes sides.
  CHECK(double(felt_right - seen_right) / touched > 3 * std::sqrt(0.1 / touched));
}

namespace {

/// Half a step of the stored scenes' depth sensor, metres, where the nearest view of a point measures it: how far off a
/// surface may be measured there however often it is looked at. 0 where the depth is exact.
double half_depth_step_m(const Eigen::Vector3d& p_world, const Trajectory& trajectory, const PinholeCamera& camera) {
  const DepthNoise sensor;
  double nearest_m = std::numeric_limits<double>::infinity();
  for (const Eigen::Isometry3d& pose : trajectory) {
    const Eigen::Vector3d p = pose.inverse() * p_world;
    if (p.z() <= sensor.min_depth_m) continue;
    const Eigen::Vector2d uv = camera.project(p);
    if (uv.x() >= 0 && uv.y() >= 0 && uv.x() < camera.width && uv.y() < camera.height)
      nearest_m = std::min(nearest_m, p.z());
  }
  return 0.5 * nearest_m * nearest_m * sensor.disparity_step_px / (camera.fx * sensor.baseline_m);
}

/// Touches things of a scene and checks that no voxel of their regions lies farther than two voxels, a band of one on
/// either side and the rounding to voxels, from the touched material, or from the plane of the touched face; with
/// sensor noise, half a depth step more.
void check_regions(const std::string& name, const Scene& scene, const std::vector<Frame>& frames,
                   const ClassTable& materials, bool exact_depth) {
  const double voxel = 0.03;
  Map map(voxel, 4 * voxel);
  map.classes = materials;
  map.properties = simulated_properties();
  Trajectory trajectory;
  for (const Frame& frame : frames) {
    fuse(map, frame, 0);
    trajectory.push_back(frame.T_world_camera);
  }
  const PinholeCamera camera = frames[0].camera;
  TouchOptions options;
  options.count = 16;
  int regions = 0, flat = 0;
  size_t voxels = 0;
  for (const SimulatedTouch& simulated : simulate_touches(scene, trajectory, camera, map.properties[0], options)) {
    Touch touch;
    try {
      touch = resolve_touch(map, request_of(simulated));
    } catch (const TouchError&) {
      continue;
    }
    ++regions;
    voxels += touch.region.voxels();
    const NearestSurface nearest = nearest_surface(scene, simulated.position_m);
    const Primitive& felt_thing = scene.primitives[size_t(nearest.primitive)];
    Eigen::Vector3d normal;
    for (int axis = 0; axis < 3; ++axis)
      normal[axis] = signed_distance_m(felt_thing, simulated.position_m + 1e-4 * Eigen::Vector3d::Unit(axis)) -
                     signed_distance_m(felt_thing, simulated.position_m - 1e-4 * Eigen::Vector3d::Unit(axis));
    normal.normalize();
    // On the narrow side of a board the contact may snap around the edge: then there is no touched face to leave.
    const bool is_flat = (felt_thing.shape == ShapeKind::plane || felt_thing.shape == ShapeKind::box) &&
                         find_contact(map, simulated.position_m, touch.request.region).normal.dot(normal) > 0.7;
    flat += is_flat;
    size_t other_material = 0, beyond_crease = 0;
    double farthest_m = 0;  // beyond what is allowed
    for (size_t b = 0; b < touch.region.blocks(); ++b)
      for_each_bit(touch.region.mask[b], [&](int i) {
        const Index3 f = first_voxel(touch.region.coord[b]), o = voxel_of_offset(i);
        const Eigen::Vector3d p = Eigen::Vector3d(f.x + o.x, f.y + o.y, f.z + o.z) * voxel;
        double same_m = 1e9;
        for (const Primitive& primitive : scene.primitives)
          if (primitive.material == simulated.material)
            same_m = std::min(same_m, std::abs(signed_distance_m(primitive, p)));
        const double off_m = is_flat ? std::abs(normal.dot(p - simulated.position_m)) : 0;
        // Faces lie at multiples of a centimetre: just two voxels off must not depend on rounding.
        const double allowed_m = 2.001 * voxel + (exact_depth ? 0 : half_depth_step_m(p, trajectory, camera));
        other_material += same_m > allowed_m;
        beyond_crease += off_m > allowed_m;
        farthest_m = std::max({farthest_m, same_m - allowed_m, off_m - allowed_m});
      });
    INFO(name << ", " << felt_thing.name << " at " << simulated.position_m.transpose() << ": " << touch.region.voxels()
              << " voxels, " << other_material << " beside the material, " << beyond_crease
              << " off the plane, farthest " << farthest_m / voxel << " voxels more than allowed");
    CHECK(other_material == 0);
    CHECK(beyond_crease == 0);
  }
  INFO(name << ": " << voxels << " voxels of " << regions << " regions");
  CHECK(regions >= 3);
  CHECK(flat >= 2);
  CHECK(voxels > 5000);
}

}  // namespace

TEST_CASE("regions of the stored scenes end at creases and where the material changes") {
  for (const std::string name : {"room", "table_wall", "ice_crossing"}) {
    const std::filesystem::path folder = source_dir() / "data/scenes" / name;
    const Scene scene = read_scene(folder / "scene.json");
    SequenceOptions reading;
    reading.labels_dir = folder / "truth/material";
    reading.classes_file = folder / "truth/material.yaml";
    reading.read_color = false;
    const auto sequence = open_sequence(folder, reading);
    std::vector<Frame> stored;
    Trajectory trajectory;
    for (int64_t i = 0; i < sequence->size(); ++i) {
      const ReadResult result = sequence->read(i);
      stored.push_back(std::get<Frame>(result));
      trajectory.push_back(stored.back().T_world_camera);
    }
    check_regions(name + ", sensor noise", scene, stored, sequence->info().classes, false);
    RenderOptions exact;
    exact.label_set = LabelSet::material;
    exact.with_color = false;
    check_regions(name + ", exact depth", scene, render_sequence(scene, trajectory, sequence->info().camera, exact),
                  scene.materials, true);
  }
}

TEST_CASE("a touch of a thing by its instance reaches all of that thing and nothing else") {
  const std::filesystem::path folder = source_dir() / "data/scenes/table_wall";
  const Scene scene = read_scene(folder / "scene.json");
  SequenceOptions reading;
  reading.read_color = false;
  reading.read_instances = true;
  const auto sequence = open_sequence(folder, reading);
  Map map(0.03, 0.12);
  map.classes = sequence->info().classes;
  IntegrationConfig config;
  config.labels.instances = true;
  IntegrationScratch scratch;
  for (int64_t i = 0; i < sequence->size(); ++i) integrate(map, std::get<Frame>(sequence->read(i)), config, scratch);

  const Primitive* table_top = nullptr;
  for (const Primitive& p : scene.primitives)
    if (p.shape == ShapeKind::box && p.half_size_m.x() > 0.5 && p.half_size_m.z() < 0.1) table_top = &p;
  REQUIRE(table_top != nullptr);
  RegionSettings settings;
  settings.rule = RegionRule::instance;
  const Eigen::Vector3d on_top = table_top->T_world_shape * Eigen::Vector3d(-0.4, 0, table_top->half_size_m.z());
  const Region region = find_region(map, find_contact(map, on_top, settings), settings);
  settings.rule = RegionRule::connected;
  const Region top = find_region(map, find_contact(map, on_top, settings), settings);
  CHECK(intersected(top, region).voxels() > 0.9 * double(top.voxels()));

  size_t other = 0;
  for (size_t b = 0; b < region.blocks(); ++b)
    for_each_bit(region.mask[b], [&](int i) {
      const Index3 f = first_voxel(region.coord[b]), o = voxel_of_offset(i);
      const Eigen::Vector3d p = Eigen::Vector3d(f.x + o.x, f.y + o.y, f.z + o.z) * map.voxel_size_m;
      double distance_m = 1e9;
      for (const Primitive& primitive : scene.primitives)
        if (primitive.instance == table_top->instance)
          distance_m = std::min(distance_m, std::abs(signed_distance_m(primitive, p)));
      other += distance_m > 2 * map.voxel_size_m;
    });
  INFO(region.voxels() << " voxels");
  CHECK(other == 0);

  Map without(0.03, 0.12);
  without.classes = map.classes;
  fuse(without, std::get<Frame>(sequence->read(0)), 0);
  fuse(without, std::get<Frame>(sequence->read(1)), 0);
  settings.rule = RegionRule::instance;
  const Block& seen = without.store[without.store.sorted()[without.store.size() / 2]];
  REQUIRE(seen.instance == nullptr);
  CHECK_THROWS_WITH(find_region(without, find_contact(without, on_top, settings), settings),
                    Catch::Contains("--instances"));
}
