#pragma once

#include <string>
#include <vector>

#include "core/class_table.h"
#include "core/frame.h"

namespace felt {

/// Classes whose pixels are to leave no trace in a map: things that move, such as people.
struct IgnoredClasses {
  ClassTable table;           ///< the given one, these classes marked `ignore`
  std::vector<uint16_t> ids;  ///< of these classes
};

/// Looks the names up. Throws ConfigError (prefix `where`) that names the unknown ones and lists the table's.
IgnoredClasses ignored_classes(const ClassTable& table, const std::vector<std::string>& names,
                               const std::string& where);

/// Takes the depth of every pixel whose label, or whose most probable class where the frame has probabilities, is one
/// of `ids`: it then neither labels nor builds geometry. Returns the number of pixels.
size_t clear_depth_of(const std::vector<uint16_t>& ids, Frame& frame);

}  // namespace felt
