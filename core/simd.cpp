#include "core/simd.h"

#include <hwy/highway.h>

#include <algorithm>
#include <atomic>
#include <cctype>
#include <cstdlib>

#include "core/error.h"
#include "core/text.h"

namespace felt {
namespace {

std::atomic<bool> scalar_forced{false};

struct NamedTarget {
  const char* name;
  int64_t targets;  // every Highway target of that name
};

// Best first. Highway's AVX3_DL is AVX3 with a few more instructions, none of which the kernels need.
constexpr NamedTarget kNamed[] = {{"avx3", HWY_AVX3 | HWY_AVX3_DL}, {"avx2", HWY_AVX2}, {"sse4", HWY_SSE4}};

std::string name_of(int64_t target) {
  for (const NamedTarget& named : kNamed)
    if (named.targets & target) return named.name;
  std::string name = hwy::TargetName(target);
  std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return std::tolower(c); });
  return name;
}

int64_t usable_targets() { return hwy::SupportedTargets() & HWY_TARGETS; }

void disable(int64_t targets) {
  hwy::DisableTargets(targets);
  hwy::GetChosenTarget().DeInit();
}

}  // namespace

std::vector<std::string> simd_names() {
  const int64_t usable = usable_targets();
  std::vector<std::string> names;
  for (const NamedTarget& named : kNamed)
    if (named.targets & usable) names.emplace_back(named.name);
  names.emplace_back("scalar");
  return names;
}

void choose_simd(const std::string& name, const std::string& where) {
  disable(0);
  scalar_forced = false;
  if (name.empty()) return;
  const std::vector<std::string> names = simd_names();
  if (std::find(names.begin(), names.end(), name) == names.end())
    throw ConfigError(describe_mismatch(where, "SIMD target", "one of " + listed(names), "'" + name + "'"));
  scalar_forced = name == "scalar";
  int64_t better = 0;
  for (const NamedTarget& named : kNamed) {
    if (named.name == name) break;
    better |= named.targets;
  }
  disable(better);
}

void apply_simd_choice() {
  const char* set = std::getenv("FELTMAP_SIMD");
  choose_simd(set != nullptr ? set : "", "environment FELTMAP_SIMD");
}

std::string simd_name() {
  if (scalar_forced) return "scalar";
  // A lower bit is a better target (hwy/detect_targets.h).
  const int64_t usable = usable_targets();
  return name_of(usable & -usable);
}

bool simd_scalar_forced() noexcept { return scalar_forced.load(std::memory_order_relaxed); }

}  // namespace felt
