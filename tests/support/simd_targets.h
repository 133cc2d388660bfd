#pragma once

#include <string>

#include "core/simd.h"

namespace felt::test {

/// Runs `check()` once on every SIMD target of this processor, "scalar" included, and returns to the best one.
template <class Check>
void on_every_simd_target(Check check) {
  for (const std::string& name : simd_names()) {
    choose_simd(name, "test");
    check(name);
  }
  choose_simd("", "test");
}

}  // namespace felt::test
