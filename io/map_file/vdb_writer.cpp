#include "io/map_file/vdb_writer.h"

#include <blosc.h>
#include <libdeflate.h>
#include <openvdb/io/Compression.h>
#include <openvdb/io/GridDescriptor.h>
#include <openvdb/openvdb.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <xxhash.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <new>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "io/files/atomic_file.h"
#include "io/map_file/map_trailer.h"

namespace felt {
namespace {
namespace vdb_io = openvdb::io;

constexpr int64_t kMagic = 0x56444220;
constexpr size_t kBufferBytes = size_t(1) << 18;  // small pieces are gathered before they are written
constexpr size_t kChunkLeaves = 16;               // leaves that one task encodes
constexpr size_t kGroupChunks = 16;               // chunks that are in memory at once where nothing is kept
constexpr size_t kKeptBytes = size_t(64) << 20;   // of a grid: so that compressing it twice is for large ones only
constexpr int kBloscLevel = 5, kZipLevel = 6;
constexpr int kUpperLog2 = 5, kLowerLog2 = 4;  // children along an edge of the nodes below the root and below those

template <typename T>
void append(std::string& to, const T& value) {
  to.append(reinterpret_cast<const char*>(&value), sizeof value);
}

/// 128 bits as 8-4-4-4-12 hex digits, the form of OpenVDB's file identifier.
std::string identifier(const std::string& seed) {
  const XXH128_hash_t h = XXH3_128bits(seed.data(), seed.size());
  char text[37];
  snprintf(text, sizeof text, "%08x-%04x-%04x-%04x-%012llx", unsigned(h.high64 >> 32),
           unsigned(h.high64 >> 16 & 0xffff), unsigned(h.high64 & 0xffff), unsigned(h.low64 >> 48),
           static_cast<unsigned long long>(h.low64 << 16 >> 16));
  return text;
}

uint32_t flags_of(VdbCodec codec) {
  const uint32_t flag = codec == VdbCodec::blosc ? vdb_io::COMPRESS_BLOSC
                        : codec == VdbCodec::zip ? vdb_io::COMPRESS_ZIP
                                                 : vdb_io::COMPRESS_NONE;
  return vdb_io::COMPRESS_ACTIVE_MASK | flag;
}

/// What a thread works with.
struct Scratch {
  ~Scratch() { libdeflate_free_compressor(deflate); }

