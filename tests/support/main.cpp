#define CATCH_CONFIG_RUNNER
#include <catch2/catch.hpp>

#include "tests/support/skip.h"

namespace felt::test {
namespace {
bool skipped = false;
}

void skip(const std::string& reason) {
  skipped = true;
  WARN("skipped: " << reason);
}

}  // namespace felt::test

int main(int argc, char** argv) {
  constexpr int kSkipped = 77;  // SKIP_RETURN_CODE of tests/CMakeLists.txt; a failure counts for more
  const int failures = Catch::Session().run(argc, argv);
  return failures == 0 && felt::test::skipped ? kSkipped : failures;
}
