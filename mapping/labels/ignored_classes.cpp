#include "mapping/labels/ignored_classes.h"

#include <algorithm>

#include "core/error.h"
#include "core/text.h"

namespace felt {

IgnoredClasses ignored_classes(const ClassTable& table, const std::vector<std::string>& names,
                               const std::string& where) {
  std::vector<ClassInfo> classes = table.classes();
  std::vector<std::string> problems;
  IgnoredClasses result;
  for (const std::string& name : names) {
    const auto found = std::find_if(classes.begin(), classes.end(), [&](const ClassInfo& c) { return c.name == name; });
    if (found == classes.end()) {
      const std::string known = listed(classes, &ClassInfo::name);
      problems.push_back(describe_mismatch(where, "class",
                                           known.empty() ? "a class of a table, which there is not" : "one of " + known,
                                           "'" + name + "'"));
      continue;
    }
    found->ignore = true;
    result.ids.push_back(found->id);
  }
  if (!problems.empty()) throw ConfigError(problems);
  result.table = classes.empty() ? ClassTable() : ClassTable(std::move(classes));
  return result;
}

size_t clear_depth_of(const std::vector<uint16_t>& ids, Frame& frame) {
  if (ids.empty()) return 0;
  std::vector<bool> ignored(0x10000, false);
  for (const uint16_t id : ids) ignored[id] = true;
  size_t cleared = 0;
  const auto clear_where = [&](auto id_of) {
    for (size_t pixel = 0; pixel < frame.depth_m.size(); ++pixel) {
      if (!ignored[id_of(pixel)]) continue;
      frame.depth_m.data()[pixel] = 0;
      ++cleared;
    }
  };
  const ProbabilityImage& p = frame.probabilities;
  const auto top = size_t(p.top);
  if (!p.empty() && p.class_id.size() == frame.depth_m.size() * top) {
    clear_where([&](size_t pixel) {
      const auto first = p.probability.begin() + std::ptrdiff_t(pixel * top);
      return p.class_id[pixel * top + size_t(std::max_element(first, first + p.top) - first)];
    });
  } else if (frame.labels.size() == frame.depth_m.size()) {
    clear_where([&](size_t pixel) { return frame.labels.data()[pixel]; });
  }
  return cleared;
}

}  // namespace felt
