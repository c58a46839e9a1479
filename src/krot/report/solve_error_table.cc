#include "krot/report/solve_error_table.h"

#include <vector>

#include "krot/report/text_table.h"

namespace krot {
namespace {

std::string PolishSentence(const SolveSummary& summary) {
  if (!summary.polish) return "";
  return std::string("The model written is the polished one (least squares, ") +
         PolishName(summary.polish->polish) +
         "); cost, bound and support are those of the one before, whose "
         "maximum it no longer has.\n";
}

}  // namespace

std::string SolveErrorTable(const SolveSummary& summary) {
  const PixelErrorStatistics& before = summary.pixel_error_before;
  const PixelErrorStatistics& after = summary.pixel_error_after;
  TextTable table;
  std::vector<std::string> head = {"pixels", "before", "after"};
  if (summary.polish) head.push_back("polished");
  table.AddRow(head);
  const auto add = [&](const char* name, double PixelErrorStatistics::*error) {
    std::vector<std::string> row = {name, FormatNumber(before.*error, 4),
                                    FormatNumber(after.*error, 4)};
    if (summary.polish) {
      row.push_back(FormatNumber(summary.polish->pixel_error.*error, 4));
    }
    table.AddRow(row);
  };
  add("max error", &PixelErrorStatistics::max);
  add("P99 error", &PixelErrorStatistics::p99);
  add("mean error", &PixelErrorStatistics::mean);
  add("RMS error", &PixelErrorStatistics::rms);
  table.AddRow({"cost (max, linearised)", FormatNumber(summary.cost_initial, 4),
                FormatNumber(summary.cost_final, 4)});
  return table.ToString() + PolishSentence(summary);
}

}  // namespace krot
