#pragma once

#include <string>

#include "mapping/maps/map_diff.h"

namespace felt {

/// The comparison of the maps named `a` and `b` as a JSON document, with keys named as the fields are and `differs` for
/// what `beyond` says; infinite differences are null.
std::string to_json(const MapDifference& difference, const std::string& a, const std::string& b, double tolerance);
/// A comparison as a table for people.
std::string to_text(const MapDifference& difference);

}  // namespace felt
