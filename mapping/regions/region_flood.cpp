#include "mapping/regions/region_flood.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <functional>
#include <limits>
#include <queue>
#include <vector>

namespace felt {
namespace {

/// Flood of one region: block by block, each from the bits that reached it.
class Flood {
public:
  Flood(const Map& map, const SurfaceRule& rule) : map_(map), rule_(rule), number_(map.store.size(), kUnknown) {}

  /// Grows from the contact's voxel; returns store numbers of the blocks with a region.
  Region run(const Index3& seed) {
    plant(seed);
    while (!wave_.empty()) {
      examine_wave();
      std::vector<uint32_t> current;
      current.swap(wave_);
      for (const uint32_t n : current) visit(n);
    }
    end_on_planes();
    return collect();
  }

private:
  static constexpr uint32_t kUnknown = 0xffffffff;
  struct State {
    uint32_t block;  ///< store number
    bool examined = false, queued = false;
    std::array<uint32_t, 27> near;   ///< store numbers of the block's neighbours once it was examined
    BlockMask pending;               ///< bits that reached the block since its last visit
    BlockMask reached, grown, open;  ///< candidates that were reached; grown through; the candidates that were not
    BlockMask region;
    BlockSurface surface;
  };

  State& state_of(uint32_t block) {
    if (number_[block] == kUnknown) {
      number_[block] = uint32_t(state_.size());
      state_.emplace_back().block = block;
    }
    return state_[number_[block]];
  }

  void reach(uint32_t block, const BlockMask& bits) {
    State& state = state_of(block);
    const BlockMask fresh = bits - state.reached;
    // Once the block was examined, bits that are no candidates need no visit.
    if (!(state.examined ? fresh & state.surface.candidate : fresh).any()) return;
    state.pending |= fresh;
    if (state.queued) return;
    state.queued = true;
    wave_.push_back(number_[block]);
  }

  /// The contact's voxel and those neighbours whose normals agree with its own: a contact beside a crease is no
  /// interior voxel, but it belongs to the surface that it lies on.
  void plant(const Index3& seed) {
    const Eigen::Vector3f normal = surface_normal(map_, seed, rule_.min_weight);
    for (int dx = -1; dx <= 1; ++dx)
      for (int dy = -1; dy <= 1; ++dy)
        for (int dz = -1; dz <= 1; ++dz) {
          const Index3 v{seed.x + dx, seed.y + dy, seed.z + dz};
          const uint32_t block = map_.store.find(block_of_voxel(v));
          if (block == BlockStore::kNone) continue;
          if (!(v == seed) && surface_normal(map_, v, rule_.min_weight).dot(normal) < rule_.cos_normal_change) continue;
          BlockMask bit;
          bit.set(offset_in_block(v));
          state_of(block).region |= bit;
          reach(block, bit);
        }
  }

  void examine_wave() {
    std::vector<uint32_t> fresh;
    for (const uint32_t n : wave_)
      if (!state_[n].examined) fresh.push_back(n);
    const auto examine = [&](size_t i) {
      State& state = state_[fresh[i]];
      const BlockCoord c = map_.store[state.block].coord;
      BlockNeighbours near;
      for (int n = 0; n < 27; ++n) {
        const uint32_t number =
            n == 13 ? state.block : map_.store.find({c.x + n / 9 - 1, c.y + n / 3 % 3 - 1, c.z + n % 3 - 1});
        state.near[size_t(n)] = number;
        near[size_t(n)] = number == BlockStore::kNone ? nullptr : &map_.store[number];
      }
      state.surface = examine_block(near, rule_);
      state.examined = true;
    };
    if (fresh.size() < 16) {
      for (size_t i = 0; i < fresh.size(); ++i) examine(i);
    } else {
      tbb::parallel_for(size_t(0), fresh.size(), examine);
    }
  }

  void visit(uint32_t n) {
    State& state = state_[n];
    state.queued = false;
    state.reached |= state.pending & state.surface.candidate;
    BlockMask grown = (state.pending & state.surface.interior) - state.grown;
    state.pending = {};
    if (!grown.any()) return;
    for (BlockMask last; !(last == grown);) {
      last = grown;
      grown |= dilated_inside(grown) & state.surface.interior;
    }
    grown -= state.grown;
    state.grown |= grown;
    const std::array<BlockMask, 27> reached = dilated(grown);
    state.reached |= reached[13] & state.surface.candidate;
    for (size_t i = 0; i < reached.size(); ++i)
      if (i != 13 && state.near[i] != BlockStore::kNone && reached[i].any()) reach(state.near[i], reached[i]);
  }

