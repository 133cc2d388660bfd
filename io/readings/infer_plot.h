#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "io/pictures/plot_svg.h"

namespace felt {

/// Densities of the next reading before and after the readings of one line of `feltmap infer`: two panels, each with
/// the Student-t mixture and its weighted components; dashed, the plug-in normal mixture, or after a reading of a
/// `mixture` the exact density before projection. `title` names a line that carries no "title" of its own. Throws
/// FormatError for a line that cannot be used.
std::vector<Plot> infer_plots(std::string_view line, const std::string& title);

}  // namespace felt
