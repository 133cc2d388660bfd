#include "core/class_table.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "core/error.h"
#include "core/image.h"
#include "core/utf8.h"

namespace felt {

ClassTable::ClassTable(std::vector<ClassInfo> classes) : classes_(std::move(classes)) {
  std::vector<std::string> problems;
  std::map<uint16_t, std::string> by_id;
  std::map<std::string, uint16_t> by_name;
  for (size_t row = 0; row < classes_.size(); ++row) {
    const ClassInfo& c = classes_[row];
    // Whatever a file's text was: escapes of YAML can make other bytes, which a map's tables cannot hold.
    if (!is_utf8(c.name))
      problems.push_back(
          describe_mismatch("class table", "name of id " + std::to_string(c.id), "UTF-8", "other bytes"));
    if (const auto [other, is_new] = by_id.emplace(c.id, c.name); !is_new)
      problems.push_back("class table: id " + std::to_string(c.id) + ": expected unique ids, found it for '" +
                         other->second + "' and '" + c.name + "'");
    if (const auto [other, is_new] = by_name.emplace(c.name, c.id); !is_new)
      problems.push_back("class table: name '" + c.name + "': expected unique names, found it for ids " +
                         std::to_string(other->second) + " and " + std::to_string(c.id));
    if (c.id == kNoLabel)
      problems.push_back(describe_mismatch("class table", "id of '" + c.name + "'",
                                           "one below 65535, which means no label in images", "65535"));
    if (c.id >= slot_of_id_.size()) {
      slot_of_id_.resize(c.id + 1, kNoSlot);
      known_.resize(c.id + 1, false);
    }
    known_[c.id] = true;
    constexpr double kLargestPrior = 1e6;  // sums are kept in floats
    if (c.prior && !(*c.prior > 0 && *c.prior <= kLargestPrior))
      problems.push_back(describe_mismatch("class table", "prior of '" + c.name + "'", "a number above 0, up to 1e6",
                                           std::to_string(*c.prior)));
    if (!c.ignore) {
      slot_of_id_[c.id] = uint16_t(by_slot_.size());
      by_slot_.push_back(uint32_t(row));
    }
  }
  if (by_slot_.empty() && problems.empty())
    problems.push_back("class table: classes: expected at least one class that is not ignored, found none of " +
                       std::to_string(classes_.size()));
  // Views keep slots in 16 bits, -1 for none.
  if (by_slot_.size() > size_t(std::numeric_limits<int16_t>::max()))
    problems.push_back(describe_mismatch("class table", "classes", "at most 32767 that are not ignored",
                                         std::to_string(by_slot_.size())));
  if (!problems.empty()) throw ConfigError(problems);
  for (int slot = 0; slot < size(); ++slot) {
    prior_total_ += prior(slot);
    even_prior_ = even_prior_ && prior(slot) == prior(0);
  }
}

bool ClassTable::operator==(const ClassTable& other) const {
  const auto prior_of = [](const ClassTable& table, const ClassInfo& c) {
    return c.ignore ? 0 : c.prior.value_or(default_prior(table.size()));
  };
  return std::equal(classes_.begin(), classes_.end(), other.classes_.begin(), other.classes_.end(),
                    [&](const ClassInfo& a, const ClassInfo& b) {
                      return a.id == b.id && a.name == b.name && a.color == b.color && a.ignore == b.ignore &&
                             prior_of(*this, a) == prior_of(other, b);
                    });
}

std::optional<int> ClassTable::slot_of_name(const std::string& name) const {
  for (int slot = 0; slot < size(); ++slot)
    if (at_slot(slot).name == name) return slot;
  return std::nullopt;
}

Rgba8 default_class_color(int i) {
  // Hues a golden ratio apart keep any few consecutive classes distinct; two values of brightness double the palette.
  const double hue = std::fmod(0.61803398875 * i, 1.0) * 6.0, value = i % 2 == 0 ? 0.92 : 0.68, saturation = 0.62;
  const auto channel = [&](double n) {
    const double k = std::fmod(n + hue, 6.0);
    return uint8_t(std::lround(255 * (value - value * saturation * std::clamp(std::min(k, 4 - k), 0.0, 1.0))));
  };
  return {channel(5), channel(3), channel(1), 255};
}

}  // namespace felt
