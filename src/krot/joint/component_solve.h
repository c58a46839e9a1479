#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <vector>

#include "krot/conic/interior_point.h"
#include "krot/joint/joint.h"
#include "krot/problem/cost.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/problem/subset.h"
#include "krot/proof/certificate.h"

namespace krot::internal {

// Called after every iteration, with only `gap` or `target` filled in.
using IterationReport = std::function<void(const JointIteration&)>;

// How far above the cost gamma is where the interior point starts without
// multipliers, relative.
inline constexpr double kStartMargin = 0.1;

// Whether a point is in a camera: its depth there is so small, compared with
// the median depth, that the digits of coordinates do not resolve it.
// O(observations).
bool HasPointsInCameras(const KnownRotationProblem& problem,
                        const Estimate& estimate);

// Whether the median depths of frames differ so much that a part of the problem
// is tiny beside another. O(observations).
bool HasTinyParts(const KnownRotationProblem& problem,
                  const Estimate& estimate);

// Solves a connected problem by the interior point, from an estimate to the
// certified gap. Tries certificates on the way, and begins again from another
// start where the interior point gets stuck. Internal to SolveJoint.
class CertifiedSolve {
 public:
  // Called with estimates on the way; returns whether it is worth going on
  // towards a proof.
  using TakeEstimate = std::function<bool(const Estimate&)>;

  // Keeps a reference to `problem`. All depths of `start` must be positive.
  // `known_bound`, pixels, is a bound that is proved already: a cost within the
  // gap of it is low enough. `known_multipliers` are those of a similar problem
  // whose optimum was about `known_optimum`, pixels; zero where unknown, or
  // empty.
  CertifiedSolve(const KnownRotationProblem& problem,
                 const JointOptions& options, const Context& context,
                 const Estimate& start, double known_bound,
                 std::vector<Multiplier> known_multipliers,
                 double known_optimum);

  // Takes at most `max_iterations`, but does not interrupt a search for a fresh
  // start. Calls `take` now and then, and before every certificate that it
  // tries; ends as kStalled if that returns false.
  SolveTermination Run(int max_iterations, const TakeEstimate& take,
                       const IterationReport& report);

  // The best so far, never worse than the start, and its cost in pixels.
  const Estimate& estimate() const { return estimate_; }
  double cost() const { return cost_; }
  // What the certificate proves, pixels; without one, the known bound.
  double lower_bound() const { return lower_bound_; }
  const std::optional<Certificate>& certificate() const { return certificate_; }
  // From the interior point's last run, or the known ones if there was none.
  const std::vector<Multiplier>& multipliers() const { return multipliers_; }
  // An estimate of the optimum from the last run's gap, pixels; no bound.
  double likely_optimum() const { return (1 - gap_) * cost_; }
  // Includes the iterations of searches for a fresh start.
  int iterations() const { return iterations_; }

 private:
  bool IsGapReached() const {
    return options_.IsGapReached(cost_, lower_bound_);
  }
  double WarmMargin() const;
  InteriorPointTermination RunFrom(Estimate start, double start_margin,
                                   const TakeEstimate& take,
                                   const IterationReport& report);
  FeasibleStartOptions OptionsForStart(const IterationReport& report);
  bool EvenOutParts(const IterationReport& report, Estimate* start);
  bool FindFreshStart(const IterationReport& report);
  bool Bisect(double width, const IterationReport& report);
  bool TryBelow(double bound, const IterationReport& report);
  void Adopt(std::optional<Certificate> certificate);

  const KnownRotationProblem& problem_;
  const JointOptions options_;
  const Context context_;
  Estimate estimate_;
  double cost_ = 0;
  double lower_bound_ = 0;
  std::optional<Certificate> certificate_;
  std::vector<Multiplier> multipliers_;
  bool are_multipliers_known_;  // the next run starts from multipliers_
  int iterations_ = 0;
  int max_iterations_ = 0;
  double width_ = 0;       // of the next bisection, relative
  double fresh_cost_ = 0;  // of the last fresh start found just below the cost
  double gap_ = 0;         // of the interior point, where its last run ended
  const double known_optimum_;
  bool is_given_up_ = false;
};

// Solves a connected component to its certified optimum by solving growing
// working sets. Internal to SolveJoint.
//
// Where ranks share the points, the first one solves the working sets, and all
// together find the points that exceed a set's cost. All have the same frames,
// bound and certificate; the certificate uses observation indices of the whole.
class ComponentSolve {
 public:
  // `known` are multipliers of a similar problem with the same observations;
  // they are replaced by those of the working sets that are solved.
  ComponentSolve(const KnownRotationProblem& problem,
                 const JointOptions& options, const Context& context,
                 const Estimate& start, KnownMultipliers* known);

  // `report` is called after every iteration, with all but the time filled in.
  SolveTermination Run(const IterationReport& report);

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
    return options_.IsGapReached(cost_, lower_bound_);
  }
  // The problem from which a working set is taken: the component itself or,
  // where ranks share the points, the set gathered on the first rank.
  struct Place {
    const KnownRotationProblem& problem;  // contains the working set
    const Estimate& start;                // of `problem`
    Estimate* candidate;                  // the one being solved, of `problem`
    std::function<bool()> fit_others;     // FitOthers of the candidate
    // Maps observations of `problem` to the whole's; null means identity.
    const std::vector<int64_t>* in_whole;

    std::vector<int64_t> InWhole(const ProblemSubset& part) const;
  };

  SolveTermination SolveOrTake(const IterationReport& report,
                               Estimate* candidate);
  SolveTermination SolveWorkingSet(const IterationReport& report,
                                   Estimate* candidate);
  SolveTermination SolveGathered(const Estimate& start,
                                 const IterationReport& report,
                                 Estimate* candidate);
  SolveTermination SolveParts(const Place& place,
                              std::vector<int64_t> observations,
                              const IterationReport& report);
  SolveTermination SolvePart(const Place& place, const ProblemSubset& part,
                             const IterationReport& report);
  bool FitOthers(Estimate* candidate);
  void Keep(const Estimate& candidate);

  const KnownRotationProblem& problem_;
  const JointOptions options_;
  const Context context_;
  Estimate estimate_;  // the best so far
  double cost_ = 0;
  KnownMultipliers& known_;  // with indices of the whole
  WorkingSet set_;
  // The best cost so far of a solve whose working set is everything.
  double reached_ = std::numeric_limits<double>::infinity();
  double level_ = 0;  // the cost of the working set's solution, pixels
  bool do_others_fit_ = false;  // what FitOthers returned last
  double lower_bound_ = 0;
  std::optional<Certificate> certificate_;
  int iterations_ = 0;
  int64_t num_working_observations_ = 0;
};

}  // namespace krot::internal
