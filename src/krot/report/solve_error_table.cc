#include "krot/report/solve_error_table.h"

#include <vector>

#include "krot/report/error_rows.h"
#include "krot/report/solve_report.h"
#include "krot/report/text_table.h"

namespace krot::internal {
namespace {

std::string PolishSentence(const SolveSummary& summary) {
  if (!summary.polish) return "";
  return std::string("The model written is the polished one (least squares, ") +
         PolishName(summary.polish->polish) +
         "); cost, bound and support are those of the one before, whose "
         "maximum it no longer has.\n";
}

// The cost, unless it is the maximum that is there already.
void AddCost(const SolveSummary& summary, TextTable* table) {
  if (summary.is_given_back || CostIsMaximum(summary)) return;
  table->AddRow({"cost (max optimised, p = " + NormName(summary.norm) + ")",
                 FormatNumber(summary.cost_initial, 4),
                 FormatNumber(summary.cost_final, 4)});
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

}  // namespace krot::internal
