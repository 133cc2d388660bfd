#include "io/sequence/layouts/file_names.h"

#include <algorithm>
#include <cctype>

#include "core/error.h"
#include "io/files/text_input.h"

namespace felt {
namespace fs = std::filesystem;
namespace {

std::optional<int64_t> number_between(const std::string& name, const std::string& prefix,
                                      const std::vector<std::string>& suffixes) {
  if (!name.starts_with(prefix)) return std::nullopt;
  std::string lower = name;
  std::transform(lower.begin(), lower.end(), lower.begin(), [](unsigned char c) { return char(std::tolower(c)); });
  for (const std::string& suffix : suffixes) {
    if (!lower.ends_with(suffix) || name.size() <= prefix.size() + suffix.size()) continue;
    const auto number =
        parse_integer(std::string_view(name).substr(prefix.size(), name.size() - prefix.size() - suffix.size()));
    if (number && *number >= 0) return number;
  }
  return std::nullopt;
}

}  // namespace

std::vector<fs::path> entries_of(const fs::path& folder) {
  std::error_code fault;
  std::vector<fs::path> entries;
  for (fs::directory_iterator at(folder, fault), end; !fault && at != end; at.increment(fault))
    entries.push_back(at->path());
  if (fault) throw IoError(describe_mismatch(folder.string(), "folder", "a readable folder", fault.message()));
  return entries;
}

std::optional<int64_t> trailing_number(std::string_view stem) {
  const size_t last = stem.find_last_not_of("0123456789");
  return parse_integer(stem.substr(last == std::string_view::npos ? 0 : last + 1));
}

std::map<int64_t, fs::path> numbered_files(const fs::path& folder, const std::string& prefix,
                                           const std::vector<std::string>& suffixes) {
  std::map<int64_t, fs::path> found;
  if (!fs::is_directory(folder)) return found;
  for (const fs::path& entry : entries_of(folder)) {
    const std::string name = entry.filename().string();
    const auto number = number_between(name, prefix, suffixes);
    if (!number) continue;
    const auto [other, is_new] = found.emplace(*number, entry);
    if (!is_new)
      throw FormatError(describe_mismatch(folder.string(), "frame " + std::to_string(*number), "one file",
                                          "'" + other->second.filename().string() + "' and '" + name + "'"));
  }
  return found;
}

fs::path at_number(const std::map<int64_t, fs::path>& files, int64_t number) {
  const auto found = files.find(number);
  return found == files.end() ? fs::path() : found->second;
}

bool has_numbered_file(const fs::path& folder, const std::string& prefix, const std::vector<std::string>& suffixes) {
  std::error_code fault;
  for (fs::directory_iterator at(folder, fault), end; !fault && at != end; at.increment(fault))
    if (number_between(at->path().filename().string(), prefix, suffixes)) return true;
  return false;
}

fs::path first_existing(const fs::path& folder, const std::vector<std::string>& names) {
  for (const std::string& name : names)
    if (fs::exists(folder / name)) return folder / name;
  return {};
}

}  // namespace felt