  static constexpr size_t kLeafBytes = kBlockVoxels * sizeof(openvdb::Vec3s);
  alignas(64) std::array<char, kLeafBytes> values, packed, halves;
  std::vector<char> chunk;  ///< for encodings of which only the size is wanted
  libdeflate_compressor* deflate = nullptr;
};

/// Compresses `bytes` bytes to at most that many; 0 where they do not become fewer. `width`: bytes of a number.
size_t compressed(VdbCodec codec, Scratch& scratch, const char* from, size_t bytes, size_t width, char* to) {
  constexpr size_t kLeast = 48;  // a Blosc header alone is 16
  if (bytes < kLeast) return 0;
  if (codec == VdbCodec::blosc) {
    const int given = blosc_compress_ctx(kBloscLevel, BLOSC_SHUFFLE, width, bytes, from, to, bytes - 1,
                                         BLOSC_LZ4_COMPNAME, /*blocksize=*/bytes, /*numinternalthreads=*/1);
    return given > 0 ? size_t(given) : 0;
  }
  if (scratch.deflate == nullptr && (scratch.deflate = libdeflate_alloc_compressor(kZipLevel)) == nullptr)
    throw std::bad_alloc();
  return libdeflate_zlib_compress(scratch.deflate, from, bytes, to, bytes - 1);
}

/// Whether the size of values stands before them: not where none of them would be 16-bit floats.
template <typename Value>
bool has_size(VdbCodec codec, bool in_16_bits, size_t count) {
  return codec != VdbCodec::none && (count > 0 || !in_16_bits || !vdb_io::RealToHalf<Value>::isReal);
}

/// Appends values as the codec has them; returns the end.
char* put_values(VdbCodec codec, Scratch& scratch, const char* from, size_t bytes, size_t width, char* to) {
  if (codec == VdbCodec::none) {
    std::memcpy(to, from, bytes);
    return to + bytes;
  }
  const size_t fewer = compressed(codec, scratch, from, bytes, width, to + sizeof(int64_t));
  // Negative: so many bytes as they are.
  const int64_t stored = fewer > 0 ? int64_t(fewer) : -int64_t(bytes);
  std::memcpy(to, &stored, sizeof stored);
  to += sizeof stored;
  if (fewer == 0) std::memcpy(to, from, bytes);
  return to + (fewer > 0 ? fewer : bytes);
}

/// Moves the values of active voxels together. False where an inactive one is not the background, bit for bit.
template <typename Value>
bool pack(const BlockMask& active, const Value* values, const Value& background, Value* packed) {
  bool plain = true;
  for (size_t x = 0; x < active.word.size(); ++x, values += 64) {
    const uint64_t word = active.word[x];
    if (word == ~uint64_t(0)) {
      packed = std::copy_n(values, 64, packed);
      continue;
    }
    for (int i = 0; i < 64; ++i) {
      *packed = values[i];
      if (word >> i & 1)
        ++packed;
      else
        plain &= std::memcmp(&values[i], &background, sizeof(Value)) == 0;
    }
  }
  return plain;
}

/// Floats in 16 bits, whole numbers as they are; returns bytes.
template <typename Value>
size_t halve(const Value* values, size_t count, char* to) {
  using Convert = vdb_io::RealToHalf<Value>;
  using Half = typename Convert::HalfT;
  for (size_t i = 0; i < count; ++i) {
    const Half number = Convert::convert(values[i]);
    std::memcpy(to + i * sizeof(Half), &number, sizeof number);
  }
  return count * sizeof(Half);
}

/// A leaf's place among the values of a grid: mask, how inactive values are told, values. At most kMostOfLeaf bytes.
template <typename Value>
char* put_leaf(const BlockMask& active, const Value& background, VdbCodec codec, bool in_16_bits, Scratch& scratch,
               char* to) {
  const Value* values = reinterpret_cast<const Value*>(scratch.values.data());
  size_t count = size_t(active.count());
  int8_t code = vdb_io::NO_MASK_OR_INACTIVE_VALS;
  if (count < size_t(kBlockVoxels)) {
    Value* packed = reinterpret_cast<Value*>(scratch.packed.data());
    if (pack(active, values, background, packed)) {
      values = packed;
    } else {
      code = vdb_io::NO_MASK_AND_ALL_VALS;
      count = kBlockVoxels;
    }
  }
  std::memcpy(to, active.word.data(), sizeof active.word);
  to += sizeof active.word;
  *to++ = char(code);
  if (count == 0 && !has_size<Value>(codec, in_16_bits, count)) return to;
  constexpr size_t kNumber = std::is_same_v<Value, openvdb::Vec3s> ? sizeof(float) : sizeof(Value);
  if (in_16_bits && vdb_io::RealToHalf<Value>::isReal) {
    const size_t bytes = halve(values, count, scratch.halves.data());
    return put_values(codec, scratch, scratch.halves.data(), bytes, kNumber / 2, to);
  }
  return put_values(codec, scratch, reinterpret_cast<const char*>(values), count * sizeof(Value), kNumber, to);
}

template <typename Value>
constexpr size_t kMostOfLeaf = sizeof(BlockMask) + 1 + sizeof(int64_t) + kBlockVoxels * sizeof(Value);

/// Bounds and number of the active voxels of a grid, and the nodes that hold them.
struct Statistics {
  openvdb::CoordBBox bounds;
  int64_t voxels = 0, leaves = 0, lower = 0, upper = 0;

