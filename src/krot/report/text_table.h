#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "krot/model.h"

namespace krot::internal {

// A table for a terminal. The first column is flush left, the others are flush
// right, with two spaces between columns; one line per row.
class TextTable {
 public:
  // Rows may have different lengths.
  void AddRow(std::vector<std::string> cells);

  // Every line is indented and ends in '\n'.
  std::string ToString() const;

 private:
  std::vector<std::vector<std::string>> rows_;
};

// The number with `decimals` digits after the point; "-" if it is not finite.
std::string FormatNumber(double value, int decimals);

// The number with two digits: "1.2e-05".
std::string Scientific(double value);

// A length in scene units, which may have any magnitude: four significant
// digits.
std::string FormatLength(double value);

// "1 point", "2 points".
std::string Counted(int64_t count, const std::string& noun);

// A count with commas: "26,268".
std::string Thousands(int64_t count);

// With the unit that leaves one to three digits before the point: "1.5 MB".
std::string FormatBytes(int64_t bytes);

// The text in quotes; quotes in it are doubled.
inline std::string CsvText(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"') quoted += c;
    quoted += c;
  }
  return quoted + "\"";
}

// A table whose rows are sets of observations: their number and their errors.
void AddErrorHead(const std::string& name, TextTable* table);
void AddErrorRow(const std::string& name, const PixelErrorStatistics& errors,
                 TextTable* table);

// A table whose columns are estimates of the same observations; its rows are
// the maximum, P99, mean and RMS.
void AddErrorColumns(const std::vector<PixelErrorStatistics>& estimates,
                     TextTable* table);

// For example "3 observations without a finite error ..., in no row above.\n";
// empty if all are finite.
std::string NotFiniteSentence(const PixelErrorStatistics& errors);

}  // namespace krot::internal
