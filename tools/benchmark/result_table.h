#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace krot::internal {

// One value of a table: as JSON, and as text for readers.
struct Cell {
  nlohmann::ordered_json value;
  std::string text;
};

Cell TextCell(const std::string& text);
Cell CountCell(int64_t count);
Cell RealCell(double value, int decimals);
// For times and ratios of any size: three significant digits, never in
// exponential notation. "-" if not finite.
Cell SizedCell(double value);
Cell ScientificCell(double value);
Cell MissingCell(const std::string& why = "n/a");  // null

// The measurements of a benchmark, one row per case.
struct ResultTable {
  std::string name;     // a key: "figure4"
  std::string caption;  // one sentence, without full stop
  std::vector<std::string> columns;
  std::vector<std::vector<Cell>> rows;  // as many cells as columns
  std::vector<std::string> notes;       // sentences below the table
  bool is_detail = false;               // collapsed in Markdown
};

std::string ToText(const ResultTable& table);
std::string ToMarkdown(const ResultTable& table);
// {"name", "caption", "columns", "rows": [{column: value}], "notes"}.
nlohmann::ordered_json ToJson(const ResultTable& table);

}  // namespace krot::internal
