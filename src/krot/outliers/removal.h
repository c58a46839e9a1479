#pragma once

#include <cstdint>
#include <vector>

#include "krot/base/context.h"
#include "krot/bridge/bridge.h"
#include "krot/bridge/reprojection.h"
#include "krot/math/norm.h"
#include "krot/model.h"
#include "krot/outliers/decision.h"
#include "krot/outliers/near_set.h"

namespace krot::internal {

// Observations without which all others are within a bound.
struct Removal {
  std::vector<int64_t> observations;  // of the built problem, ascending
  // At which the true errors of all others are within the bound.
  Estimate estimate;
  // The observations that had a say in it: conflicts are to be looked for among
  // them. Ascending.
  std::vector<int64_t> tight;
};

// Few observations to remove, by the slack programme (conic/slack_program.h):
// solved with weights that make those dear that exceed the bound by little at
// the start, and again with those of the solution, as long as that makes them
// fewer [Candes, Wakin, Boyd 2008]; rows are taken anew each time. It looks at
// the observations that came near the bound so far; points then take back what
// they can where the frames stand. Never more than are above the bound at
// built.start.
//
// One bound after the other: each begins with the estimate and the weights that
// the last one ended with.
class RemovalSearch {
 public:
  // Keeps references.
  RemovalSearch(const Model& model, const BuiltProblem& built, Norm norm,
                const Context& context);

  // max_error in true pixels, > 0; solves at most so many programmes. Of 0 it
  // is what is above the bound at built.start, but for what points take back.
  Removal Find(double max_error, int max_programmes);

 private:
  double Error(const Estimate& estimate, int64_t i) const {
    return reprojection_.Error(estimate, norm_, i);
  }
  std::vector<double> Errors(const Estimate& estimate) const;
  std::vector<double> WeightsOfErrors() const;
  void SolveProgramme(double smallest_mu);
  void Excess(const std::vector<int64_t>& part, double smallest_mu);
  void Offer(Removal* best) const;
  bool TakeBack(Removal* best);

  const BuiltProblem& built_;
  const Norm norm_;
  const Context context_;
  const Reprojection reprojection_;
  double max_error_ = 0;
  KnownRotationProblem rows_;
  Estimate estimate_;           // of the last programme
  std::vector<double> errors_;  // there
  NearSet near_;
  std::vector<double> weights_;
  std::vector<char> is_tight_;
};

// With a bound alone.
inline constexpr int kMaxProgrammes = 16;
Removal FindRemoval(const Model& model, const BuiltProblem& built,
                    const ErrorBound& bound, const Context& context,
                    int max_programmes = kMaxProgrammes);

}  // namespace krot::internal
