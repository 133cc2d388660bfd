#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace felt {

/// Whole content of a file. Throws IoError where it cannot be read or is no regular file, FormatError where it is
/// larger than `limit_bytes`.
std::string read_whole_file(const std::filesystem::path& path, size_t limit_bytes = size_t(1) << 30);
/// The same for a file that a user names on the command line: a pipe will do, too (`/dev/stdin`, `<(...)` of a shell).
std::string read_file_or_pipe(const std::filesystem::path& path, size_t limit_bytes = size_t(1) << 30);

/// Throws ConfigError naming `where` unless the text is UTF-8, which names in a map must be.
void require_utf8(std::string_view text, const std::string& where);

/// Walks the lines of a text: a byte order mark and Windows line ends are dropped, lines are counted from 1.
class LineReader {
public:
  /// `text` must outlive the reader. Throws FormatError where the text is binary (a NUL in its first 4096 bytes).
  LineReader(std::string_view text, const std::filesystem::path& path);
  /// Moves to the next line that is neither blank nor, where `comments`, begins with '#'. False at the end.
  bool next(bool comments = true);
  std::string_view line() const { return line_; }
  int64_t number() const { return number_; }
  /// "<path>:<line>"
  std::string where() const;

private:
  std::string_view rest_, line_;
  std::filesystem::path path_;
  int64_t number_ = 0;
};

/// Words of a line separated by blanks, tabs or, where given, by one further character.
std::vector<std::string_view> split_words(std::string_view line, char separator = ' ');

/// What separates the cells of a CSV file with this header line: ';' where it has one outside quotes, else ','.
char csv_separator(std::string_view header);
/// Cells of a line of a CSV file without the blanks and quotes around them; empty ones count. Between quotes a
/// separator is text and "" a quote, as RFC 4180 has it.
std::vector<std::string> csv_cells(std::string_view line, char separator);
/// Text as a cell that `csv_cells` reads back, in quotes where it needs them.
std::string csv_cell(const std::string& text);

/// The faults of a data file on one line: the first, and how many more there are. Nothing where there are none.
std::string first_of(const std::vector<std::string>& faults);

/// A number with '.' as decimal sign; reads "nan", "inf" and "-inf" as such. Nothing where the word is anything else.
std::optional<double> parse_number(std::string_view word);
std::optional<int64_t> parse_integer(std::string_view word);

/// All numbers of a line. Throws FormatError naming `where` and the faulty word; says so where a decimal comma is the
/// likely cause.
std::vector<double> parse_numbers(std::string_view line, const std::string& where);

}  // namespace felt
