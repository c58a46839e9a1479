#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "krot/conic/interior_point.h"
#include "krot/joint/initializer.h"
#include "krot/joint/joint.h"
#include "krot/problem/cost.h"
#include "krot/problem/known_rotation_problem.h"
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
  double width_ = 0;  // of the next bisection, relative
  double gap_ = 0;    // of the interior point, where its last run ended
  const double known_optimum_;
  bool is_given_up_ = false;
};

}  // namespace krot::internal