  void add(const BlockCoord& coord, const BlockMask& active) {
    uint64_t plane = 0;
    int first_x = kBlockDim, last_x = -1;
    for (int x = 0; x < kBlockDim; ++x) {
      plane |= active.word[size_t(x)];
      if (active.word[size_t(x)] != 0) first_x = std::min(first_x, x), last_x = x;
    }
    if (last_x < 0) return;
    uint64_t line = plane;
    for (const int shift : {32, 16, 8}) line |= line >> shift;
    line &= 0xff;
    const Index3 o = first_voxel(coord);
    bounds.expand(
        openvdb::CoordBBox({o.x + first_x, o.y + std::countr_zero(plane) / 8, o.z + std::countr_zero(line)},
                           {o.x + last_x, o.y + 7 - std::countl_zero(plane) / 8, o.z + 63 - std::countl_zero(line)}));
    voxels += active.count();
  }
};

/// The tree above the values. `order`: the leaves that there are, in the order of a tree.
template <typename Value>
std::string topology(const std::vector<BlockCoord>& coords, const std::vector<uint32_t>& order,
                     const std::vector<BlockMask>& masks, Value background, VdbCodec codec, bool in_16_bits,
                     Statistics& statistics) {
  constexpr int kLower = kLowerLog2, kUpper = kLowerLog2 + kUpperLog2;  // log2 of blocks along an edge
  const auto node_of = [](const BlockCoord& c, int shift) { return Index3{c.x >> shift, c.y >> shift, c.z >> shift}; };
  std::string tree;
  append(tree, int32_t(1));  // buffers
  append(tree, in_16_bits ? vdb_io::truncateRealToHalf(background) : background);
  append(tree, uint32_t(0));  // tiles
  uint32_t roots = 0;
  for (size_t i = 0; i < order.size(); ++i)
    roots += i == 0 || node_of(coords[order[i]], kUpper) != node_of(coords[order[i - 1]], kUpper);
  append(tree, roots);
  /// An inner node without children yet; returns where the mask of its children is.
  const auto add_node = [&](int log2_dim) {
    const size_t mask_bytes = (size_t(1) << 3 * log2_dim) / 8, at = tree.size();
    tree.append(2 * mask_bytes, '\0');                                    // children, active tiles
    tree.push_back(char(vdb_io::NO_MASK_OR_INACTIVE_VALS));               // the others hold the background
    if (has_size<Value>(codec, in_16_bits, 0)) append(tree, int64_t(0));  // bytes of active tiles
    return at;
  };
  const auto set_child = [&](size_t node, const Index3& child, int log2_dim) {
    const int last = (1 << log2_dim) - 1;
    const int n = ((child.x & last) << 2 * log2_dim) | ((child.y & last) << log2_dim) | (child.z & last);
    tree[node + size_t(n >> 3)] = char(tree[node + size_t(n >> 3)] | 1 << (n & 7));
  };
  size_t upper = 0, lower = 0;
  for (size_t i = 0; i < order.size(); ++i) {
    const BlockCoord& c = coords[order[i]];
    const Index3 u = node_of(c, kUpper), l = node_of(c, kLower);
    const bool new_upper = i == 0 || u != node_of(coords[order[i - 1]], kUpper);
    if (new_upper) {
      const int32_t edge = kBlockDim << kUpper;
      append(tree, std::array{u.x * edge, u.y * edge, u.z * edge});
      upper = add_node(kUpperLog2);
      ++statistics.upper;
    }
    if (new_upper || l != node_of(coords[order[i - 1]], kLower)) {
      set_child(upper, l, kUpperLog2);
      // Children of one node of the upper kind follow one another, each with all of its own.
      lower = add_node(kLowerLog2);
      ++statistics.lower;
    }
    set_child(lower, c, kLowerLog2);
    const BlockMask& active = masks[order[i]];
    append(tree, active.word);
    statistics.add(c, active);
  }
  statistics.leaves = int64_t(order.size());
  return tree;
}

/// Bytes of the tree in memory.
template <typename Tree>
int64_t tree_bytes(const Statistics& statistics, size_t leaf_bytes) {
  using Upper = typename Tree::RootNodeType::ChildNodeType;
  return statistics.upper * int64_t(sizeof(Upper)) + statistics.lower * int64_t(sizeof(typename Upper::ChildNodeType)) +
         statistics.leaves * int64_t(sizeof(typename Tree::LeafNodeType) + leaf_bytes);
}

}  // namespace

struct VdbWriter::State {
  State(const std::filesystem::path& path, MapTrailer* trailer_) : file(path), trailer(trailer_) {
    buffer.reserve(kBufferBytes);
  }

