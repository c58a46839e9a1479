#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "krot/base/checkpoint.h"
#include "krot/base/context.h"
#include "krot/conic/interior_point.h"
#include "krot/geometry.h"
#include "krot/problem/cost.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/proof/certificate.h"
#include "krot/solve.h"
#include "krot/verify/certificate_check.h"

namespace krot::internal {

// Multipliers that a solve leaves to the next, similar one for a warm start.
// They are of some of a problem's observations, which are named by increasing
// numbers. Only known multipliers take memory.
class KnownMultipliers {
 public:
  // Sets the multipliers of the observations `names`, which must ascend; others
  // stay. `optimum`, pixels, is the likely optimum of their solve.
  // O(known + names).
  void Keep(const std::vector<int64_t>& names,
            const std::vector<Multiplier>& multipliers, double optimum);

  // The optimum that was given to Keep last; 0 if it was never called.
  double optimum() const { return optimum_.empty() ? 0 : optimum_[0]; }

  // The multipliers of the observations `names`, which must ascend: zero where
  // unknown, and empty if none is known. O(known + names).
  std::vector<Multiplier> Of(const std::vector<int64_t>& names) const;

  // For a checkpoint. Where ranks share a problem, only the first one's count.
  void NameValues(StepValues* values) {
    values->OnFirst(&known_);
    values->OnFirst(&optimum_);
  }

 private:
  std::vector<CertifiedObservation> known_;
  std::vector<double> optimum_;  // one, if any
};

// Values that several steps of a checkpoint store.

inline void NameValues(StepValues* values, Estimate* estimate) {
  values->Values(&estimate->translations);
  values->Shared(&estimate->points);
}

inline void NameValues(StepValues* values,
                       std::optional<Certificate>* certificate) {
  values->Optional(certificate, [&](Certificate* c) {
    values->Value(&c->lower_bound);
    values->Value(&c->defect);
    values->Values(&c->observations);
  });
}

// The joint solver finds the global optimum of the known rotation problem, with
// a proof. It moves all frames and points at once by the interior point of
// conic/, one connected component after the other, until a certificate that
// CheckCertificate accepts shows the relative gap.

// An iteration of the interior point, either on the problem or, with a
// `target`, in the search for a start.
struct JointIteration {
  std::optional<double> cost;  // pixels, the best so far, if there is one
  std::optional<double> lower_bound;  // pixels, certified so far
  // The interior point's own relative gap: an estimate, not a bound.
  std::optional<double> gap;
  double seconds = 0;  // since the call
  // The search is for a start whose residuals are all below this, pixels.
  std::optional<double> target = std::nullopt;
};

// Called after every iteration, counted from 1.
using JointCallback =
    std::function<void(int iteration, const JointIteration& state)>;

struct JointOptions {
  Norm norm;                         // p = 1, 2 or infinity
  double relative_gap = 1e-4;        // (cost - lower_bound) / cost; > 0
  int max_iterations = 2000;         // per component; >= 1
  double sufficient_cost = 0;        // stops once it is reached, pixels; >= 0
  JointCallback callback;            // counts over all components; may be empty
  Checkpoint* checkpoint = nullptr;  // of working sets; may be null

  // Whether a cost, pixels, is low enough without a proof, and whether it is
  // with one of `lower_bound`.
  bool IsLowEnough(double cost_px) const {
    return cost_px <= sufficient_cost || IsZeroUpToRounding(cost_px);
  }
  bool IsGapReached(double cost_px, double lower_bound) const {
    return cost_px - lower_bound <= relative_gap * cost_px ||
           IsLowEnough(cost_px);
  }
};

struct JointSummary {
  // kGapReached: certified, or a cost that is zero up to rounding, or
  // sufficient. kStalled: rounding ended the progress before. Otherwise
  // kMaxIterations or kInterrupted.
  SolveTermination termination = SolveTermination::kNotRun;
  double cost_initial = 0;  // pixels
  double cost_final = 0;    // <= cost_initial
  // The highest certified bound of any component: also one of the whole.
  std::optional<Certificate> certificate;
  double lower_bound = 0;  // pixels, what the certificate proves; 0 if none
  // The size of the last working sets, over all components.
  int64_t num_working_observations = 0;
  std::vector<JointIteration> iterations;

