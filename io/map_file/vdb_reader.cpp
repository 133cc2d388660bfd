#include "io/map_file/vdb_reader.h"

#include <blosc.h>
#include <libdeflate.h>
#include <openvdb/io/Compression.h>
#include <openvdb/openvdb.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <sstream>
#include <type_traits>

#include "core/error.h"

namespace felt {
namespace {

constexpr int64_t kMagic = 0x56444220;
constexpr uint32_t kFileVersion = 224;
constexpr size_t kIdentifierBytes = 36;

std::string text_of(double number) {
  std::ostringstream text;
  text.precision(10);
  text << number;
  return text.str();
}

/// Bytes of a file one after the other, never beyond its end.
class Bytes {
public:
  Bytes(const OpenedFile& file, uint64_t from, uint64_t end, std::string where)
      : file_(file),
        where_(std::move(where)),
        at_(from),
        end_(end),
        buffer_(std::min<uint64_t>(end - from, kBufferBytes)) {}

  uint64_t at() const { return at_; }
  uint64_t left() const { return end_ - at_; }

  /// The next `n` bytes; valid until the next call. Small pieces come out of a buffer, large ones make it grow, but
  /// never beyond what the file holds.
  const char* take(uint64_t n, const char* what) {
    require(n, what);
    if (at_ < buffered_from_ || at_ + n > buffered_from_ + buffered_) refill(n);
    const char* bytes = buffer_.data() + (at_ - buffered_from_);
    at_ += n;
    return bytes;
  }
  template <typename T>
  T value(const char* what) {
    T result;
    std::memcpy(&result, take(sizeof(T), what), sizeof(T));
    return result;
  }
  std::string text(const char* what) {
    const auto n = value<uint32_t>(what);
    return {take(n, what), n};
  }
  void skip(uint64_t n, const char* what) {
    require(n, what);
    at_ += n;
  }
  [[noreturn]] void fail(const char* what, const std::string& expected, const std::string& found) const {
    throw FormatError(describe_mismatch(where_ + ": byte " + std::to_string(at_), what, expected, found));
  }

private:
  static constexpr size_t kBufferBytes = size_t(1) << 18;

  void require(uint64_t n, const char* what) const {
    if (n > left()) fail(what, std::to_string(n) + " bytes", std::to_string(left()) + " before the end");
  }
  void refill(uint64_t n) {
    if (n > buffer_.size()) buffer_.resize(size_t(n));
    buffered_from_ = at_;
    buffered_ = size_t(std::min<uint64_t>(buffer_.size(), left()));
    file_.read(buffer_.data(), buffered_, at_);
  }

  const OpenedFile& file_;
  std::string where_;
  uint64_t at_, end_, buffered_from_ = 0;
  size_t buffered_ = 0;
  std::vector<char> buffer_;
};

openvdb::MetaMap read_meta_map(Bytes& in) {
  openvdb::MetaMap metadata;
  for (auto left = in.value<uint32_t>("number of metadata entries"); left > 0; --left) {
    const std::string name = in.text("name of a metadata entry"), type = in.text("type of a metadata entry");
    if (name.empty()) in.fail("metadata entry", "a name", "none");
    if (metadata[name] != nullptr) in.fail("metadata entry", "each name once", "'" + name + "' twice");
    const auto size = in.value<uint32_t>("size of a metadata entry");
    const char* bytes = in.take(size, "metadata entry");
    if (type == "string") {
      metadata.insertMeta(name, openvdb::StringMetadata(std::string(bytes, size)));
    } else if (type == "int32" && size == sizeof(int32_t)) {
      int32_t number;
      std::memcpy(&number, bytes, sizeof number);
      metadata.insertMeta(name, openvdb::Int32Metadata(number));
    } else if (type == "double" && size == sizeof(double)) {
      double number;
      std::memcpy(&number, bytes, sizeof number);
      metadata.insertMeta(name, openvdb::DoubleMetadata(number));
    }
  }
  return metadata;
}

/// Moves over a grid's head to its tree.
void read_grid_head(Bytes& in, VdbGridEntry& entry) {
  entry.name = in.text("name of a grid");
  entry.type = in.text("type of a grid");
  if (!in.text("instance of a grid").empty()) in.fail("grid", "a tree of its own", "another grid's");
  in.skip(2 * sizeof(int64_t), "place of a grid");
  const auto end = in.value<int64_t>("end of a grid");
  entry.compression = in.value<uint32_t>("compression of a grid");
  read_meta_map(in);
  if (const std::string map = in.text("transform of a grid"); map != "UniformScaleMap")
    in.fail("transform of a grid", "UniformScaleMap", map);
  entry.transform = in.value<decltype(entry.transform)>("transform of a grid");
  entry.tree_at = in.at();
  if (end < 0 || uint64_t(end) < in.at() || uint64_t(end) - in.at() > in.left())
    in.fail("end of a grid", "a place behind its head", std::to_string(end));
  entry.end = uint64_t(end);
}

/// Decodes the values of tree nodes.
class NodeValues {
public:
  NodeValues(Bytes& in, uint32_t compression)
      : in_(in), compression_(compression), inflate_(libdeflate_alloc_decompressor()) {
    if (inflate_ == nullptr) throw std::bad_alloc();
  }
  ~NodeValues() { libdeflate_free_decompressor(inflate_); }
  NodeValues(const NodeValues&) = delete;
  NodeValues& operator=(const NodeValues&) = delete;

