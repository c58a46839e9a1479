#include "krot/report/text_table.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>
#include <utility>

namespace krot::internal {

void TextTable::AddRow(std::vector<std::string> cells) {
  rows_.push_back(std::move(cells));
}

std::string TextTable::ToString() const {
  std::vector<size_t> widths;
  for (const std::vector<std::string>& row : rows_) {
    widths.resize(std::max(widths.size(), row.size()), 0);
    for (size_t column = 0; column < row.size(); ++column) {
      widths[column] = std::max(widths[column], row[column].size());
    }
  }
  std::string text;
  for (const std::vector<std::string>& row : rows_) {
    text += "  ";
    for (size_t column = 0; column < row.size(); ++column) {
      const std::string padding(widths[column] - row[column].size(), ' ');
      const bool is_last = column + 1 == row.size();
      if (column == 0) {
        text += row[column] + (is_last ? "" : padding);
      } else {
        text += "  " + padding + row[column];
      }
    }
    text += '\n';
  }
  return text;
}

std::string FormatNumber(double value, int decimals) {
  if (!std::isfinite(value)) return "-";
  std::ostringstream text;
  text << std::fixed << std::setprecision(decimals) << value;
  return text.str();
}

std::string Scientific(double value) {
  if (!std::isfinite(value)) return "-";
  std::ostringstream text;
  text << std::scientific << std::setprecision(1) << value;
  return text.str();
}

std::string FormatLength(double value) {
  if (!std::isfinite(value)) return "-";
  std::ostringstream text;
  text << std::setprecision(4) << value;
  return text.str();
}

std::string Counted(int64_t count, const std::string& noun) {
  return std::to_string(count) + " " + noun + (count == 1 ? "" : "s");
}

std::string Thousands(int64_t count) {
  std::string digits = std::to_string(count);
  for (std::ptrdiff_t n = static_cast<std::ptrdiff_t>(digits.size()) - 3; n > 0;
       n -= 3) {
    digits.insert(static_cast<size_t>(n), ",");
  }
  return digits;
}

std::string FormatBytes(int64_t bytes) {
  static const char* const kUnits[] = {"B", "kB", "MB", "GB", "TB"};
  double value = static_cast<double>(bytes);
  int unit = 0;
  // Of 999.95 and more one decimal would be 1000.0.
  while (value >= (unit == 0 ? 1000 : 999.95) && unit < 4) {
    value /= 1000;
    ++unit;
  }
  return FormatNumber(value, unit == 0 ? 0 : 1) + " " + kUnits[unit];
}

void AddErrorHead(const std::string& name, TextTable* table) {
  table->AddRow({name, "observations", "max", "P99", "mean", "RMS"});
}

void AddErrorRow(const std::string& name, const PixelErrorStatistics& errors,
                 TextTable* table) {
  if (errors.count == 0) {
    table->AddRow({name, "0", "-", "-", "-", "-"});
    return;
  }
  table->AddRow({name, std::to_string(errors.count),
                 FormatNumber(errors.max, 4), FormatNumber(errors.p99, 4),
                 FormatNumber(errors.mean, 4), FormatNumber(errors.rms, 4)});
}

void AddErrorColumns(const std::vector<PixelErrorStatistics>& estimates,
                     TextTable* table) {
  const auto add = [&](const char* name, double PixelErrorStatistics::*error) {
    std::vector<std::string> row = {name};
    for (const PixelErrorStatistics& errors : estimates) {
      row.push_back(FormatNumber(errors.*error, 4));
    }
    table->AddRow(row);
  };
  add("max error", &PixelErrorStatistics::max);
  add("P99 error", &PixelErrorStatistics::p99);
  add("mean error", &PixelErrorStatistics::mean);
  add("RMS error", &PixelErrorStatistics::rms);
}

std::string NotFiniteSentence(const PixelErrorStatistics& errors) {
  if (errors.not_finite == 0) return "";
  return Counted(errors.not_finite, "observation") +
         " without a finite error (behind the camera, no pose, or not "
         "projectable), in no row above.\n";
}

}  // namespace krot::internal
