#include "krot/options/outlier_filter_options.h"

#include <string>

#include "krot/options/solve_options.h"

namespace krot {

void AddOutlierFilterOptions(OutlierFilterOptions* options, Context* context,
                             OptionTable* table) {
  table->Add({"OutlierFilter.max_error",
              "The bound that all errors are to be within; without it what the "
              "model's own noise explains, and nothing is removed where it is "
              "not proved that some errors are above that",
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
       {"threshold", OutlierMethod::kThreshold}},
      "conflicts: few, by the least sum of excesses, and a proof of how many "
      "must go; threshold: what is above the bound, solve, and again, to "
      "compare with");
  table->AddReal("Solver.relative_gap", &options->solve.joint.relative_gap,
                 Above(0.0),
                 "How far the largest error of what is left may be above the "
                 "proved bound, relative to it");
  AddSameImage(&options->solve.problem, table);
  table->AddThreads("Solver.num_threads", &context->num_threads,
                    "the result is the same, bit by bit");
}

}  // namespace krot
