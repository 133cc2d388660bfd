// Entry points of libFuzzer. One program holds every harness; FELTMAP_FUZZ=<name> chooses (scripts/fuzz).
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "tests/fuzz/harness.h"

namespace {
const felt::fuzz::Harness* chosen = nullptr;
}

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  const char* name = std::getenv("FELTMAP_FUZZ");
  for (const felt::fuzz::Harness& harness : felt::fuzz::harnesses())
    if (name != nullptr && std::string(name) == harness.name) chosen = &harness;
  if (chosen != nullptr) return 0;
  std::fprintf(stderr, "FELTMAP_FUZZ: expected one of");
  for (const felt::fuzz::Harness& harness : felt::fuzz::harnesses()) std::fprintf(stderr, " %s", harness.name);
  std::fprintf(stderr, ", found %s\n", name != nullptr ? name : "nothing");
  std::exit(2);
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  felt::fuzz::accepted(*chosen, std::string(reinterpret_cast<const char*>(data), size));
  return 0;
}
