#pragma once

#include "io/simulation/scene.h"

namespace felt {

/// Furnished room 1 .. 5: other sizes, layouts, colours and materials. Camera path and furniture keep clear of each
/// other by at least 0.25 m.
Scene furnished_room(int number);

}  // namespace felt
