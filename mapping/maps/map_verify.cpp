#include "mapping/maps/map_verify.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <map>
#include <string>

#include "mapping/touch/touch_state.h"

namespace felt {
namespace {

/// Counts by grid and invariant, in the order in which they are first broken.
class Faults {
public:
  void add(const std::string& grid, const char* broken, const BlockCoord& block, int offset) {
    const auto [at, fresh] = index_.try_emplace({grid, broken}, faults_.size());
    if (fresh) faults_.push_back({grid, broken, 0, voxel_at(block, offset)});
    ++faults_[at->second].voxels;
  }
  std::vector<MapFault> take() { return std::move(faults_); }

private:
  std::vector<MapFault> faults_;
  std::map<std::pair<std::string, std::string>, size_t> index_;
};

/// Averages of values at the truncation may round beyond it, a little with each of up to max_weight observations.
constexpr float kRounding = 1.0001f;

void verify_geometry(const Block& block, float truncation_m, Faults& faults) {
  for (int i = 0; i < kBlockVoxels; ++i) {
    const float t = block.geometry->tsdf[i], w = block.geometry->weight[i];
    if (!std::isfinite(w) || w < 0) faults.add("weight", "weight is finite and >= 0", block.coord, i);
    if (!std::isfinite(t)) faults.add("tsdf", "distance is finite", block.coord, i);
    if (std::fabs(t) > truncation_m * kRounding) faults.add("tsdf", "|distance| <= truncation", block.coord, i);
    if (w == 0 && t != truncation_m)
      faults.add("tsdf", "distance is the truncation where nothing was observed", block.coord, i);
  }
}

void verify_color(const Block& block, Faults& faults) {
  if (block.color == nullptr) return;
  for (int i = 0; i < kBlockVoxels; ++i) {
    const bool colored = (block.color->r[i] | block.color->g[i] | block.color->b[i]) != 0;
    if (block.color->count[i] == 0 && colored)
      faults.add("color", "colour is 0 where it was not observed", block.coord, i);
    if (std::max({block.color->r[i], block.color->g[i], block.color->b[i]}) > 255 * 256)
      faults.add("color", "colour <= 255 grey levels", block.coord, i);
  }
}

void verify_counts(const Plane& counts, const std::string& name, const Block& block, Faults& faults) {
  for (int i = 0; i < kBlockVoxels; ++i) {
    const float e = counts.value[i];
    if (!std::isfinite(e) || e < 0) faults.add(name, "evidence is finite and >= 0", block.coord, i);
    if (e != 0 && !(block.geometry->weight[i] > 0))
      faults.add(name, "evidence only where the surface was observed", block.coord, i);
  }
}

void verify_instances(const Block& block, Faults& faults) {
  if (block.instance == nullptr) return;
  for (int i = 0; i < kBlockVoxels; ++i)
    if (block.instance->id[i] == 0 && block.instance->votes[i] != 0)
      faults.add("instance", "votes only where there is an instance", block.coord, i);
}

void verify_evidence(const Map& map, const Block& block, Faults& faults) {
  int before = -1;
  for (const EvidencePlane& plane : block.evidence) {
    if (plane.slot >= map.classes.size()) {
      faults.add("evidence", "every plane has a class in the table", block.coord, 0);
      continue;
    }
    const std::string name = "evidence/" + map.classes.at_slot(plane.slot).name;
    if (plane.slot <= before) faults.add(name, "planes in ascending order of classes", block.coord, 0);
    before = plane.slot;
    verify_counts(*plane.counts, name, block, faults);
  }
  if (block.even_evidence != nullptr) verify_counts(*block.even_evidence, "evidence_even", block, faults);
}

void verify_touch_planes(const Map& map, const Block& block, Faults& faults) {
  for (const TouchPlanes& planes : block.touch) {
    if (planes.property >= map.properties.size()) {
      faults.add("touch", "every plane has a property in the table", block.coord, 0);
      continue;
    }
    const std::string prefix = "touch/" + map.properties[planes.property].name + "/";
    for (int i = 0; i < kBlockVoxels; ++i) {
      const float n = planes.n->value[i], mean = planes.mean->value[i], m2 = planes.m2->value[i];
      if (!std::isfinite(n) || n < 0) faults.add(prefix + "n", "number of readings is finite and >= 0", block.coord, i);
      if (!std::isfinite(mean)) faults.add(prefix + "mean", "mean is finite", block.coord, i);
      if (!std::isfinite(m2) || m2 < 0)
        faults.add(prefix + "m2", "squared deviation is finite and >= 0", block.coord, i);
    }
  }
}

void verify_regions(const Map& map, Faults& faults) {
  for (const Touch& touch : map.touches.touches) {
    const std::string grid = "touch_region/" + id_text(touch.id);
    if (touch.region.empty())
      faults.add(grid, "a touch has a region", block_of_voxel(touch.voxel), offset_in_block(touch.voxel));
    for (size_t b = 0; b < touch.region.blocks(); ++b) {
      const BlockCoord& coord = touch.region.coord[b];
      const Block* block = map.store.get(coord);
      for_each_bit(touch.region.mask[b], [&](int i) {
        if (block == nullptr || !(block->geometry->weight[i] > 0))
          faults.add(grid, "a region holds observed voxels only", coord, i);
      });
    }
  }
}

/// What the journal and the counts say of touched voxels must be a belief: alpha, kappa, beta, gamma > 0.
void verify_beliefs(const Map& map, Faults& faults) {
  const auto positive = [](double x) { return std::isfinite(x) && x > 0; };
  Beliefs beliefs(map);
  for (const TouchGroup& group : touch_groups(map))
    for (size_t b = 0; b < group.region.blocks(); ++b)
      for_each_bit(group.region.mask[b], [&](int i) {
        const BlockCoord& coord = group.region.coord[b];
        try {
          const Belief belief = beliefs.at(voxel_at(coord, i));
          for (const double alpha : belief.concentration)
            if (!positive(alpha)) faults.add("alpha", "alpha is finite and > 0", coord, i);
          for (size_t p = 0; p < belief.nig.size(); ++p)
            for (const Nig& nig : belief.nig[p]) {
              const std::string grid = "property/" + map.properties[int(p)].name;
              if (nig.kappa == 0) continue;  // a class without a prior
              if (!positive(nig.kappa) || !positive(nig.beta) || !positive(nig.gamma) || !std::isfinite(nig.tau))
                faults.add(grid, "tau is finite, and kappa, beta and gamma are finite and > 0", coord, i);
            }
        } catch (const std::exception&) {  // of evidence or readings that are broken themselves
          faults.add("touched", "a belief follows from priors, evidence and touches", coord, i);
        }
      });
}

}  // namespace

std::vector<MapFault> verify(const Map& map) {
  Faults faults;
  for (const uint32_t number : map.store.sorted()) {
    const Block& block = map.store[number];
    verify_geometry(block, float(map.truncation_m), faults);
    verify_color(block, faults);
    verify_evidence(map, block, faults);
    verify_instances(block, faults);
    verify_touch_planes(map, block, faults);
  }
  verify_regions(map, faults);
  if (map.touches.any_active()) verify_beliefs(map, faults);
  return faults.take();
}

}  // namespace felt
