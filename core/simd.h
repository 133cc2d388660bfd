#pragma once

#include <string>
#include <vector>

namespace felt {

/// Names that `choose_simd` accepts on this processor, best first and "scalar" last: of avx3, avx2, sse4 those that the
/// processor has and the kernels were compiled for.
std::vector<std::string> simd_names();

/// Makes every kernel run on the named target from now on: one of `simd_names()`. "scalar" selects the plain C++
/// kernels that specify the others. "" returns to the best target. Not to be called while kernels run. Throws
/// `ConfigError`, naming `where` the name came from, for an unknown name or a target this processor lacks.
void choose_simd(const std::string& name, const std::string& where);

/// Applies the environment variable FELTMAP_SIMD (unset or empty: the best target). Programs call it once, at their
/// start. Throws `ConfigError` as `choose_simd` does.
void apply_simd_choice();

/// Target that kernels run on now: "avx3", "avx2", "sse4", "scalar" (others on other processors).
std::string simd_name();

/// Whether "scalar" was chosen: entry points of kernels then call their scalar version.
bool simd_scalar_forced() noexcept;

}  // namespace felt
