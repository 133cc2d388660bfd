// Entry points of libFuzzer. One program holds every harness; FELTMAP_FUZZ=<name> chooses (scripts/fuzz).
#include <sanitizer/allocator_interface.h>

#include <atomic>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "tests/fuzz/harness.h"

namespace {
const felt::fuzz::Harness* chosen = nullptr;

// Bytes that any allocator has given out and not got back, and the most since the last reset.
std::atomic<int64_t> bytes_now = 0, bytes_most = 0;

void on_malloc(const volatile void*, size_t bytes) {
  const int64_t now = bytes_now += int64_t(bytes);
  int64_t most = bytes_most;
  while (now > most && !bytes_most.compare_exchange_weak(most, now)) {
  }
}

void on_free(const volatile void* p) {
  if (p != nullptr) bytes_now -= int64_t(__sanitizer_get_allocated_size(p));
}
}  // namespace

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  const char* name = std::getenv("FELTMAP_FUZZ");
  for (const felt::fuzz::Harness& harness : felt::fuzz::harnesses())
    if (name != nullptr && std::string(name) == harness.name) chosen = &harness;
  if (chosen == nullptr) {
    std::fprintf(stderr, "FELTMAP_FUZZ: expected one of");
    for (const felt::fuzz::Harness& harness : felt::fuzz::harnesses()) std::fprintf(stderr, " %s", harness.name);
    std::fprintf(stderr, ", found %s\n", name != nullptr ? name : "nothing");
    std::exit(2);
  }
  if (__sanitizer_install_malloc_and_free_hooks(on_malloc, on_free) == 0) std::abort();
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string bytes(reinterpret_cast<const char*>(data), size);
  const int64_t before = bytes_now;
  bytes_most = before;
  felt::fuzz::accepted(*chosen, bytes);
  const size_t taken = size_t(bytes_most - before), bound = chosen->free_bytes + chosen->bytes_per_byte * size;
  if (taken > bound) {
    std::fprintf(stderr, "%s: %zu bytes of memory for %zu bytes of input, at most %zu are justified\n", chosen->name,
                 taken, size, bound);
    std::abort();
  }
  return 0;
}
