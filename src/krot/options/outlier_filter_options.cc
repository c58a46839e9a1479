#include "krot/options/outlier_filter_options.h"

#include <string>

#include "krot/options/finish_options.h"
#include "krot/options/option_error.h"
#include "krot/options/solve_options.h"

namespace krot::internal {

void AddOutlierFilterOptions(OutlierFilterOptions* options, Context* context,
                             OptionTable* table) {
  table->Add({"OutlierFilter.max_error",
              "The bound for all errors; without it, what noise does not "
              "explain is removed",
              "a number > 0, pixels", "", false,
              [options](const std::string& text) {
                double value = 0;
                if (!ParseReal(text, &value) || !(value > 0)) return false;
                options->max_error = value;
                return true;
              }});
  table->AddNamed<OutlierMethod>(
      "OutlierFilter.method", &options->method,
      {{"conflicts", OutlierMethod::kConflicts},
       {"threshold", OutlierMethod::kThreshold},
       {"snooping", OutlierMethod::kSnooping}},
      "conflicts: remove few for the bound; threshold: remove what is above "
      "it, solve, and repeat, for comparison; snooping, the default without "
      "max_error and profile_path: remove what noise does not explain");
  AddFinishLoss(&options->solve, table);
  table->AddReal("Solver.relative_gap", &options->solve.joint.relative_gap,
                 Above(0.0),
                 "How far the largest error of what is left may be above the "
                 "proved bound, relative to it");
  AddSameImage(&options->solve.problem, table);
  table->AddThreads("Solver.num_threads", &context->num_threads,
                    "the result is the same, bit by bit");
}

void ResolveOutlierFilterOptions(const OptionTable& table, bool makes_profile,
                                 OutlierFilterOptions* options) {
  if (!options->max_error && !makes_profile &&
      !table.IsGiven("OutlierFilter.method")) {
    options->method = OutlierMethod::kSnooping;
  }
  if (options->method == OutlierMethod::kSnooping) {
    for (const char* name : {"OutlierFilter.max_error", "Solver.relative_gap",
                             "Problem.same_image"}) {
      table.Refuse(name, "with --OutlierFilter.method snooping");
    }
  }
  if (options->method == OutlierMethod::kThreshold && !options->max_error) {
    throw OptionError(
        "--OutlierFilter.max_error is required with --OutlierFilter.method "
        "threshold");
  }
  CheckFinishLoss(options->solve, table);
}

}  // namespace krot::internal
