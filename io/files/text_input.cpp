#include "io/files/text_input.h"

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <memory>

#include "core/error.h"
#include "core/utf8.h"

namespace felt {
namespace fs = std::filesystem;

std::string read_whole_file(const fs::path& path, size_t limit_bytes) {
  std::error_code fault;
  const fs::file_status status = fs::status(path, fault);
  if (!fs::exists(status)) throw IoError(describe_mismatch(path.string(), "file", "a file", "nothing"));
  if (!fs::is_regular_file(status))
    throw IoError(describe_mismatch(path.string(), "file", "a regular file",
                                    fs::is_directory(status) ? "a folder" : "a device or pipe"));
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rb"), std::fclose);
  if (!file) throw IoError(describe_mismatch(path.string(), "file", "a readable file", "no permission to open it"));
  const uintmax_t size = fs::file_size(path, fault);
  if (fault) throw IoError(path.string() + ": size: " + fault.message());
  if (size > limit_bytes)
    throw FormatError(describe_mismatch(path.string(), "size", "at most " + std::to_string(limit_bytes) + " bytes",
                                        std::to_string(size)));
  std::string content(size, '\0');
  content.resize(std::fread(content.data(), 1, content.size(), file.get()));
  if (std::ferror(file.get())) throw IoError(path.string() + ": reading failed");
  return content;
}

std::string read_file_or_pipe(const fs::path& path, size_t limit_bytes) {
  std::error_code fault;
  const fs::file_status status = fs::status(path, fault);
  if (!fs::is_fifo(status) && !fs::is_character_file(status)) return read_whole_file(path, limit_bytes);
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rb"), std::fclose);
  if (!file) throw IoError(describe_mismatch(path.string(), "file", "a readable file", "no permission to open it"));
  std::string content;
  char part[1 << 16];
  while (const size_t size = std::fread(part, 1, sizeof part, file.get())) {
    if (size > limit_bytes - content.size())
      throw FormatError(
          describe_mismatch(path.string(), "size", "at most " + std::to_string(limit_bytes) + " bytes", "more"));
    content.append(part, size);
  }
  if (std::ferror(file.get())) throw IoError(path.string() + ": reading failed");
  return content;
}

LineReader::LineReader(std::string_view text, const fs::path& path) : rest_(text), path_(path) {
  if (rest_.starts_with("\xef\xbb\xbf")) rest_.remove_prefix(3);
  if (rest_.substr(0, 4096).find('\0') != std::string_view::npos)
    throw FormatError(describe_mismatch(path.string(), "content", "text", "binary data"));
}

bool LineReader::next(bool comments) {
  while (!rest_.empty()) {
    const size_t end = rest_.find('\n');
    line_ = rest_.substr(0, end);
    rest_.remove_prefix(end == std::string_view::npos ? rest_.size() : end + 1);
    ++number_;
    while (!line_.empty() && (line_.back() == '\r' || line_.back() == ' ' || line_.back() == '\t'))
      line_.remove_suffix(1);
    const size_t first = line_.find_first_not_of(" \t");
    if (first == std::string_view::npos || (comments && line_[first] == '#')) continue;
    return true;
  }
  return false;
}

std::string LineReader::where() const { return path_.string() + ":" + std::to_string(number_); }

std::vector<std::string_view> split_words(std::string_view line, char separator) {
  std::vector<std::string_view> words;
  const char delimiters[] = {' ', '\t', '\r', separator, '\0'};
  for (size_t at = line.find_first_not_of(delimiters); at != std::string_view::npos;) {
    const size_t end = std::min(line.find_first_of(delimiters, at), line.size());
    words.push_back(line.substr(at, end - at));
    at = line.find_first_not_of(delimiters, end);
  }
  return words;
}

char csv_separator(std::string_view header) {
  bool quoted = false;
  for (const char c : header) {
    if (c == '"') quoted = !quoted;
    if (c == ';' && !quoted) return ';';
  }
  return ',';
}

std::vector<std::string> csv_cells(std::string_view line, char separator) {
  constexpr std::string_view kBlanks = " \t\r";
  std::vector<std::string> cells;
  for (size_t at = 0; at <= line.size(); ++at) {  // from behind a separator to the next
    std::string cell;
    at = std::min(line.find_first_not_of(kBlanks, at), line.size());
    if (at < line.size() && line[at] == '"') {
      for (++at; at < line.size() && (line[at] != '"' || line.substr(at, 2) == "\"\""); ++at) {
        if (line[at] == '"') ++at;
        cell += line[at];
      }
      at = std::min(at + 1, line.size());
    }
    const size_t end = std::min(line.find(separator, at), line.size());
    cell += line.substr(at, end - at);
    cell.resize(cell.find_last_not_of(kBlanks) + 1);
    cells.push_back(std::move(cell));
    at = end;
  }
  return cells;
}

std::string csv_cell(const std::string& text) {
  if (text.find_first_of(" \t\r\",;") == std::string::npos) return text;
  std::string cell = "\"";
  for (const char c : text) cell += c == '"' ? "\"\"" : std::string(1, c);
  return cell + "\"";
}

std::string first_of(const std::vector<std::string>& faults) {
  if (faults.empty()) return "";
  const size_t more = faults.size() - 1;
  return faults.front() + (more == 0   ? ""
                           : more == 1 ? " (and 1 more fault)"
                                       : " (and " + std::to_string(more) + " more faults)");
}

std::optional<double> parse_number(std::string_view word) {
  if (word.starts_with('+') && !word.starts_with("+-")) word.remove_prefix(1);
  double value = 0;
  const auto [end, fault] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (end != word.data() + word.size() || word.empty()) return std::nullopt;
  if (fault == std::errc::result_out_of_range) {
    // 1e-400 is a zero to us; 1e400 is no usable number.
    return word.find("e-") != std::string_view::npos || word.find("E-") != std::string_view::npos
               ? std::optional<double>(0.0)
               : std::nullopt;
  }
  return fault == std::errc() ? std::optional<double>(value) : std::nullopt;
}

std::optional<int64_t> parse_integer(std::string_view word) {
  int64_t value = 0;
  const auto [end, fault] = std::from_chars(word.data(), word.data() + word.size(), value);
  return fault == std::errc() && end == word.data() + word.size() ? std::optional<int64_t>(value) : std::nullopt;
}

std::vector<double> parse_numbers(std::string_view line, const std::string& where) {
  std::vector<double> numbers;
  for (const std::string_view word : split_words(line)) {
    const std::optional<double> number = parse_number(word);
    if (!number) {
      const bool comma = word.find(',') != std::string_view::npos;
      throw FormatError(
          describe_mismatch(where, "number " + std::to_string(numbers.size() + 1),
                            comma ? "a number with '.' as decimal sign and blanks between numbers" : "a number",
                            "'" + std::string(word.substr(0, 40)) + "'"));
    }
    numbers.push_back(*number);
  }
  return numbers;
}

void require_utf8(std::string_view text, const std::string& where) {
  if (!is_utf8(text)) throw ConfigError(describe_mismatch(where, "text", "UTF-8", "other bytes"));
}

}  // namespace felt
