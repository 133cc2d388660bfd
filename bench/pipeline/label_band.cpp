// What the label band does to the classes of a map: the rendered house against the class of the nearest face of its
// exact mesh, by band and voxel size, with exact and with measured depth, with exact labels and with those of a
// simulated network (docs/semantics.md).
//   bench_label_band
#include <tbb/parallel_for.h>

#include <cmath>

#include "bench/support/bench.h"
#include "core/simd.h"
#include "io/meshes/mesh_io.h"
#include "io/simulation/depth_noise.h"
#include "io/simulation/label_network.h"
#include "mapping/evaluation/mesh_distance.h"
#include "mapping/fusion/tsdf_integrator.h"
#include "mapping/labels/class_belief.h"
#include "mapping/surface/marching_cubes.h"
#include "mapping/surface/surface_color.h"

namespace {

using namespace felt;

/// The exact mesh and the class of each face.
struct House {
  ClassTable classes;
  TriangleTree tree;
  std::vector<float> face_class;

  /// Slot of the face nearest to a point, kNoSlot where there is none near, or one of no class.
  uint16_t truth(const Eigen::Vector3d& p, double limit_m) const {
    const TriangleTree::Nearest nearest = tree.nearest(p, limit_m);
    return nearest.triangle == TriangleTree::kNone ? ClassTable::kNoSlot
                                                   : classes.slot_of_id(uint16_t(face_class[nearest.triangle]));
  }
};

/// A place of the map, by voxel, with its true class.
struct Place {
  uint32_t block;
  uint16_t offset, truth;
};

/// What a map of these frames is compared at. Blocks are numbered alike for every band.
struct Places {
  std::vector<Place> surface, all, vertices;  ///< voxels within half a voxel; all observed; nearest to mesh vertices
};

Places places_of(const Map& map, const House& house) {
  Places places;
  const double limit_m = 2 * map.truncation_m;
  std::vector<std::vector<Place>> by_block(map.store.size());
  tbb::parallel_for(size_t(0), by_block.size(), [&](size_t b) {
    const Block& block = map.store[uint32_t(b)];
    for (int i = 0; i < kBlockVoxels; ++i) {
      if (!(block.geometry->weight[i] > 0)) continue;
      const Index3 first = first_voxel(block.coord), in = voxel_of_offset(i);
      const Eigen::Vector3d p = Eigen::Vector3d(first.x + in.x, first.y + in.y, first.z + in.z) * map.voxel_size_m;
      const uint16_t truth = house.truth(p, limit_m);
      if (truth != ClassTable::kNoSlot) by_block[b].push_back({uint32_t(b), uint16_t(i), truth});
    }
  });
  for (const std::vector<Place>& some : by_block)
    for (const Place& place : some) {
      places.all.push_back(place);
      if (std::abs(map.store[place.block].geometry->tsdf[place.offset]) < map.voxel_size_m / 2)
        places.surface.push_back(place);
    }
  std::vector<VertexEdge> edges;
  const TriangleMesh mesh = extract_mesh(map, {.normals = false, .colors = false}, &edges);
  places.vertices.resize(edges.size());
  tbb::parallel_for(size_t(0), edges.size(), [&](size_t i) {
    const Index3 voxel = nearest_voxel(edges[i]);
    places.vertices[i] = {map.store.find(block_of_voxel(voxel)), uint16_t(offset_in_block(voxel)),
                          house.truth(mesh.positions[i].cast<double>(), limit_m)};
  });
  std::erase_if(places.vertices, [](const Place& place) { return place.truth == ClassTable::kNoSlot; });
  return places;
}

/// Classes of fewer places are left out of the mIoU, labelled or not, so that it is over the same classes for every
/// band: a class of one voxel would count as much as the wall.
constexpr double kFewest = 30;

struct Scores {
  double miou = 0, accuracy = 0;  ///< of the labelled places
  size_t labelled = 0;
  double coverage = 0;  ///< share of the places that have a class
};

Scores compare(const Map& map, const std::vector<Place>& places) {
  const auto k = size_t(map.classes.size());
  std::vector<double> hit(k), truth(k), mapped(k), there(k);
  Scores scores;
  for (const Place& place : places) {
    there[place.truth] += 1;
    const uint16_t slot = class_belief(map.store[place.block], place.offset, map.classes).slot;
    if (slot == ClassTable::kNoSlot) continue;
    ++scores.labelled;
    truth[place.truth] += 1, mapped[slot] += 1;
    if (slot == place.truth) hit[slot] += 1, scores.accuracy += 1;
  }
  int present = 0;
  for (size_t c = 0; c < k; ++c) {
    if (there[c] < kFewest) continue;
    if (truth[c] > 0) scores.miou += hit[c] / (truth[c] + mapped[c] - hit[c]);
    ++present;
  }
  scores.miou /= present;
  scores.accuracy /= double(scores.labelled);
  scores.coverage = double(scores.labelled) / double(places.size());
  return scores;
}

Map fused(const std::vector<Frame>& frames, const ClassTable& classes, double voxel_m, float band_vox) {
  Map map(voxel_m, 4 * voxel_m);
  map.classes = classes;
  IntegrationConfig config;
  config.labels.band_vox = band_vox;
  IntegrationScratch scratch;
  for (const Frame& frame : frames) integrate(map, frame, config, scratch);
  return map;
}

/// As a structured-light camera measures it, surfaces seen head on.
void measure_depth(Frame& frame) {
  SceneView view;
  view.depth_m = frame.depth_m;
  view.incidence_cos = Image<float>(frame.depth_m.width(), frame.depth_m.height(), 1.0f);
  frame.depth_m = add_depth_noise(view, frame.camera, {}, 1, frame.index);
}

void run(const std::string& name, const std::vector<Frame>& frames, const House& house) {
  std::printf("\n%s, truncation 4 voxels, %zu frames\n\n", name.c_str(), frames.size());
  std::printf(
      "| voxel | band, voxels | mIoU of surface voxels | labelled of them | mIoU of mesh vertices | labelled of them | "
      "right of them | mIoU of all labelled voxels | labelled voxels |\n|---|---|---|---|---|---|---|---|---|\n");
  for (const double voxel_m : {0.02, 0.05}) {
    const Places places = places_of(fused(frames, house.classes, voxel_m, 1), house);
    for (const float band : {0.25f, 0.5f, 0.75f, 1.0f, 1.5f, 2.0f, 4.0f}) {
      const Map map = fused(frames, house.classes, voxel_m, band);
      const Scores surface = compare(map, places.surface), vertices = compare(map, places.vertices),
                   all = compare(map, places.all);
      std::printf("| %g cm | %g | %.3f | %.1f %% | %.3f | %.1f %% | %.1f %% | %.3f | %zu |\n", 100 * voxel_m,
                  double(band), surface.miou, 100 * surface.coverage, vertices.miou, 100 * vertices.coverage,
                  100 * vertices.accuracy, all.miou, all.labelled);
      std::fflush(stdout);
    }
  }
}

}  // namespace

