#pragma once

#include <string>

#include "core/class_table.h"
#include "core/property_table.h"

namespace felt {

/// Where two tables first differ, in words for people: "row 3 is 'wood' (id 3) and 'grass' (id 3)", "'friction' has
/// other priors"; empty where they do not. Rows come before what depends on their number, as default priors do.
std::string first_difference(const ClassTable& a, const ClassTable& b);
std::string first_difference(const PropertyTable& a, const PropertyTable& b);

/// Whether `longer` has all properties of `shorter` in their places, and perhaps more behind them.
bool continues(const PropertyTable& longer, const PropertyTable& shorter);

}  // namespace felt
