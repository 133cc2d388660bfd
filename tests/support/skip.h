#pragma once

#include <string>

namespace felt::test {

/// Says why the test that runs cannot be made here; it returns after that. ctest reports it as skipped, unless one of
/// its assertions failed.
void skip(const std::string& reason);

}  // namespace felt::test