  double RelativeGap() const {
    return cost_final > 0 ? (cost_final - lower_bound) / cost_final : 0;
  }
};

// Improves `estimate`, all of whose depths must be positive (throws
// std::invalid_argument otherwise, and for options out of range). The result is
// never worse than the start. Frames and points without observations stay.
// Takes about 600 bytes for each observation of a working set, beside the
// reduced camera system. If `known` is given and there is one component, it has
// multipliers of a similar problem with the same observations, which save
// iterations, and receives those of this problem.
JointSummary SolveJoint(const KnownRotationProblem& problem,
                        const JointOptions& options, const Context& context,
                        Estimate* estimate, KnownMultipliers* known = nullptr);

struct FeasibleStartOptions {
  Norm norm;
  // A depth that is small against the scene, scene units. It affects the path
  // of the iterations, not what is feasible. None: a share of the longest
  // baseline or distance of fixed positions, or 1 where the scale is free.
  std::optional<double> unit_depth;
  // A proved lower bound, pixels: LowerByFeasibility looks for nothing below.
  double known_bound = 0;
  // Gives up if the bound is not met once the programme's gap is below this; 0
  // means never.
  double hopeless_gap = 0;
  // Called after every iteration with the bound that is to be met, pixels; may
  // be empty.
  std::function<void(double bound)> callback;
};

// Finds, from nothing, an estimate of a connected problem whose residuals are
// all below `bound`, pixels: FindFeasible with a unit of depth that suits the
// problem's baselines. As that stays near the middle of the cones, the estimate
// is a good start for MinimizeJointly. `*estimate` is only written if one is
// found (kFeasible); otherwise `*multipliers` may prove that there is none
// (MakeInfeasibilityCertificate).
InteriorPointTermination FindEstimateBelow(
    const KnownRotationProblem& problem, double bound,
    const FeasibleStartOptions& options, const Context& context,
    Estimate* estimate, std::vector<Multiplier>* multipliers);

// Replaces an estimate by one at a quarter of its cost (FindEstimateBelow), as
// often as one is found. Each takes about five iterations.
void LowerByFeasibility(const KnownRotationProblem& problem,
                        const FeasibleStartOptions& options,
                        const Context& context, Estimate* estimate);

// A start from nothing but rotations and observations: the paper's "one
// bisection iteration at a loose upper bound" [Zhang18, Sec. 4.2].

struct InitializerOptions {
  Norm norm;               // p = 1, 2 or infinity
  double max_error = 100;  // the bound that the start must meet, pixels; > 0
  JointCallback callback;  // counts over all components; may be empty
};

struct InitializerSummary {
  // kWithinBound: every depth is positive, every residual below max_error;
  // kInfeasible: proved, no estimate does that; kNoStart: neither was shown, no
  // estimate was found at any bound; kInterrupted.
  SolveTermination termination = SolveTermination::kNotRun;
  std::vector<JointIteration> iterations;
  // kInfeasible: proves lower_bound > max_error.
  std::optional<Certificate> certificate;
  double lower_bound = 0;  // pixels, what it proves
};

// Finds an estimate whose residuals are all below max_error, by lowering it
// with LowerByFeasibility even far below, for one connected component after the
// other. `*estimate` is only written if one is found; points and frames without
// observations stay. Where nothing is fixed and baselines do not set the scale,
// components get a median depth of one. Throws std::invalid_argument for
// options out of range.
InitializerSummary FindStart(const KnownRotationProblem& problem,
                             const InitializerOptions& options,
                             const Context& context, Estimate* estimate);

// The observations of a problem that the joint solver looks at: those with
// residuals near the maximum, and enough others to tie every frame. The optimum
// of a working set is a lower bound on that of the whole. Both are equal if all
// other observations can have residuals below it as well.
//
// Where ranks share the points, each has its share of the set, and all ranks
// together have the set that one process would have. All must call the
// functions that are O(observations) together.
class WorkingSet {
 public:
  // Empty. Keeps a reference to `problem`.
  explicit WorkingSet(const KnownRotationProblem& problem,
                      const Context& context = {});

