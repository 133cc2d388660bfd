#include "mapping/store/block_store.h"

#include <algorithm>
#include <cstring>
#include <mutex>
#include <numeric>

namespace felt {
namespace {

/// A chunk gives out one plane after the other: the one that comes next travels meanwhile.
template <typename T>
[[gnu::always_inline]] inline void prefetch_next(const T* given) {  // see prefetch in tsdf_integrator.cpp
  const auto* next = reinterpret_cast<const char*>(given + 1);
  for (size_t line = 0; line < sizeof(T); line += 64) __builtin_prefetch(next + line, 1, 2);
}

}  // namespace

struct BlockStore::Guard {
  std::mutex mutex;
};

bool GeometryPlanes::observed() const {
  return std::any_of(std::begin(weight), std::end(weight), [](float w) { return w > 0; });
}

std::shared_ptr<BlockStore::Guard> BlockStore::make_guard() { return std::make_shared<Guard>(); }

uint32_t BlockStore::find(const BlockCoord& coord) const {
  if (table_.empty()) return kNone;
  const size_t mask = table_.size() - 1;
  for (size_t slot = std::hash<BlockCoord>{}(coord)&mask;; slot = (slot + 1) & mask) {
    const uint32_t i = table_[slot];
    if (i == kNone || blocks_[i].coord == coord) return i;
  }
}

const Block* BlockStore::get(const BlockCoord& coord) const {
  const uint32_t i = find(coord);
  return i == kNone ? nullptr : &blocks_[i];
}

void BlockStore::rehash(size_t slots) {
  table_.assign(slots, kNone);
  for (uint32_t i = 0; i < blocks_.size(); ++i) {
    size_t slot = std::hash<BlockCoord>{}(blocks_[i].coord) & (slots - 1);
    while (table_[slot] != kNone) slot = (slot + 1) & (slots - 1);
    table_[slot] = i;
  }
}

uint32_t BlockStore::find_or_create(const BlockCoord& coord) {
  if (const uint32_t i = find(coord); i != kNone) return i;
  Block& block = blocks_.emplace_back();
  block.coord = coord;
  block.geometry = geometry_.allocate();
  std::fill_n(block.geometry->tsdf, kBlockVoxels, background_m_);
  std::fill_n(block.geometry->weight, kBlockVoxels, 0.0f);
  prefetch_next(block.geometry);
  const auto number = uint32_t(blocks_.size() - 1);
  if (2 * blocks_.size() > table_.size()) {
    rehash(std::max<size_t>(256, 2 * table_.size()));
  } else {
    size_t slot = std::hash<BlockCoord>{}(coord) & (table_.size() - 1);
    while (table_[slot] != kNone) slot = (slot + 1) & (table_.size() - 1);
    table_[slot] = number;
  }
  return number;
}

ColorPlanes& BlockStore::add_color(Block& block) {
  if (block.color == nullptr) {
    block.color = color_.allocate();
    std::memset(block.color, 0, sizeof(ColorPlanes));
  }
  return *block.color;
}

InstancePlanes& BlockStore::add_instance(Block& block) {
  if (block.instance == nullptr) {
    {
      const std::lock_guard lock(planes_guard_->mutex);
      block.instance = instance_.allocate();
    }
    std::memset(block.instance, 0, sizeof(InstancePlanes));
  }
  return *block.instance;
}

Plane* BlockStore::new_plane() {
  Plane* plane;
  {
    const std::lock_guard lock(planes_guard_->mutex);
    plane = planes_.allocate();
  }
  std::memset(plane, 0, sizeof(Plane));
  prefetch_next(plane);
  return plane;
}

std::vector<uint32_t> BlockStore::sorted() const {
  std::vector<uint32_t> order(blocks_.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) { return blocks_[a].coord < blocks_[b].coord; });
  return order;
}

size_t BlockStore::geometry_bytes() const {
  return geometry_.bytes() + blocks_.capacity() * sizeof(Block) + table_.capacity() * sizeof(uint32_t);
}

}  // namespace felt
