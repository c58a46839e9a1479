#include "krot/report/solve_error_table.h"

#include <vector>

#include "krot/report/error_rows.h"
#include "krot/report/solve_report.h"
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

// The cost, unless it is the maximum that is there already: it is with p = 2 if
// every observation takes part.
void AddCost(const SolveSummary& summary, TextTable* table) {
  if (summary.is_given_back) return;
  const std::string before = FormatNumber(summary.cost_initial, 4);
  const std::string after = FormatNumber(summary.cost_final, 4);
  if (summary.norm.p == 2 &&
      before == FormatNumber(summary.pixel_error_before.max, 4) &&
      after == FormatNumber(summary.pixel_error_after.max, 4)) {
    return;
  }
  table->AddRow({"cost (max optimised, p = " + NormName(summary.norm) + ")",
                 before, after});
}

}  // namespace

std::string SolveErrorTable(const SolveSummary& summary) {
  std::vector<std::string> head = {"", "before", "after"};
  std::vector<PixelErrorStatistics> estimates = {summary.pixel_error_before,
                                                 summary.pixel_error_after};
  if (summary.polish) {
    head.push_back("polished");
    estimates.push_back(summary.polish->pixel_error);
  }
  TextTable table;
  table.AddRow(head);
  AddErrorColumns(estimates, &table);
  AddCost(summary, &table);
  return table.ToString() + PolishSentence(summary);
}

}  // namespace krot
