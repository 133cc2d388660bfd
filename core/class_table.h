#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/image.h"

namespace felt {

/// One row of `classes.yaml`.
struct ClassInfo {
  uint16_t id = 0;  ///< value in label images
  std::string name;
  Rgba8 color;          ///< of views and meshes
  bool ignore = false;  ///< its pixels carry no label
  /// Dirichlet concentration before anything was seen, above 0; none: `ClassTable::default_prior`.
  std::optional<double> prior = {};
};

/// The classes of a map. A class's *slot* is its position among the classes that are not ignored: 0 .. k-1, the index
/// of every Dirichlet and property vector.
class ClassTable {
public:
  static constexpr uint16_t kNoSlot = 0xffff;

  ClassTable() = default;
  /// Throws ConfigError naming every duplicate id or name and every prior that is not a positive number, and where
  /// there is no class that is not ignored.
  explicit ClassTable(std::vector<ClassInfo> classes);

  const std::vector<ClassInfo>& classes() const { return classes_; }
  /// k: the number of classes that take evidence.
  int size() const { return int(by_slot_.size()); }
  const ClassInfo& at_slot(int slot) const { return classes_[by_slot_[slot]]; }
  /// Slot of a label id, kNoSlot for ignored and unknown ids (`known` tells them apart).
  uint16_t slot_of_id(uint16_t id) const { return id < slot_of_id_.size() ? slot_of_id_[id] : kNoSlot; }
  bool known(uint16_t id) const { return id < known_.size() && known_[id]; }
  double prior(int slot) const { return at_slot(slot).prior.value_or(default_prior(size())); }
  /// The paper's 1 for up to eight classes (its table has eight); beyond, eight counts shared by all k of them, so that
  /// classes nobody saw do not outweigh what frames say (docs/adr/0008).
  static double default_prior(int k) { return k > 8 ? 8.0 / k : 1; }
  double prior_total() const { return prior_total_; }
  /// Whether all classes have one prior: sums over classes without evidence are then a product.
  bool even_prior() const { return even_prior_; }
  std::optional<int> slot_of_name(const std::string& name) const;
  bool empty() const { return classes_.empty(); }
  /// Equal classes with equal priors, whether these were given or are the default.
  bool operator==(const ClassTable& other) const;

private:
  std::vector<ClassInfo> classes_;
  std::vector<uint32_t> by_slot_;
  std::vector<uint16_t> slot_of_id_;
  std::vector<bool> known_;
  double prior_total_ = 0;
  bool even_prior_ = true;
};

/// A colour for class number `i` that neighbours in the table do not share, for tables that name none.
Rgba8 default_class_color(int i);

}  // namespace felt
