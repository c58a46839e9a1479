#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <vector>

#include "krot/joint/certified_solve.h"
#include "krot/joint/joint.h"
#include "krot/joint/known_multipliers.h"
#include "krot/joint/working_set.h"
#include "krot/problem/cost.h"
#include "krot/problem/subset.h"

namespace krot::internal {

// A connected component on its way to its certified optimum, by way of the
// optima of growing working sets. Internal to SolveJoint.
//
// Where ranks share the points the first one solves the working sets; all find
// out what does not fit in below, and have the same estimate, bound and
// certificate, whose observations are numbered through the whole.
class ComponentSolve {
 public:
  // `known` are multipliers of a similar problem with the same observations,
  // and then the last working set's.
  ComponentSolve(const KnownRotationProblem& problem,
                 const JointOptions& options, const Context& context,
                 const Estimate& start, KnownMultipliers* known);

  // `report` is called after every iteration, with all but the time filled in.
  JointTermination Run(const IterationReport& report);

  const Estimate& estimate() const { return estimate_; }
  double cost() const { return std::min(cost_, reached_); }
  double lower_bound() const { return lower_bound_; }
  const std::optional<Certificate>& certificate() const { return certificate_; }
  int64_t num_working_observations() const { return num_working_observations_; }

 private:
  double CostOf(const Estimate& estimate) const {
    return MaxOfRanks(context_, Cost(problem_, estimate, options_.norm,
                                     context_.num_threads));
  }
  bool IsGapReached() const {
    return cost_ - lower_bound_ <= options_.relative_gap * cost_ ||
           IsLowEnough();
  }
  bool IsLowEnough() const {
    return cost_ <= options_.sufficient_cost || IsZeroUpToRounding(cost_);
  }
  // Where a working set is solved.
  struct Place {
    const KnownRotationProblem& problem;  // has all of it
    const Estimate& best;                 // of that problem, so far
    Estimate* candidate;                  // likewise
    std::function<bool()> fit_others;     // FitOthers of the candidate
    // Its observations in the whole; null: called the same.
    const std::vector<int64_t>* in_whole;

    std::vector<int64_t> InWhole(const ProblemSubset& part) const;
  };

  JointTermination SolveOrTake(const IterationReport& report,
                               Estimate* candidate);
  JointTermination SolveWorkingSet(const IterationReport& report,
                                   Estimate* candidate);
  JointTermination SolveGathered(const IterationReport& report,
                                 Estimate* candidate);
  JointTermination SolveParts(const Place& place,
                              std::vector<int64_t> observations,
                              const IterationReport& report);
  JointTermination SolvePart(const Place& place, const ProblemSubset& part,
                             const IterationReport& report);
  bool FitOthers(Estimate* candidate);
  void Keep(const Estimate& candidate);

  const KnownRotationProblem& problem_;
  const JointOptions options_;
  const Context context_;
  Estimate estimate_;  // the best so far
  double cost_ = 0;
  KnownMultipliers& known_;  // named as in the whole
  WorkingSet set_;
  // By a solve of all points that is under way.
  double reached_ = std::numeric_limits<double>::infinity();
  double level_ = 0;  // the cost of the working set's solution, pixels
  bool do_others_fit_ = false;  // when that was last tried
  double lower_bound_ = 0;
  std::optional<Certificate> certificate_;
  int iterations_ = 0;
  int64_t num_working_observations_ = 0;
};

}  // namespace krot::internal