  void put(const char* data, size_t bytes) {
    at += bytes;
    if (trailer != nullptr) trailer->add(data, bytes);
    if (buffer.size() + bytes > kBufferBytes) flush();
    if (bytes >= kBufferBytes)
      file.write(data, bytes);
    else
      buffer.append(data, bytes);
  }
  void put(const std::string& bytes) { put(bytes.data(), bytes.size()); }
  void flush() {
    file.write(buffer);
    buffer.clear();
  }

  /// Everything of a grid before its values, of which there are `value_bytes`.
  void put_head(const LeafGrid& grid, const std::string& tree, const Statistics& statistics, int64_t memory_bytes,
                uint64_t value_bytes, VdbCodec codec, bool in_16_bits) {
    const openvdb::GridBase::Ptr stock = stock_grid_without_leaves(grid);
    if (in_16_bits) stock->setSaveFloatAsHalf(true);
    stock->insertMeta(openvdb::GridBase::META_FILE_BBOX_MIN, openvdb::Vec3IMetadata(statistics.bounds.min().asVec3i()));
    stock->insertMeta(openvdb::GridBase::META_FILE_BBOX_MAX, openvdb::Vec3IMetadata(statistics.bounds.max().asVec3i()));
    stock->insertMeta(openvdb::GridBase::META_FILE_MEM_BYTES, openvdb::Int64Metadata(memory_bytes));
    stock->insertMeta(openvdb::GridBase::META_FILE_VOXEL_COUNT, openvdb::Int64Metadata(statistics.voxels));
    std::ostringstream name, head;
    vdb_io::GridDescriptor(grid.name, stock->type(), in_16_bits).writeHeader(name);
    const uint32_t flags = flags_of(codec);
    head.write(reinterpret_cast<const char*>(&flags), sizeof flags);
    stock->writeMeta(head);
    stock->writeTransform(head);
    put(name.str());
    const int64_t head_at = int64_t(at + 3 * sizeof(int64_t)),
                  values_at = head_at + int64_t(head.str().size() + tree.size());
    std::string places;
    for (const int64_t place : {head_at, values_at, values_at + int64_t(value_bytes)}) append(places, place);
    put(places);
    put(head.str());
    put(tree);
  }

  template <typename Value>
  void write(const LeafGrid& grid, const Leaves<Value>& leaves, VdbCodec codec, bool in_16_bits);
  void write(const LeafGrid& grid, const Region& region, VdbCodec codec, bool in_16_bits);

