#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <vector>

#include "krot/conic/interior_point.h"
#include "krot/joint/joint.h"
#include "krot/joint/working_set.h"
#include "krot/problem/cost.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/problem/subset.h"
#include "krot/proof/certificate.h"

namespace krot::internal {

// Told of every iteration, of which only gap and target are filled in.
using IterationReport = std::function<void(const JointIteration&)>;

// Whether some depth is so small beside the median that coordinates do not
// resolve it. O(observations).
bool HasPointsInCameras(const KnownRotationProblem& problem,
                        const Estimate& estimate);

// The interior point on a connected problem, from an estimate to the certified
// gap: it tries certificates on the way and leaves starts that hold it back.
// Internal to SolveJoint.
class CertifiedSolve {
 public:
  // Takes an estimate on the way; whether it is worth while to go on from there
  // towards a proof.
  using TakeEstimate = std::function<bool(const Estimate&)>;

  // Keeps a reference to `problem`. All depths of `start` are positive. A cost
  // that is as low as `known_bound`, pixels, allows is low enough. Known
  // multipliers are a similar problem's, zero where unknown, or empty; its
  // optimum was about `known_optimum`, pixels.
  CertifiedSolve(const KnownRotationProblem& problem,
                 const JointOptions& options, const Context& context,
                 const Estimate& start, double known_bound,
                 std::vector<Multiplier> known_multipliers,
                 double known_optimum);

  // Takes at most `max_iterations`, except for those towards a fresh start,
  // which it ends once begun. Hands an estimate to `take` now and then, and
  // before every certificate that it tries, and ends as kStalled if it is not
  // worth while to go on.
  JointTermination Run(int max_iterations, const TakeEstimate& take,
                       const IterationReport& report);

  // The best so far, never worse than the start, and its cost in pixels.
  const Estimate& estimate() const { return estimate_; }
  double cost() const { return cost_; }
  // What the certificate proves, pixels; without one, the known bound.
  double lower_bound() const { return lower_bound_; }
  const std::optional<Certificate>& certificate() const { return certificate_; }
  // Of the interior point's last run; empty if there was none.
  const std::vector<Multiplier>& multipliers() const { return multipliers_; }
  // Where that would have come to, pixels; no bound.
  double likely_optimum() const { return (1 - gap_) * cost_; }
  // Those towards a fresh start included.
  int iterations() const { return iterations_; }

 private:
  bool IsGapReached() const {
    return cost_ - lower_bound_ <= options_.relative_gap * cost_ ||
           IsLowEnough();
  }
  double WarmMargin() const;
  bool IsLowEnough() const {
    return cost_ <= options_.sufficient_cost || IsZeroUpToRounding(cost_);
  }
  InteriorPointTermination RunFrom(Estimate start, double start_margin,
                                   const TakeEstimate& take,
                                   const IterationReport& report);
  FeasibleStartOptions OptionsForStart(const IterationReport& report);
  bool LeaveCameras(const IterationReport& report, Estimate* start);
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
  bool are_multipliers_known_;  // to the next run
  int iterations_ = 0;
  int max_iterations_ = 0;
  double width_ = 0;       // of the next bisection, relative
  double fresh_cost_ = 0;  // of the last estimate that was found near the cost
  double gap_ = 0;         // of the interior point, where its last run ended
  const double known_optimum_;
  bool is_given_up_ = false;
};

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
