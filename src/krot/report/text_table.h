#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "krot/model.h"

namespace krot::internal {

// A text in a table, or a count, as it is.
struct TableCell {
  TableCell(std::string of) : text(std::move(of)) {}  // NOLINT
  TableCell(const char* of) : text(of) {}             // NOLINT
  template <typename Integer,
            typename = std::enable_if_t<std::is_integral_v<Integer>>>
  TableCell(Integer count) : text(std::to_string(count)) {}  // NOLINT

  std::string text;
};
using Row = std::vector<TableCell>;

// A table for a terminal. The first column is flush left, the others are flush
// right, with two spaces between columns; one line per row.
class TextTable {
 public:
  TextTable() = default;
  explicit TextTable(Row head) { AddRow(std::move(head)); }

  // Rows may have different lengths.
  void AddRow(Row row) { rows_.push_back(std::move(row)); }

  // Every line is indented and ends in '\n'.
  std::string ToString() const;

 private:
  std::vector<Row> rows_;
};

// A table with a row for each of the first `max_rows` items, which `row_of`
// makes of it.
template <typename Items, typename RowOf>
std::string TableOf(Row head, const Items& items, const RowOf& row_of,
                    size_t max_rows = SIZE_MAX) {
  TextTable table(std::move(head));
  for (const auto& item : items) {
    if (max_rows-- == 0) break;
    table.AddRow(row_of(item));
  }
  return table.ToString();
}

// The same below a line with the title; "" without rows.
template <typename Items, typename RowOf>
std::string TitledTable(const std::string& title, Row head, const Items& items,
                        size_t max_rows, const RowOf& row_of) {
  if (items.empty() || max_rows == 0) return "";
  return "\n" + title + "\n" +
         TableOf(std::move(head), items, row_of, max_rows);
}

// Pointers to the items for which `is_wanted` holds, in their order.
template <typename Item, typename Predicate>
std::vector<const Item*> PointersIf(const std::vector<Item>& items,
                                    const Predicate& is_wanted) {
  std::vector<const Item*> wanted;
  for (const Item& item : items) {
    if (is_wanted(item)) wanted.push_back(&item);
  }
  return wanted;
}

// The number with `decimals` digits after the point; "-" if there is none, or
// if it is not finite.
std::string FormatNumber(std::optional<double> value, int decimals);

// The number with two digits: "1.2e-05".
std::string Scientific(std::optional<double> value);

// A length in scene units, which may have any magnitude: four significant
// digits.
std::string FormatLength(std::optional<double> value);

// "0.1234 px", "0.12 s".
std::string Pixels(double value, int decimals = 4);
std::string Seconds(double value);

// The text if the condition holds, else "".
std::string TextIf(bool condition, const std::string& text);

// "1 point", "2 points".
std::string Counted(int64_t count, const std::string& noun);

// "1 point is", "2 points are", for these two verbs.
std::string Counted(int64_t count, const std::string& noun,
                    const std::string& verb_of_one,
                    const std::string& verb_of_more);

// The names, separated by commas; of more than `most` the first ones, and
// "...".
std::string ListText(std::vector<std::string> names, size_t most = SIZE_MAX);

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
Row ErrorHead(const std::string& name);
Row ErrorRow(const std::string& name, const PixelErrorStatistics& errors);

// A table whose columns are estimates of the same observations; its rows are
// the maximum, P99, mean and RMS.
void AddErrorColumns(const std::vector<PixelErrorStatistics>& estimates,
                     TextTable* table);

// For example "3 observations without a finite error ..., in no row above.\n";
// empty if all are finite.
std::string NotFiniteSentence(const PixelErrorStatistics& errors);

}  // namespace krot::internal
