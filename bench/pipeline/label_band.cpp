// What the label band does to the classes of a map: the rendered house with its exact labels, against the class of the
// nearest face of its exact mesh, by band and voxel size (docs/semantics.md).
//   bench_label_band
#include <tbb/parallel_for.h>

#include <cmath>

#include "bench/support/bench.h"
#include "core/simd.h"
#include "io/mesh_io.h"
#include "mapping/class_belief.h"
#include "mapping/mesh_distance.h"
#include "mapping/tsdf_integrator.h"

namespace {

using namespace felt;

struct Scores {
  double miou = 0, accuracy = 0;
  size_t labelled = 0;
  double coverage = 0;  // of the voxels compared, those that have a class
};

/// Voxels whose stored distance is below `within_m`, against the nearest face of the mesh.
Scores compare(const Map& map, const TriangleTree& tree, const std::vector<float>& face_class, double within_m) {
  const int k = map.classes.size();
  const std::vector<uint32_t> order = map.store.sorted();
  std::vector<std::vector<std::pair<int, int>>> pairs(order.size());  // true and mapped slot, -1: none
  tbb::parallel_for(size_t(0), order.size(), [&](size_t n) {
    const Block& block = map.store[order[n]];
    for (int i = 0; i < kBlockVoxels; ++i) {
      if (!(block.geometry->weight[i] > 0) || std::abs(block.geometry->tsdf[i]) >= within_m) continue;
      const Index3 first = first_voxel(block.coord), in = voxel_of_offset(i);
      const Eigen::Vector3d p = Eigen::Vector3d(first.x + in.x, first.y + in.y, first.z + in.z) * map.voxel_size_m;
      const TriangleTree::Nearest nearest = tree.nearest(p, 2 * map.truncation_m);
      if (nearest.triangle == TriangleTree::kNone) continue;
      const uint16_t truth = map.classes.slot_of_id(uint16_t(face_class[nearest.triangle]));
      if (truth == ClassTable::kNoSlot) continue;
      const uint16_t slot = class_belief(block, i, map.classes).slot;
      pairs[n].push_back({truth, slot == ClassTable::kNoSlot ? -1 : slot});
    }
  });
  const auto classes = size_t(k);
  std::vector<double> hit(classes), truth(classes), mapped(classes);
  Scores scores;
  size_t all = 0, right = 0;
  for (const auto& of_block : pairs)
    for (const auto& [t, m] : of_block) {
      ++all;
      if (m < 0) continue;
      ++scores.labelled;
      truth[size_t(t)] += 1, mapped[size_t(m)] += 1;
      if (t == m) hit[size_t(t)] += 1, ++right;
    }
  int present = 0;
  for (size_t c = 0; c < size_t(k); ++c) {
    if (truth[c] == 0) continue;
    scores.miou += hit[c] / (truth[c] + mapped[c] - hit[c]);
    ++present;
  }
  scores.miou /= present;
  scores.accuracy = double(right) / double(scores.labelled);
  scores.coverage = double(scores.labelled) / double(all);
  return scores;
}

}  // namespace

int main() {
  apply_simd_choice();
  const std::filesystem::path folder = bench::recorded("house_living_rendered");
  const std::vector<Frame> frames =
      bench::decoded("house_living_rendered", {.frames = {.step = 2}, .read_color = false, .read_instances = false});
  const ClassTable classes = open_sequence(folder, {.read_color = false})->info().classes;
  const TriangleMesh mesh = read_mesh(folder / "gt_mesh.ply");
  const TriangleTree tree(mesh);
  const std::vector<float>* face_class = TriangleMesh::find(mesh.triangle_scalars, "semantic");
  if (face_class == nullptr) {
    std::printf("gt_mesh.ply: no 'semantic' of its faces\n");
    return 1;
  }
  std::printf("%zu frames, truncation 4 voxels\n\n", frames.size());
  std::printf(
      "| voxel | band, voxels | mIoU of surface voxels | labelled of them | mIoU of all labelled voxels | "
      "accuracy of all | labelled voxels |\n|---|---|---|---|---|---|---|\n");
  for (const double voxel : {0.02, 0.05})
    for (const float band : {0.5f, 0.75f, 1.0f, 1.5f, 2.0f, 4.0f}) {
      Map map(voxel, 4 * voxel);
      map.classes = classes;
      IntegrationConfig config;
      config.labels.band_vox = band;
      IntegrationScratch scratch;
      for (const Frame& frame : frames) integrate(map, frame, config, scratch);
      const Scores surface = compare(map, tree, *face_class, voxel / 2),
                   all = compare(map, tree, *face_class, 4 * voxel);
      std::printf("| %g cm | %g | %.3f | %.1f %% | %.3f | %.3f | %zu |\n", 100 * voxel, double(band), surface.miou,
                  100 * surface.coverage, all.miou, all.accuracy, all.labelled);
      std::fflush(stdout);
    }
}