  AtomicFile file;
  MapTrailer* trailer;
  std::string buffer;
  uint64_t at = 0;
  std::vector<std::vector<char>> chunks;  ///< memory that grids take one after the other
  tbb::enumerable_thread_specific<Scratch> scratch;
};

template <typename Value>
void VdbWriter::State::write(const LeafGrid& grid, const Leaves<Value>& leaves, VdbCodec codec, bool in_16_bits) {
  const std::vector<BlockCoord>& coords = *leaves.coords;
  std::vector<uint32_t> order(coords.size());
  for (uint32_t i = 0; i < order.size(); ++i) order[i] = i;
  if (!std::is_sorted(coords.begin(), coords.end(), before_in_tree))
    std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) { return before_in_tree(coords[a], coords[b]); });
  std::vector<BlockMask> masks(coords.size());
  constexpr size_t kChunkBytes = kChunkLeaves * kMostOfLeaf<Value>;
  const size_t count = (order.size() + kChunkLeaves - 1) / kChunkLeaves;
  // Encodes a chunk and returns how many bytes it is.
  const auto encode = [&](size_t chunk, std::vector<char>* to) {
    Scratch& mine = scratch.local();
    std::vector<char>& out = to != nullptr ? *to : mine.chunk;
    if (out.size() < kChunkBytes) out.resize(kChunkBytes);
    char* end = out.data();
    for (size_t i = chunk * kChunkLeaves; i < std::min(order.size(), (chunk + 1) * kChunkLeaves); ++i) {
      BlockMask& active = masks[order[i]];
      active = leaves.fill(order[i], reinterpret_cast<Value*>(mine.values.data()));
      if (leaves.keeps_empty || active.any()) end = put_leaf(active, leaves.background, codec, in_16_bits, mine, end);
    }
    return size_t(end - out.data());
  };
  // Where values begin and end stands before them. What is not compressed is made twice rather than kept: copying a
  // leaf that is in the cache is faster than memory that is not.
  const size_t kept = codec == VdbCodec::none ? 0 : std::min(count, kKeptBytes / kChunkBytes);
  chunks.resize(std::max({chunks.size(), kept, std::min(count, kGroupChunks)}));
  std::vector<size_t> bytes(count);
  tbb::parallel_for(size_t(0), count, [&](size_t c) { bytes[c] = encode(c, c < kept ? &chunks[c] : nullptr); });
  // Chunks are cut from all leaves, also those that turn out empty.
  std::vector<uint32_t> present = order;
  if (!leaves.keeps_empty) std::erase_if(present, [&](uint32_t i) { return !masks[i].any(); });
  Statistics statistics;
  const std::string tree = topology(coords, present, masks, leaves.background, codec, in_16_bits, statistics);
  uint64_t value_bytes = 0;
  for (const size_t n : bytes) value_bytes += n;
  put_head(grid, tree, statistics,
           tree_bytes<typename StockGrid<Value>::type::TreeType>(statistics, kBlockVoxels * sizeof(Value)), value_bytes,
           codec, in_16_bits);
  for (size_t c = 0; c < kept; ++c) put(chunks[c].data(), bytes[c]);
  for (size_t first = kept; first < count; first += kGroupChunks) {
    const size_t group = std::min(kGroupChunks, count - first);
    tbb::parallel_for(size_t(0), group, [&](size_t g) {
      if (encode(first + g, &chunks[g]) != bytes[first + g])
        throw std::logic_error("grid '" + grid.name + "' has other values each time");
    });
    for (size_t g = 0; g < group; ++g) put(chunks[g].data(), bytes[first + g]);
  }
}

void VdbWriter::State::write(const LeafGrid& grid, const Region& region, VdbCodec codec, bool in_16_bits) {
  std::vector<uint32_t> order(region.blocks());
  for (uint32_t i = 0; i < order.size(); ++i) order[i] = i;
  std::sort(order.begin(), order.end(),
            [&](uint32_t a, uint32_t b) { return before_in_tree(region.coord[a], region.coord[b]); });
  Statistics statistics;
  const std::string tree = topology(region.coord, order, region.mask, false, codec, in_16_bits, statistics);
  std::string values;
  for (const uint32_t i : order) {
    const Index3 o = first_voxel(region.coord[i]);
    append(values, region.mask[i].word);
    append(values, std::array{o.x, o.y, o.z});
  }
  put_head(grid, tree, statistics, tree_bytes<openvdb::MaskTree>(statistics, 0), values.size(), codec, in_16_bits);
  put(values);
}

VdbWriter::VdbWriter(const std::filesystem::path& path, MapTrailer* trailer)
    : state_(std::make_unique<State>(path, trailer)) {}
VdbWriter::~VdbWriter() = default;

void VdbWriter::begin(const openvdb::MetaMap& metadata, size_t grids, const std::string& seed) {
  openvdb::initialize();
  std::string head;
  append(head, kMagic);
  append(head, uint32_t(openvdb::OPENVDB_FILE_VERSION));
  append(head, uint32_t(openvdb::OPENVDB_LIBRARY_MAJOR_VERSION));
  append(head, uint32_t(openvdb::OPENVDB_LIBRARY_MINOR_VERSION));
  append(head, char(1));  // with the places of grids
  std::ostringstream entries;
  metadata.writeMeta(entries);
  head += identifier(seed) + entries.str();
  append(head, int32_t(grids));
  state_->put(head);
}

void VdbWriter::write(const LeafGrid& grid, VdbCodec codec, bool in_16_bits) {
  std::visit([&](const auto& leaves) { state_->write(grid, leaves, codec, in_16_bits); }, grid.leaves);
}

void VdbWriter::commit(const std::string& tail) {
  state_->put(tail);
  state_->flush();
  state_->file.commit();
}

}  // namespace felt