  // Adds points that have an observation outside of the set whose residual is
  // above `level`, pixels: the worst first, at most `max_points` of them.
  // Returns how many. Of each point it takes the observations above
  // `share` * `level`, but at least four if there are so many; with a share of
  // 0, all. O(observations).
  int64_t AddAbove(const Estimate& estimate, Norm norm, double level,
                   int64_t max_points, double share = 0);

  // Adds whole points, the longest tracks first, until every frame has `count`
  // observations in the set or all it has. O(observations).
  void AddTies(int count);

  void AddPoint(int32_t point);  // with all its observations
  void AddAll();

  // Whether the set has an observation of the point.
  bool Contains(int32_t point) const { return contains_[point] != 0; }
  bool IsAll() const { return num_observations_ == num_observations_of_whole_; }
  // Points of the whole set, over all ranks.
  int64_t num_points() const { return num_points_; }
  // Observations of this rank's share, ascending.
  std::vector<int64_t> Observations() const;
  // The largest residual of its observations, pixels. O(observations).
  double Cost(const Estimate& estimate, Norm norm) const;

 private:
  double LargestOutside(const std::vector<AffineMap>& cameras,
                        const Estimate& estimate, Norm norm, int32_t k) const;
  void Take(int64_t observation);
  void TakePoint(int32_t point);
  void CountTaken();

  const KnownRotationProblem& problem_;
  const Context context_;
  std::vector<char> contains_;  // per point
  std::vector<char> takes_;     // per observation
  // Counts of the set on this rank.
  int64_t num_points_here_ = 0;
  int64_t num_observations_here_ = 0;
  // Over all ranks: counts of the set, the number of all observations, and the
  // number of points on the ranks before this one.
  int64_t num_points_ = 0;
  int64_t num_observations_ = 0;
  int64_t num_observations_of_whole_;
  int64_t first_point_ = 0;
};

// The longest of the rigs' baselines, scene units; 0 if there are none.
double LongestBaseline(const KnownRotationProblem& problem);
// Baselines below this, relative to the median depth, hardly set the scale.
inline constexpr double kTinyBaseline = 1e-3;

// The `share` with which the joint solver calls AddAbove. It is 0 where the
// baselines that set the scale are tiny beside the depths: a few observations
// would determine the scale only up to rounding. O(observations); all ranks
// must call it.
double ShareOfLevel(const KnownRotationProblem& problem,
                    const Estimate& estimate, const Context& context);

// The working set with which the joint solver begins, at an estimate of
// positive depths whose cost is `cost`, pixels: points above 0.9 of the cost
// (AddAbove, with ShareOfLevel), and ties of every frame. O(observations).
WorkingSet FirstWorkingSet(const KnownRotationProblem& problem,
                           const Estimate& estimate, Norm norm, double cost,
                           const Context& context = {});

// Moves every point with a residual above `level`, pixels, towards the optimum
// of its largest residual with the frames fixed. A point behind a camera starts
// from where it is nearest to its rays; it stays if that is behind a camera,
// too. Returns whether there are no such points. O(observations).
bool PlacePoints(const KnownRotationProblem& problem, Norm norm,
                 const Context& context, double level, Estimate* estimate);

// Extends the solution of a working set, whose cost is `level`, to all other
// observations, so that no residual exceeds `highest` >= level, pixels. Points
// with residuals above `level` are moved by PlacePoints. If that does not
// suffice, sweeps move the frames and all points: the set's solution is seldom
// unique, and a point often stays above it because the set hardly determines
// one of its frames.
//
// Returns whether it succeeded; `estimate` keeps what was reached in any case.
// Fails if a point stays behind a camera. O(observations) per sweep.
bool ExtendSolution(const KnownRotationProblem& problem, Norm norm,
                    const Context& context, double level, double highest,
                    Estimate* estimate);

}  // namespace krot::internal
