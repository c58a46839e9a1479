#include "tools/benchmark/result_table.h"

#include <algorithm>
#include <cmath>

#include "krot/report/text_table.h"

namespace krot::internal {
namespace {

using Json = nlohmann::ordered_json;

Json NumberOrNull(double value) {
  return std::isfinite(value) ? Json(value) : Json();
}

std::string MarkdownRow(const std::vector<std::string>& cells) {
  std::string row = "|";
  for (const std::string& cell : cells) row += " " + cell + " |";
  return row + "\n";
}

std::vector<std::string> Texts(const std::vector<Cell>& cells) {
  std::vector<std::string> texts;
  for (const Cell& cell : cells) texts.push_back(cell.text);
  return texts;
}

}  // namespace

Cell TextCell(const std::string& text) { return {text, text}; }

Cell CountCell(int64_t count) { return {count, std::to_string(count)}; }

Cell RealCell(double value, int decimals) {
  return {NumberOrNull(value), FormatNumber(value, decimals)};
}

Cell SizedCell(double value) {
  if (!std::isfinite(value) || value == 0) return RealCell(value, 0);
  const int magnitude =
      static_cast<int>(std::floor(std::log10(std::abs(value))));
  return RealCell(value, std::max(0, 2 - magnitude));
}

Cell ScientificCell(double value) {
  return {NumberOrNull(value), Scientific(value)};
}

Cell MissingCell(const std::string& why) { return {nullptr, why}; }

std::string ToText(const ResultTable& table) {
  const auto row_of = [](const std::vector<std::string>& texts) {
    return Row(texts.begin(), texts.end());
  };
  TextTable text(row_of(table.columns));
  for (const std::vector<Cell>& row : table.rows) {
    text.AddRow(row_of(Texts(row)));
  }
  std::string result = table.caption + "\n" + text.ToString();
  for (const std::string& note : table.notes) result += "  " + note + "\n";
  return result;
}

std::string ToMarkdown(const ResultTable& table) {
  std::string text =
      table.is_detail ? "<details><summary>" + table.caption + "</summary>\n\n"
                      : table.caption + ":\n\n";
  text += MarkdownRow(table.columns) + "|";
  for (size_t column = 0; column < table.columns.size(); ++column) {
    text += column == 0 ? "---|" : "---:|";
  }
  text += "\n";
  for (const std::vector<Cell>& row : table.rows) {
    text += MarkdownRow(Texts(row));
  }
  for (const std::string& note : table.notes) {
    const bool looks_like_a_list = note.rfind("* ", 0) == 0;
    text += (looks_like_a_list ? "\n\\" : "\n") + note + "\n";
  }
  if (table.is_detail) text += "\n</details>\n";
  return text;
}

Json ToJson(const ResultTable& table) {
  Json rows = Json::array();
  for (const std::vector<Cell>& cells : table.rows) {
    Json row = Json::object();
    for (size_t column = 0; column < cells.size(); ++column) {
      row[table.columns[column]] = cells[column].value;
    }
    rows.push_back(row);
  }
  return {{"name", table.name},
          {"caption", table.caption},
          {"columns", table.columns},
          {"rows", rows},
          {"notes", table.notes}};
}

}  // namespace krot::internal