  /// The 512 values of a leaf.
  template <typename Value>
  void leaf(const BlockMask& active, const Value& background, Value* out) {
    const Layout<Value> layout = head<Value>(kBlockVoxels, background);
    const size_t count = layout.all ? kBlockVoxels : size_t(active.count());
    Value* const packed = count == kBlockVoxels ? out : reinterpret_cast<Value*>(packed_.data());
    data(packed, count * sizeof(Value));
    if (count == kBlockVoxels) return;
    size_t next = 0;
    for (int i = 0; i < kBlockVoxels; ++i)
      out[i] =
          active.test(i) ? packed[next++] : layout.inactive[size_t(layout.selection[size_t(i >> 3)] >> (i & 7) & 1)];
  }

  /// Moves over the values of an inner node without active values.
  template <typename Value>
  void skip_inner(size_t count) {
    const Layout<Value> layout = head<Value>(count, openvdb::zeroVal<Value>());
    const uint64_t bytes = layout.all ? count * sizeof(Value) : 0;
    if ((compression_ & (openvdb::io::COMPRESS_BLOSC | openvdb::io::COMPRESS_ZIP)) == 0) {
      in_.skip(bytes, "values of a node");
    } else {
      const auto stored = in_.value<int64_t>("size of values");
      in_.skip(stored < 0 ? -uint64_t(stored) : uint64_t(stored), "values of a node");
    }
  }

private:
  template <typename Value>
  struct Layout {
    std::array<Value, 2> inactive;
    bool all = true;                                 ///< every value is stored, not only active ones
    std::array<char, kBlockVoxels / 8> selection{};  ///< of leaves: which of the two an inactive value is
  };

  template <typename Value>
  static Value negative(const Value& v) {
    if constexpr (std::is_integral_v<Value>)
      return Value(0u - uint32_t(v));  // the least integer has no opposite
    else
      return Value(-v);
  }

  /// What stands before the values: how inactive ones are told.
  template <typename Value>
  Layout<Value> head(size_t count, const Value& background) {
    using namespace openvdb::io;
    const auto code = in_.value<int8_t>("code of a node");
    if (code < NO_MASK_OR_INACTIVE_VALS || code > NO_MASK_AND_ALL_VALS)
      in_.fail("code of a node", "0 to 6", std::to_string(code));
    Layout<Value> layout;
    layout.all = (compression_ & COMPRESS_ACTIVE_MASK) == 0 || code == NO_MASK_AND_ALL_VALS;
    layout.inactive = {code == NO_MASK_OR_INACTIVE_VALS ? background : negative(background), background};
    if (code == NO_MASK_AND_ONE_INACTIVE_VAL || code == MASK_AND_ONE_INACTIVE_VAL || code == MASK_AND_TWO_INACTIVE_VALS)
      layout.inactive[0] = in_.value<Value>("inactive value");
    if (code == MASK_AND_TWO_INACTIVE_VALS) layout.inactive[1] = in_.value<Value>("inactive value");
    if (code == MASK_AND_NO_INACTIVE_VALS || code == MASK_AND_ONE_INACTIVE_VAL || code == MASK_AND_TWO_INACTIVE_VALS) {
      const char* bits = in_.take(count / 8, "mask of a node");
      if (count == kBlockVoxels) std::copy_n(bits, layout.selection.size(), layout.selection.data());
    }
    return layout;
  }