int main() {
  apply_simd_choice();
  const std::filesystem::path folder = bench::recorded("house_living_rendered");
  const std::vector<Frame> exact =
      bench::decoded("house_living_rendered", {.frames = {.step = 2}, .read_color = false});
  const TriangleMesh mesh = read_mesh(folder / "gt_mesh.ply");
  const std::vector<float>* face_class = TriangleMesh::find(mesh.triangle_scalars, "semantic");
  if (face_class == nullptr) {
    std::printf("gt_mesh.ply: no 'semantic' of its faces\n");
    return 1;
  }
  const House house{open_sequence(folder, {.read_color = false})->info().classes, TriangleTree(mesh), *face_class};

  std::vector<Frame> predicted = exact;
  const LabelNetwork network{preset_confusion("medium", house.classes), ErrorScale::segment};
  for (Frame& frame : predicted)
    frame.labels = run_network(network, house.classes, frame.labels, frame.instances, 1, frame.index).labels;
  std::vector<Frame> measured = exact, both = predicted;
  for (std::vector<Frame>* frames : {&measured, &both})
    for (Frame& frame : *frames) measure_depth(frame);
  run("Exact depth, exact labels", exact, house);
  run("Exact depth, labels of the medium network", predicted, house);
  run("Measured depth, exact labels", measured, house);
  run("Measured depth, labels of the medium network", both, house);
}
