#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace felt {

/// Number that ends a file's stem: 12 for "depth000012.png", "12.jpg" and "frame-000012". Nothing where there is none.
std::optional<int64_t> trailing_number(std::string_view stem);

/// What lies directly in `folder`, in no particular order. Throws IoError where it cannot be listed to its end.
std::vector<std::filesystem::path> entries_of(const std::filesystem::path& folder);

/// Files directly in `folder` whose name is `prefix`, a number, `suffix` (one of `suffixes`, in capitals too), by that
/// number. Numbers sort as numbers, whether or not they are padded with zeros. Empty where the folder is absent.
/// Throws IoError where the folder cannot be listed and FormatError where two names hold one number.
std::map<int64_t, std::filesystem::path> numbered_files(const std::filesystem::path& folder, const std::string& prefix,
                                                        const std::vector<std::string>& suffixes);

/// The file of `number`, or an empty path.
std::filesystem::path at_number(const std::map<int64_t, std::filesystem::path>& files, int64_t number);

/// True where `folder` directly holds at least one such file.
bool has_numbered_file(const std::filesystem::path& folder, const std::string& prefix,
                       const std::vector<std::string>& suffixes);

/// First of `names` that exists in `folder`, or an empty path.
std::filesystem::path first_existing(const std::filesystem::path& folder, const std::vector<std::string>& names);

}  // namespace felt
