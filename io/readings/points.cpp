#include "io/readings/points.h"

#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <utility>

#include "core/error.h"
#include "io/files/text_input.h"

namespace felt {
namespace {

/// Columns of x, y and z in a header line; nothing where the line is none.
std::optional<std::array<size_t, 3>> point_columns(const std::vector<std::string>& cells) {
  std::array<size_t, 3> columns{};
  for (size_t i = 0; i < 3; ++i) {
    const char* const name = std::array{"x", "y", "z"}[i];
    if (std::count(cells.begin(), cells.end(), name) != 1) return std::nullopt;
    columns[i] = size_t(std::find(cells.begin(), cells.end(), name) - cells.begin());
  }
  return columns;
}

}  // namespace

std::vector<Eigen::Vector3d> read_points(const std::filesystem::path& file) {
  const std::string content = read_file_or_pipe(file);
  std::vector<Eigen::Vector3d> points;
  std::vector<std::string> problems;
  char separator = ',';
  std::array<size_t, 3> columns{0, 1, 2};
  size_t width = 3;  // cells of a line
  bool first = true;
  for (LineReader lines(content, file); lines.next();) {
    if (first) separator = csv_separator(lines.line());
    const std::vector<std::string> cells = csv_cells(lines.line(), separator);
    if (std::exchange(first, false))
      if (const auto named = point_columns(cells)) {
        columns = *named;
        width = cells.size();
        continue;
      }
    Eigen::Vector3d p;
    bool good = cells.size() == width;
    for (size_t i = 0; i < 3 && good; ++i) {
      const std::optional<double> coordinate = parse_number(cells[columns[i]]);
      good = coordinate.has_value();
      if (good) p[Eigen::Index(i)] = *coordinate;
    }
    if (good)
      points.push_back(p);
    else
      problems.push_back(describe_mismatch(
          lines.where(), "point", width == 3 ? "x,y,z" : std::to_string(width) + " cells, numbers in x, y and z",
          "'" + std::string(lines.line().substr(0, 60)) + "'"));
  }
  if (!problems.empty()) throw FormatError(first_of(problems));
  return points;
}

}  // namespace felt
