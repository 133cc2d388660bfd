#include "core/simd.h"

#include <catch2/catch.hpp>
#include <cstdlib>

#include "core/error.h"

using namespace felt;

namespace {

/// Puts the choice and the environment back as they were.
struct RestoreChoice {
  std::string before = std::getenv("FELTMAP_SIMD") != nullptr ? std::getenv("FELTMAP_SIMD") : "";
  ~RestoreChoice() {
    setenv("FELTMAP_SIMD", before.c_str(), 1);
    apply_simd_choice();
  }
};

}  // namespace

TEST_CASE("each SIMD target of this processor can be chosen and says its name") {
  const RestoreChoice restore;
  const std::vector<std::string> names = simd_names();
  REQUIRE(names.back() == "scalar");
  for (const std::string& name : names) {
    choose_simd(name, "test");
    CHECK(simd_name() == name);
    CHECK(simd_scalar_forced() == (name == "scalar"));
  }
  choose_simd("", "test");
  CHECK(simd_name() == names.front());
}

TEST_CASE("FELTMAP_SIMD chooses the target, and a wrong name is refused with the names that would do") {
  const RestoreChoice restore;
  setenv("FELTMAP_SIMD", "scalar", 1);
  apply_simd_choice();
  CHECK(simd_scalar_forced());
  setenv("FELTMAP_SIMD", "avx9", 1);
  try {
    apply_simd_choice();
    FAIL("an unknown target was accepted");
  } catch (const ConfigError& e) {
    const std::string message = e.what();
    CHECK(message.find("FELTMAP_SIMD") != std::string::npos);
    CHECK(message.find("'avx9'") != std::string::npos);
    CHECK(message.find("scalar") != std::string::npos);
  }
}