  void data(void* to, size_t bytes) {
    const bool blosc = (compression_ & openvdb::io::COMPRESS_BLOSC) != 0;
    if (!blosc && (compression_ & openvdb::io::COMPRESS_ZIP) == 0) {
      std::memcpy(to, in_.take(bytes, "values"), bytes);
      return;
    }
    // Negative: so many bytes as they are, which is how short or incompressible values are stored.
    const auto stored = in_.value<int64_t>("size of values");
    if (stored <= 0) {
      if (-uint64_t(stored) != bytes)
        in_.fail("size of values", std::to_string(bytes), std::to_string(-uint64_t(stored)));
      std::memcpy(to, in_.take(bytes, "values"), bytes);
      return;
    }
    const char* from = in_.take(uint64_t(stored), "compressed values");
    size_t given = 0;
    if (blosc) {
      if (blosc_cbuffer_validate(from, size_t(stored), &given) < 0 || given != bytes ||
          blosc_decompress_ctx(from, to, bytes, 1) != int(bytes))
        in_.fail("Blosc values", std::to_string(bytes) + " bytes", "something else");
    } else if (libdeflate_zlib_decompress(inflate_, from, size_t(stored), to, bytes, &given) != LIBDEFLATE_SUCCESS ||
               given != bytes) {
      in_.fail("deflated values", std::to_string(bytes) + " bytes", "something else");
    }
  }

