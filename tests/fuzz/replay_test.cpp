// Replays seeds and findings, and a number of damaged copies of each, with every compiler: no fuzzer needed.
#include <malloc.h>

#include <algorithm>
#include <atomic>
#include <catch2/catch.hpp>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <new>
#include <random>
#include <vector>

#include "tests/fuzz/harness.h"
#include "tests/support/data.h"

namespace fs = std::filesystem;
using namespace felt::fuzz;

namespace {

// Bytes that operator new has given out and not got back, and the most since the last reset.
std::atomic<size_t> bytes_now = 0, bytes_most = 0;

void* counted(void* p) {
  if (p == nullptr) throw std::bad_alloc();
  const size_t now = bytes_now += malloc_usable_size(p);
  size_t most = bytes_most;
  while (now > most && !bytes_most.compare_exchange_weak(most, now)) {
  }
  return p;
}

void give_back(void* p) {
  if (p != nullptr) bytes_now -= malloc_usable_size(p);
  std::free(p);
}

struct Seed {
  std::string name, bytes;
};

std::vector<Seed> seeds_of(const Harness& harness) {
  std::vector<Seed> seeds;
  const fs::path folder = felt::test::source_dir() / "tests" / "fuzz" / "corpus" / harness.name;
  if (fs::is_directory(folder))
    for (const auto& entry : fs::directory_iterator(folder)) {
      std::ifstream in(entry.path(), std::ios::binary);
      seeds.push_back({entry.path().filename(), {std::istreambuf_iterator<char>(in), {}}});
    }
  std::sort(seeds.begin(), seeds.end(), [](const Seed& a, const Seed& b) { return a.name < b.name; });
  return seeds;
}

/// Changes, inserts, doubles or cuts a few bytes.
std::string damaged(std::string bytes, std::mt19937_64& engine) {
  const auto at = [&] { return bytes.empty() ? 0 : size_t(engine() % bytes.size()); };
  for (uint64_t edits = 1 + engine() % 4; edits > 0; --edits) switch (engine() % 6) {
      case 0:
        if (!bytes.empty()) bytes[at()] = char(engine());
        break;
      case 1:
        if (!bytes.empty()) bytes[at()] ^= char(1 << engine() % 8);
        break;
      case 2:
        bytes.insert(at(), 1, "0-.,:{}[]\n \0\xff"[engine() % 13]);
        break;
      case 3:
        if (!bytes.empty()) bytes.erase(at(), 1 + engine() % 8);
        break;
      case 4:
        if (!bytes.empty()) bytes.insert(at(), bytes.substr(at(), 1 + engine() % 32));
        break;
      case 5:
        if (engine() % 4 == 0) bytes.resize(at());
        break;
    }
  return bytes;
}

/// Most memory that reading takes.
size_t peak_bytes(const Harness& harness, const std::string& bytes, bool& was_accepted) {
  const size_t before = bytes_now;
  bytes_most = before;
  was_accepted = accepted(harness, bytes);
  return bytes_most - before;
}

}  // namespace

void* operator new(size_t n) { return counted(std::malloc(n)); }
void* operator new(size_t n, std::align_val_t a) {
  return counted(std::aligned_alloc(size_t(a), (n + size_t(a) - 1) / size_t(a) * size_t(a)));
}
void operator delete(void* p) noexcept { give_back(p); }
void operator delete(void* p, size_t) noexcept { give_back(p); }
void operator delete(void* p, std::align_val_t) noexcept { give_back(p); }
void operator delete(void* p, size_t, std::align_val_t) noexcept { give_back(p); }

TEST_CASE("every reader accepts a seed, and refuses or accepts each seed and finding within bounded memory") {
  for (const Harness& harness : harnesses()) {
    INFO(harness.name);
    const std::vector<Seed> seeds = seeds_of(harness);
    CHECK_FALSE(seeds.empty());
    int taken = 0;
    for (const Seed& seed : seeds) {
      INFO(seed.name);
      bool was_accepted = false;
      CHECK(peak_bytes(harness, seed.bytes, was_accepted) <=
            harness.free_bytes + harness.bytes_per_byte * seed.bytes.size());
      taken += was_accepted;
    }
    CHECK(taken > 0);
  }
}

TEST_CASE("damaged copies of every seed are refused or accepted, within bounded memory") {
  // FELTMAP_MUTATIONS=100000 for a long run without a fuzzer.
  const char* asked = std::getenv("FELTMAP_MUTATIONS");
  const int mutations = asked != nullptr ? std::atoi(asked) : 30;
  REQUIRE(mutations > 0);
  for (const Harness& harness : harnesses()) {
    INFO(harness.name);
    std::mt19937_64 engine(1);
    for (const Seed& seed : seeds_of(harness))
      for (int n = 0; n < mutations; ++n) {
        const std::string bytes = damaged(seed.bytes, engine);
        bool was_accepted = false;
        const size_t most = peak_bytes(harness, bytes, was_accepted);
        if (most > harness.free_bytes + harness.bytes_per_byte * bytes.size()) {
          std::ofstream("fuzz-finding", std::ios::binary) << bytes;
          FAIL(seed.name << ", damage " << n << ": " << most << " bytes for " << bytes.size()
                         << ", kept as fuzz-finding");
        }
      }
  }
}
