#include "io/confusion_file.h"

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <optional>

#include "core/error.h"

namespace felt {
namespace {

std::string trimmed(const std::string& text) {
  const size_t first = text.find_first_not_of(" \t\r\""), last = text.find_last_not_of(" \t\r\"");
  return first == std::string::npos ? "" : text.substr(first, last - first + 1);
}

std::string quoted(const std::string& text) { return std::string(1, '\'').append(text).append(1, '\''); }

std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts;
  size_t from = 0;
  for (size_t at = text.find(separator); at != std::string::npos; from = at + 1, at = text.find(separator, from))
    parts.push_back(text.substr(from, at - from));
  parts.push_back(text.substr(from));
  return parts;
}

std::optional<double> number(const std::string& text) {
  double value = 0;
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), value);
  return fault == std::errc() && end == text.data() + text.size() ? std::optional(value) : std::nullopt;
}

}  // namespace

ConfusionMatrix parse_confusion_matrix(const std::string& text, const ClassTable& classes, const std::string& where) {
  const int k = classes.size();
  std::vector<std::string> problems;
  std::vector<int> column_slot;  // of every column after the first
  std::vector<bool> has_row(k, false);
  std::vector<double> rows(size_t(k) * k, 0.0);
  const auto slot_of = [&](const std::string& name, const std::string& at, const char* what) {
    const auto slot = classes.slot_of_name(name);
    if (!slot) problems.push_back(describe_mismatch(at, what, "a class of the table", quoted(name)));
    return slot.value_or(-1);
  };
  const std::vector<std::string> lines = split(text, '\n');
  for (size_t i = 0; i < lines.size(); ++i) {
    if (trimmed(lines[i]).empty()) continue;
    const std::string at = where + ":" + std::to_string(i + 1);
    const std::vector<std::string> cells = split(lines[i], ',');
    if (column_slot.empty()) {
      for (size_t c = 1; c < cells.size(); ++c)
        column_slot.push_back(slot_of(trimmed(cells[c]), at, "predicted class"));
      for (int slot = 0; slot < k; ++slot)
        if (const auto times = std::count(column_slot.begin(), column_slot.end(), slot); times != 1)
          problems.push_back(describe_mismatch(at, "column '" + classes.at_slot(slot).name + "'", "it once",
                                               "it " + std::to_string(times) + " times"));
      if (column_slot.empty()) break;
      continue;
    }
    const int row = slot_of(trimmed(cells[0]), at, "true class");
    if (cells.size() != column_slot.size() + 1) {
      problems.push_back(
          describe_mismatch(at, "cells", std::to_string(column_slot.size() + 1), std::to_string(cells.size())));
      continue;
    }
    if (row >= 0 && has_row[row])
      problems.push_back(describe_mismatch(at, "true class", "each class once", quoted(trimmed(cells[0])) + " again"));
    if (row >= 0) has_row[row] = true;
    for (size_t c = 1; c < cells.size(); ++c) {
      const auto value = number(trimmed(cells[c]));
      if (!value)
        problems.push_back(
            describe_mismatch(at, "cell " + std::to_string(c + 1), "a number", quoted(trimmed(cells[c]))));
      if (value && row >= 0 && column_slot[c - 1] >= 0) rows[size_t(row) * k + column_slot[c - 1]] = *value;
    }
  }
  for (int slot = 0; slot < k; ++slot)
    if (!has_row[slot])
      problems.push_back(describe_mismatch(where, "row '" + classes.at_slot(slot).name + "'", "it once", "none"));
  if (!problems.empty()) throw ConfigError(problems);
  return confusion_matrix(std::move(rows), k, where);
}

ConfusionMatrix read_confusion_matrix(const std::filesystem::path& file, const ClassTable& classes) {
  constexpr std::streamsize kLargest = 64 << 20;  // 1000 classes with 17 digits each are 20 MB
  std::ifstream in(file, std::ios::binary);
  if (!in) throw IoError(file.string() + ": cannot be opened for reading");
  std::string text(size_t(std::min<std::uintmax_t>(std::filesystem::file_size(file), kLargest)), '\0');
  in.read(text.data(), std::streamsize(text.size()));
  text.resize(size_t(in.gcount()));
  return parse_confusion_matrix(text, classes, file.string());
}

std::string confusion_csv(const ConfusionMatrix& confusion, const ClassTable& classes) {
  std::string text = "true\\predicted";
  for (int j = 0; j < confusion.k; ++j) text += "," + classes.at_slot(j).name;
  text += "\n";
  for (int i = 0; i < confusion.k; ++i) {
    text += classes.at_slot(i).name;
    for (const double p : confusion.row(i)) {
      char cell[32];
      std::snprintf(cell, sizeof cell, ",%.17g", p);
      text += cell;
    }
    text += "\n";
  }
  return text;
}

}  // namespace felt
