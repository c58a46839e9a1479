#pragma once

#include <string>

#include "krot/model.h"
#include "krot/report/run_record.h"
#include "krot/tolerance/tolerance_analysis.h"

namespace krot::internal {

// What one run of `krot tolerance_analyzer` found.
struct ToleranceReport {
  RunRecord run;
  ToleranceSummary summary;
  PixelErrorStatistics pixel_error_before;  // of the input
  PixelErrorStatistics pixel_error_after;   // of the model around which
};

// For the terminal: what holds place and scale, and the proved boxes; of more
// than `max_rows` those that are not bounded, then the widest.
std::string ToleranceTable(const ToleranceReport& report, int max_rows);

// report.json; the keys are listed in docs/cli.md. An end without a proof is
// null.
std::string ToleranceJson(const ToleranceReport& report);

// One line per coordinate behind a line of names (docs/formats.md).
std::string ToleranceCsv(const ToleranceSummary& summary);

}  // namespace krot::internal