  /// Adds what the region grew through and the candidates around that lie on its planes.
  void end_on_planes() {
    std::vector<uint32_t> grown;
    for (uint32_t n = 0; n < state_.size(); ++n) {
      State& state = state_[n];
      state.region &= state.surface.candidate;  // the contact and what is beside it
      state.region |= state.grown;
      if (state.grown.any()) grown.push_back(n);
    }
    // Blocks that no voxel reached may hold some that end the region.
    for (const uint32_t n : grown)
      for (size_t i = 0; i < 27; ++i)
        if (const uint32_t block = state_[n].near[i]; block != BlockStore::kNone && number_[block] == kUnknown)
          if (lies_near(state_[n].grown, int(i)))
            state_of(block).surface.candidate = candidates(map_.store[block], rule_);
    for (State& state : state_) state.open = state.surface.candidate - state.grown;
    std::vector<std::vector<std::pair<uint32_t, BlockMask>>> joined(grown.size());
    const auto end = [&](size_t g) {
      const State& state = state_[grown[g]];
      BlockNeighbours near{};
      std::array<const BlockMask*, 27> open{};
      bool any = false;
      for (size_t i = 0; i < 27; ++i) {
        if (state.near[i] == BlockStore::kNone) continue;
        near[i] = &map_.store[state.near[i]];
        if (number_[state.near[i]] == kUnknown || !state_[number_[state.near[i]]].open.any()) continue;
        open[i] = &state_[number_[state.near[i]]].open;
        any = true;
      }
      if (!any) return;
      const std::array<BlockMask, 27> found = on_planes_of(near, state.grown, open, rule_);
      for (size_t i = 0; i < 27; ++i)
        if (found[i].any()) joined[g].emplace_back(number_[state.near[i]], found[i]);
    };
    if (grown.size() < 16) {
      for (size_t g = 0; g < grown.size(); ++g) end(g);
    } else {
      tbb::parallel_for(size_t(0), grown.size(), end);
    }
    for (const auto& some : joined)
      for (const auto& [n, bits] : some) state_[n].region |= bits;
  }

  /// Whether a bit of the mask lies within kCollar voxels of the neighbour block at offset i (as in BlockNeighbours).
  static bool lies_near(const BlockMask& mask, int i) {
    const auto end = [](int step, uint64_t low, uint64_t high) {
      return step < 0 ? low : step > 0 ? high : ~uint64_t(0);
    };
    constexpr uint64_t kLowZ = 0x0303030303030303, kHighZ = 0xc0c0c0c0c0c0c0c0, kLowY = 0xffff,
                       kHighY = 0xffff000000000000;
    static_assert(kCollar == 2);
    const int dx = i / 9 - 1;
    const uint64_t side = end(i / 3 % 3 - 1, kLowY, kHighY) & end(i % 3 - 1, kLowZ, kHighZ);
    uint64_t any = 0;
    for (int x = dx > 0 ? 6 : 0; x < (dx < 0 ? 2 : 8); ++x) any |= mask.word[size_t(x)];
    return (any & side) != 0;
  }

  Region collect() const {
    std::vector<const State*> found;
    for (const State& state : state_)
      if (state.region.any()) found.push_back(&state);
    const auto coord = [&](const State* state) { return map_.store[state->block].coord; };
    std::sort(found.begin(), found.end(), [&](const State* a, const State* b) { return coord(a) < coord(b); });
    Region region;
    for (const State* state : found) region.append(coord(state), state->region);
    return region;
  }

  const Map& map_;
  const SurfaceRule rule_;
  std::vector<uint32_t> number_;  ///< by store number: index of its state
  std::deque<State> state_;       ///< never moved
  std::vector<uint32_t> wave_;
};

}  // namespace

Region flood_region(const Map& map, const SurfaceRule& rule, const Index3& seed) { return Flood(map, rule).run(seed); }

Region within_geodesic(const Region& region, const Index3& seed, double radius_voxels) {
  struct Reach {
    float distance;
    Index3 voxel;
    bool operator>(const Reach& o) const { return distance > o.distance; }
  };
  std::vector<std::array<float, kBlockVoxels>> distance(region.blocks());
  for (auto& d : distance) d.fill(std::numeric_limits<float>::infinity());
  const auto slot_of = [&](const Index3& v) -> float* {
    const BlockMask* bits = region.find(block_of_voxel(v));
    if (bits == nullptr || !bits->test(offset_in_block(v))) return nullptr;
    return &distance[size_t(bits - region.mask.data())][size_t(offset_in_block(v))];
  };
  std::priority_queue<Reach, std::vector<Reach>, std::greater<>> queue;
  *slot_of(seed) = 0;
  queue.push({0, seed});
  while (!queue.empty()) {
    const Reach r = queue.top();
    queue.pop();
    if (r.distance > *slot_of(r.voxel)) continue;
    for (int dx = -1; dx <= 1; ++dx)
      for (int dy = -1; dy <= 1; ++dy)
        for (int dz = -1; dz <= 1; ++dz) {
          const Index3 v{r.voxel.x + dx, r.voxel.y + dy, r.voxel.z + dz};
          float* known = slot_of(v);
          const float d = r.distance + std::sqrt(float(dx * dx + dy * dy + dz * dz));
          if (known == nullptr || d > radius_voxels || d >= *known) continue;
          *known = d;
          queue.push({d, v});
        }
  }
  Region near;
  for (size_t b = 0; b < region.blocks(); ++b) {
    BlockMask bits;
    for_each_bit(region.mask[b], [&](int i) {
      if (distance[b][size_t(i)] <= radius_voxels) bits.set(i);
    });
    if (bits.any()) near.append(region.coord[b], bits);
  }
  return near;
}

}  // namespace felt
