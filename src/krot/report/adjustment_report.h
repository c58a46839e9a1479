#pragma once

#include <string>

#include "krot/pipeline/adjust_model.h"
#include "krot/report/run_record.h"

namespace krot::internal {

// What one run of `krot bundle_adjuster` did.
struct AdjustmentReport {
  RunRecord run;
  AdjustModelSummary summary;
};

// For the terminal: errors before and after, what took part, why it ended.
std::string AdjustmentTable(const AdjustmentReport& report);

// report.json; the keys are listed in docs/cli.md. What is not known is null.
std::string AdjustmentJson(const AdjustmentReport& report);

// Why there is no model below the cap, with the bound that proves it if one
// does. Requires the termination kInfeasibleStart.
std::string NoModelBelowCapSentence(const AdjustModelSummary& summary);

// "nothing to adjust: ...". Requires the termination kNothingToAdjust.
std::string NothingToAdjustSentence(const BundleAdjustmentSummary& summary);

// As report.json has it: "converged", "max_iterations", ...
std::string AdjustmentTerminationName(BundleAdjustmentTermination termination);

}  // namespace krot::internal
