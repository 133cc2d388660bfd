#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/block.h"

namespace felt {

/// The geometry of a block: two planes of 512 floats, 4 KiB, 64-byte aligned.
struct alignas(64) GeometryPlanes {
  float tsdf[kBlockVoxels];    ///< metres, positive in front of the surface; the truncation where weight is 0
  float weight[kBlockVoxels];  ///< sum of observation weights, 0: never observed

  /// Whether any voxel was observed. A block that holds nothing is not part of the map.
  bool observed() const;
};

/// Running averages of colour, in 1/256 grey levels, and the number of observations (saturating), 4 KiB.
struct alignas(64) ColorPlanes {
  uint16_t r[kBlockVoxels], g[kBlockVoxels], b[kBlockVoxels];
  uint16_t count[kBlockVoxels];  ///< 0: never coloured
};

/// One scalar per voxel of a block.
struct alignas(64) Plane {
  float value[kBlockVoxels];
};

/// Vision evidence of one class: counts *above the prior*, so that an absent plane means the prior.
struct EvidencePlane {
  uint16_t slot = 0;  ///< ClassTable slot
  Plane* counts = nullptr;
};

/// Which thing a voxel belongs to, by majority vote (Boyer and Moore 1991) over instance images, 2 KiB.
struct alignas(64) InstancePlanes {
  uint16_t id[kBlockVoxels];     ///< 0: none was seen
  uint16_t votes[kBlockVoxels];  ///< lead of that id over all others; 0 with an id: none leads
};

/// Readings of one property that cover the voxels of a block: how many, their mean, and their squared deviations from
/// it.
struct TouchPlanes {
  uint16_t property = 0;  ///< PropertyTable index
  Plane* n = nullptr;
  Plane* mean = nullptr;
  Plane* m2 = nullptr;
};

/// One 8^3 block. Planes are owned by the BlockStore; a null plane holds its background everywhere.
struct Block {
  BlockCoord coord;
  GeometryPlanes* geometry = nullptr;  ///< never null
  ColorPlanes* color = nullptr;
  std::vector<EvidencePlane> evidence;  ///< ascending slot; only classes seen in this block
  /// Evidence that all k classes share evenly: what top-m probabilities do not name (null: none). Class i has
  /// concentration prior_i + counts_i + even / k.
  Plane* even_evidence = nullptr;
  InstancePlanes* instance = nullptr;
  std::vector<TouchPlanes> touch;  ///< ascending property; only properties touched in this block

  bool has_evidence() const { return !evidence.empty() || even_evidence != nullptr; }
};

/// Owner of every plane of a map, indexed by block coordinates. Blocks keep their number (order of creation) and their
/// planes keep their address until `clear`. Topology changes (`find_or_create`, `add_*`) are serial; the values of
/// distinct blocks may be written in parallel.
class BlockStore {
public:
  static constexpr uint32_t kNone = 0xffffffff;

  explicit BlockStore(float tsdf_background_m) : background_m_(tsdf_background_m) {}
  BlockStore(BlockStore&&) = default;
  BlockStore& operator=(BlockStore&&) = default;

  size_t size() const { return blocks_.size(); }
  bool empty() const { return blocks_.empty(); }
  Block& operator[](uint32_t i) { return blocks_[i]; }
  const Block& operator[](uint32_t i) const { return blocks_[i]; }
  std::span<Block> blocks() { return blocks_; }
  std::span<const Block> blocks() const { return blocks_; }

  /// Number of the block at `coord`, or kNone.
  uint32_t find(const BlockCoord& coord) const;
  const Block* get(const BlockCoord& coord) const;
  /// The block at `coord`, created with background values where it is new.
  uint32_t find_or_create(const BlockCoord& coord);
  /// The colour planes of a block, created where absent. Not thread-safe.
  ColorPlanes& add_color(Block& block);
  /// The instance planes of a block, zeros where they are new. Thread-safe for distinct blocks.
  InstancePlanes& add_instance(Block& block);
  /// A plane of zeros that lives as long as the store. Thread-safe, so that the one task of a block can add what it
  /// needs.
  Plane* new_plane();
  /// Block numbers in ascending order of coordinates: the canonical order of every output.
  std::vector<uint32_t> sorted() const;

  float tsdf_background_m() const { return background_m_; }
  /// Heap bytes of geometry planes, block records and index (no colour, no classes).
  size_t geometry_bytes() const;
  size_t color_bytes() const { return color_.bytes(); }
  size_t instance_bytes() const { return instance_.bytes(); }
  size_t plane_bytes() const { return planes_.bytes(); }

private:
  /// Grows by chunks and never moves what it gave out.
  template <typename T>
  class Arena {
  public:
    T* allocate() {
      if (used_ == kChunk || chunks_.empty()) {
        chunks_.push_back(std::make_unique_for_overwrite<T[]>(kChunk));
        used_ = 0;
      }
      ++count_;
      return &chunks_.back()[used_++];
    }
    size_t bytes() const { return chunks_.size() * kChunk * sizeof(T); }
    size_t count() const { return count_; }

  private:
    static constexpr size_t kChunk = 16;
    std::vector<std::unique_ptr<T[]>> chunks_;
    size_t used_ = 0, count_ = 0;
  };
  struct Guard;  // a mutex that does not forbid moving the store

  void rehash(size_t slots);

  float background_m_ = 0;
  std::vector<Block> blocks_;
  std::vector<uint32_t> table_;  ///< open addressing, linear probing, at most half full
  Arena<GeometryPlanes> geometry_;
  Arena<ColorPlanes> color_;
  Arena<InstancePlanes> instance_;
  Arena<Plane> planes_;
  std::shared_ptr<Guard> planes_guard_ = make_guard();
  static std::shared_ptr<Guard> make_guard();
};

/// A voxel of a store: what a pixel shows of class and property planes.
struct VoxelRef {
  uint32_t block = BlockStore::kNone;  ///< number in the store; kNone: nothing, such as a ray that met no surface
  uint16_t offset = 0;                 ///< in the block
};

}  // namespace felt
