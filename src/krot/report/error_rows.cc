#include "krot/report/error_rows.h"

namespace krot::internal {

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
