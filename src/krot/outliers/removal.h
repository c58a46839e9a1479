#pragma once

#include <cstdint>
#include <vector>

#include "krot/base/context.h"
#include "krot/bridge/bridge.h"
#include "krot/model/model.h"
#include "krot/outliers/decision.h"

namespace krot {

// Observations without which all others are within a bound.
struct Removal {
  std::vector<int64_t> observations;  // of the built problem, ascending
  // At which the true errors of all others are within the bound.
  Estimate estimate;
  // The observations that had a say in it: conflicts are to be looked for among
  // them. Ascending.
  std::vector<int64_t> tight;
};

// Few observations to remove, by the excess programme (conic/excess_program.h):
// solved, and solved again with weights that make those dear that exceed the
// bound by little, as long as that makes them fewer [Candes, Wakin, Boyd 2008];
// rows are taken anew each time. Points then take back what they can where the
// frames stand. Never more than are above the bound at built.start.
Removal FindRemoval(const Model& model, const BuiltProblem& built,
                    const ErrorBound& bound, const Context& context);

}  // namespace krot