  Bytes& in_;
  uint32_t compression_;
  libdeflate_decompressor* inflate_;
  alignas(64) std::array<char, kBlockVoxels * sizeof(openvdb::Vec3s)> packed_;
};

/// The bits of a node mask that are set, ascending.
std::vector<uint32_t> set_bits(const char* mask, size_t bits) {
  std::vector<uint32_t> set;
  for (uint32_t i = 0; i < bits; ++i)
    if (mask[i >> 3] >> (i & 7) & 1) set.push_back(i);
  return set;
}

BlockMask leaf_mask(Bytes& in) {
  BlockMask mask;
  std::memcpy(mask.word.data(), in.take(sizeof mask.word, "mask of a leaf"), sizeof mask.word);
  return mask;
}

/// The children of an inner node of edge 1 << log2_dim.
template <typename Value>
std::vector<uint32_t> inner_node(Bytes& in, NodeValues& values, int log2_dim) {
  const size_t slots = size_t(1) << 3 * log2_dim;
  std::vector<uint32_t> children = set_bits(in.take(slots / 8, "children of a node"), slots);
  const char* active = in.take(slots / 8, "tiles of a node");
  if (std::any_of(active, active + slots / 8, [](char c) { return c != 0; }))
    in.fail("values", "leaves only", "an active tile");
  values.skip_inner<Value>(slots);
  return children;
}

/// Origins of leaves, in units of blocks and the order of the file.
template <typename Value>
std::vector<BlockCoord> read_topology(Bytes& in, uint32_t compression, Value& background) {
  if (in.value<int32_t>("number of buffers") != 1) in.fail("number of buffers", "1", "another");
  background = in.value<Value>("background");
  if (in.value<uint32_t>("number of tiles") != 0) in.fail("values", "leaves only", "tiles at the root");
  NodeValues values(in, compression);
  constexpr int kRootEdge = 4096, kUpper = 5, kLower = 4;  // voxels; log2 of children along an edge
  std::vector<BlockCoord> leaves;
  std::array<int32_t, 3> before{};
  const auto roots = in.value<uint32_t>("number of nodes");
  for (uint32_t r = 0; r < roots; ++r) {
    const auto origin = in.value<std::array<int32_t, 3>>("origin of a node");
    if ((r > 0 && !(before < origin)) ||
        std::any_of(origin.begin(), origin.end(), [](int32_t x) { return x % kRootEdge != 0; }))
      in.fail("origin of a node", "multiples of 4096, ascending", "others");
    before = origin;
    for (const uint32_t u : inner_node<Value>(in, values, kUpper)) {
      const std::vector<uint32_t> lower = inner_node<Value>(in, values, kLower);
      for (const uint32_t l : lower) {
        const auto along = [&](int axis) {
          const int shift = 2 - axis;
          return origin[size_t(axis)] / kBlockDim + int(u >> kUpper * shift & 31) * 16 + int(l >> kLower * shift & 15);
        };
        in.skip(sizeof(BlockMask), "mask of a leaf");
        leaves.push_back({along(0), along(1), along(2)});
      }
    }
  }
  return leaves;
}

}  // namespace

VdbReader::VdbReader(const OpenedFile& file, uint64_t bytes, std::string where)
    : file_(file), where_(std::move(where)) {
  Bytes in(file, 0, bytes, where_);
  if (in.value<int64_t>("start of the file") != kMagic)
    in.fail("start of the file", "that of an OpenVDB file", "another");
  if (const auto version = in.value<uint32_t>("version"); version != kFileVersion)
    in.fail("version of the OpenVDB file", std::to_string(kFileVersion), std::to_string(version));
  in.skip(2 * sizeof(uint32_t), "version of the library");
  if (in.value<char>("grid offsets") == 0) in.fail("grid offsets", "with them", "without");
  in.skip(kIdentifierBytes, "identifier");
  metadata_ = read_meta_map(in);
  const auto count = in.value<int32_t>("number of grids");
  for (int32_t i = 0; i < count; ++i) {
    VdbGridEntry& entry = grids_.emplace_back();
    read_grid_head(in, entry);
    in.skip(entry.end - in.at(), "grid");
  }
}

bool VdbReader::has(const std::string& name) const {
  return std::any_of(grids_.begin(), grids_.end(), [&](const VdbGridEntry& grid) { return grid.name == name; });
}

const VdbGridEntry& VdbReader::grid(const std::string& name, const std::string& type) const {
  const auto found = std::find_if(grids_.begin(), grids_.end(), [&](const VdbGridEntry& g) { return g.name == name; });
  if (found == grids_.end()) throw FormatError(describe_mismatch(where_, "grids", "one named '" + name + "'", "none"));
  if (found->type != type)
    throw FormatError(describe_mismatch(where_, "grid '" + name + "'", "type " + type, found->type));
  return *found;
}

void VdbReader::require_voxel_size(double voxel_size_m) const {
  const double s = voxel_size_m, expected[] = {s, s, 1 / s, 1 / (s * s), 0.5 / s};
  for (const VdbGridEntry& entry : grids_)
    for (size_t i = 0; i < entry.transform.size(); ++i) {
      // What follows from the scale may have been rounded in another order.
      const double number = expected[i / 3], found = entry.transform[i], most_off = i < 6 ? 0 : 1e-12 * number;
      if (!(std::abs(found - number) <= most_off))
        throw FormatError(describe_mismatch(where_ + ": grid '" + entry.name + "'", "transform",
                                            text_of(number) + " for voxels of " + text_of(s) + " m", text_of(found)));
    }
}

template <typename Value>
Value VdbReader::read(const std::string& name, const std::function<void(const VdbLeaf<Value>&)>& visit) const {
  using Grid =
      std::conditional_t<std::is_same_v<Value, float>, openvdb::FloatGrid,
                         std::conditional_t<std::is_same_v<Value, int32_t>, openvdb::Int32Grid, openvdb::Vec3SGrid>>;
  const VdbGridEntry& entry = grid(name, Grid::gridType());
  Bytes in(file_, entry.tree_at, entry.end, where_ + ": grid '" + name + "'");
  Value background = openvdb::zeroVal<Value>();
  const std::vector<BlockCoord> leaves = read_topology(in, entry.compression, background);
  NodeValues node(in, entry.compression);
  alignas(64) std::array<Value, kBlockVoxels> values;
  for (const BlockCoord& coord : leaves) {
    const BlockMask active = leaf_mask(in);
    node.leaf(active, background, values.data());
    visit({coord, active, values.data()});
  }
  return background;
}

template float VdbReader::read(const std::string&, const std::function<void(const VdbLeaf<float>&)>&) const;
template int32_t VdbReader::read(const std::string&, const std::function<void(const VdbLeaf<int32_t>&)>&) const;
template openvdb::Vec3s VdbReader::read(const std::string&,
                                        const std::function<void(const VdbLeaf<openvdb::Vec3s>&)>&) const;

Region VdbReader::read_mask(const std::string& name) const {
  const VdbGridEntry& entry = grid(name, openvdb::MaskGrid::gridType());
  Bytes in(file_, entry.tree_at, entry.end, where_ + ": grid '" + name + "'");
  uint8_t background = 0;
  std::vector<std::pair<BlockCoord, BlockMask>> blocks;
  for (const BlockCoord& coord : read_topology(in, entry.compression, background)) {
    const BlockMask mask = leaf_mask(in);
    in.skip(3 * sizeof(int32_t), "origin of a leaf");
    if (mask.any()) blocks.emplace_back(coord, mask);
  }
  std::sort(blocks.begin(), blocks.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  Region region;
  for (const auto& [coord, mask] : blocks) region.append(coord, mask);
  return region;
}

}  // namespace felt
