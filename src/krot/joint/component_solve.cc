#include "krot/joint/component_solve.h"

#include <cmath>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/LU>

#include "krot/base/parallel_for.h"
#include "krot/geometry/transform.h"
#include "krot/joint/joint.h"
#include "krot/problem/cost.h"
#include "krot/problem/gauge.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/problem/subset.h"
#include "krot/proof/certificate.h"
#include "krot/sweeps/res_int.h"

namespace krot::internal {
namespace {

// The share of the gap asked for that a working set's own proof may leave. The
// rest is how far other points may exceed the set's cost.
constexpr double kShareOfGapForProof = 0.5;

// Whether known multipliers may be used as a start. Where only tiny baselines
// set the scale, stationarity in the scale is reached last, and from a start
// off the central path perhaps never.
bool CanStartWarm(const KnownRotationProblem& problem,
                  const Estimate& estimate) {
  return IsScaleFree(problem) ||
         std::max(FixedExtent(problem), LongestBaseline(problem)) >=
             kTinyBaseline * MedianDepth(problem, estimate);
}

// Broadcasts the first rank's certificate of a gathered part to every rank,
// with observation indices of the whole.
std::optional<Certificate> InWhole(const GatheredPart& part,
                                   std::optional<Certificate> certificate,
                                   Ranks* ranks) {
  char is_there = certificate.has_value();
  ranks->Broadcast(&is_there);
  if (!is_there) return std::nullopt;
  Certificate in_whole = certificate.value_or(Certificate());
  for (CertifiedObservation& o : in_whole.observations) {
    o.observation = part.in_whole()[o.observation];
  }
  ranks->Broadcast(&in_whole.lower_bound);
  ranks->Broadcast(&in_whole.defect);
  ranks->Broadcast(&in_whole.observations);
  return in_whole;
}

// Puts the points that are behind a camera where they are nearest to their
// rays, if that is in front of all.
void PutInFront(const KnownRotationProblem& problem, const Context& context,
                Estimate* estimate) {
  const std::vector<AffineMap> cameras =
      CamerasFromWorld(problem, estimate->translations);
  ParallelForEach(problem.num_points, context.num_threads, [&](int64_t k) {
    if (problem.IsFixedPoint(static_cast<int32_t>(k))) return;
    const auto is_in_front = [&](const Eigen::Vector3d& position) {
      for (const int64_t i : problem.OfPoint(k)) {
        const Observation& o = problem.observations[i];
        if (!(ViewPoint(cameras[o.view], o, position).depth > 0)) return false;
      }
      return true;
    };
    if (is_in_front(estimate->points[k])) return;
    NearestPoint nearest;
    for (const int64_t i : problem.OfPoint(k)) {
      const Observation& o = problem.observations[i];
      const AffineMap& camera = cameras[o.view];
      const Eigen::Vector3d ray =
          camera.leftCols<3>().transpose() * o.E.inverse().col(0);
      nearest.Add(CentreOf(camera), ray.normalized(), 1);
    }
    const std::optional<Eigen::Vector3d> position = nearest.Solve();
    if (position && is_in_front(*position)) estimate->points[k] = *position;
  });
}

}  // namespace

bool PlacePoints(const KnownRotationProblem& problem, Norm norm,
                 const Context& context, double level, Estimate* estimate) {
  PutInFront(problem, context, estimate);
  BlockSweep blocks(problem, FastDescentOptions(), norm, context);
  DescentGoal goal;
  goal.level = level;
  // Less than the share above which a working set takes points in
  // (ComponentSolve::Run).
  goal.sufficient = 0.7 * level;
  blocks.SetGoal(goal);
  return std::isfinite(blocks.IntersectPoints(estimate));
}

bool ExtendSolution(const KnownRotationProblem& problem, Norm norm,
                    const Context& context, double level, double highest,
                    Estimate* estimate) {
  if (!PlacePoints(problem, norm, context, level, estimate)) return false;
  const auto excess = [&] {
    return MaxOfRanks(context,
                      Cost(problem, *estimate, norm, context.num_threads)) -
           highest;
  };
  double left = excess();
  if (left <= 0) return true;
  // Blocks well below the highest cost allowed stay. Sweeps end where one takes
  // less than a fifth off the excess.
  BlockSweep blocks(problem, FastDescentOptions(), norm, context);
  blocks.SetGoal({/*tolerance=*/1e-3, /*level=*/0.9 * highest});
  for (int sweep = 0; sweep < 10; ++sweep) {
    blocks.ResectFrames(estimate);
    blocks.IntersectPoints(estimate);
    const double before = std::exchange(left, excess());
    if (left <= 0) return true;
    if (left > 0.8 * before) return false;
  }
  return false;
}

ComponentSolve::ComponentSolve(const KnownRotationProblem& problem,
                               const JointOptions& options,
                               const Context& context, const Estimate& start,
                               KnownMultipliers* known)
    : problem_(problem),
      options_(options),
      context_(context),
      estimate_(start),
      cost_(CostOf(start)),
      known_(*known),
      set_(FirstWorkingSet(problem, start, options.norm, cost_, context)) {}

std::vector<int64_t> ComponentSolve::Place::InWhole(
    const ProblemSubset& part) const {
  std::vector<int64_t> names(part.problem().observations.size());
  std::iota(names.begin(), names.end(), 0);
  names = part.InWhole(std::move(names));
  if (in_whole != nullptr) {
    for (int64_t& name : names) name = (*in_whole)[name];
  }
  return names;
}

// Solves one connected part of the working set. If other points exceed its
// cost, the solve ends without a proof: the set needs more points first.
SolveTermination ComponentSolve::SolvePart(const Place& place,
                                           const ProblemSubset& part,
                                           const IterationReport& report) {
  JointOptions options = options_;
  if (!set_.IsAll()) options.relative_gap *= kShareOfGapForProof;
  const Context here = WithoutRanks(context_);
  const Estimate start = part.Restrict(place.start);
  const std::vector<int64_t> names = place.InWhole(part);
  CertifiedSolve solve(part.problem(), options, here, start, lower_bound_,
                       CanStartWarm(part.problem(), start)
                           ? known_.Of(names)
                           : std::vector<Multiplier>(),
                       known_.optimum());
  // A part whose cost is below the bound of another one is good enough.
  if (solve.cost() <= lower_bound_) return SolveTermination::kGapReached;
  if (iterations_ >= options_.max_iterations) {
    return SolveTermination::kMaxIterations;
  }
  const auto replace = [&](Estimate optimum) {
    RestoreGaugeIfHarmless(part.problem(), start, options_.norm, here,
                           &optimum);
    part.Replace(optimum, place.candidate);
  };
  const SolveTermination termination = solve.Run(
      options_.max_iterations - iterations_,
      [&](const Estimate& estimate) {
        replace(estimate);
        do_others_fit_ = place.fit_others();
        return do_others_fit_;
      },
      [&](const JointIteration& iteration) {
        if (set_.IsAll()) reached_ = std::min(reached_, solve.cost());
        report(iteration);
      });
  iterations_ += solve.iterations();
  if (!solve.multipliers().empty()) {
    known_.Keep(names, solve.multipliers(), solve.likely_optimum());
  }
  if (solve.lower_bound() > lower_bound_) {
    lower_bound_ = solve.lower_bound();
    certificate_ = InWhole(part, *solve.certificate());
  }
  if (do_others_fit_) replace(solve.estimate());
  return termination;
}

SolveTermination ComponentSolve::SolveParts(const Place& place,
                                            std::vector<int64_t> observations,
                                            const IterationReport& report) {
  SolveTermination worst = SolveTermination::kGapReached;
  for (std::vector<int64_t>& part :
       SplitIntoComponents(place.problem, std::move(observations))) {
    const SolveTermination termination =
        SolvePart(place, ProblemSubset(place.problem, std::move(part)), report);
    if (termination == SolveTermination::kGapReached) continue;
    worst = termination;
    if (termination != SolveTermination::kStalled || !do_others_fit_) break;
  }
  return worst;
}

// Starts from the last set's solution unless what it leaves of other points is
// above the gamma at which the interior point would start from the best
// estimate.
SolveTermination ComponentSolve::SolveWorkingSet(const IterationReport& report,
                                                 Estimate* candidate) {
  std::vector<int64_t> observations = set_.Observations();
  num_working_observations_ =
      SumOfRanks(context_, static_cast<int64_t>(observations.size()));
  do_others_fit_ = true;
  const bool is_near = CostOf(*candidate) < (1 + kStartMargin) * cost_;
  const Estimate start = is_near ? *candidate : estimate_;
  if (context_.ranks != nullptr) return SolveGathered(start, report, candidate);
  return SolveParts({problem_, start, candidate,
                     [&] { return FitOthers(candidate); }, nullptr},
                    std::move(observations), report);
}

// SolveWorkingSet where ranks share the points. The first rank solves the set;
// whenever it calls fit_others, all ranks take part in FitOthers.
SolveTermination ComponentSolve::SolveGathered(const Estimate& start,
                                               const IterationReport& report,
                                               Estimate* candidate) {
  Ranks& ranks = *context_.ranks;
  const GatheredPart gathered(problem_, set_.Observations(), &ranks);
  const Estimate start_here = gathered.Collect(start);
  Estimate moved = gathered.Collect(*candidate);
  const auto fit_others = [&] {
    gathered.Scatter(moved, candidate);
    const bool do_fit = FitOthers(candidate);
    moved = gathered.Collect(*candidate);
    return do_fit;
  };
  const auto is_asked = [&](char is_asked_here) {
    ranks.Broadcast(&is_asked_here);
    return is_asked_here != 0;
  };
  std::optional<Certificate> earlier =
      std::exchange(certificate_, std::nullopt);
  SolveTermination termination = SolveTermination::kNotRun;
  if (ranks.IsFirst()) {
    std::vector<int64_t> all(gathered.in_whole().size());
    std::iota(all.begin(), all.end(), 0);
    const Place place = {gathered.problem(), start_here, &moved,
                         [&] { return is_asked(1) && fit_others(); },
                         &gathered.in_whole()};
    termination = SolveParts(place, std::move(all), report);
    is_asked(0);
  } else {
    while (is_asked(0)) fit_others();
  }
  gathered.Scatter(moved, candidate);
  ranks.Broadcast(&termination);
  ranks.Broadcast(&do_others_fit_);
  ranks.Broadcast(&iterations_);
  ranks.Broadcast(&lower_bound_);
  certificate_ = InWhole(gathered, certificate_, &ranks);
  if (!certificate_) certificate_ = std::move(earlier);
  return termination;
}

// Whether the working set's solution can be extended to all points such that
// none exceeds the set's cost by more than the gap allows.
bool ComponentSolve::FitOthers(Estimate* candidate) {
  level_ = set_.Cost(*candidate, options_.norm);
  const double highest =
      level_ / (1 - (1 - kShareOfGapForProof) * options_.relative_gap);
  const bool do_fit = ExtendSolution(problem_, options_.norm, context_, level_,
                                     highest, candidate);
  Keep(*candidate);
  return do_fit;
}

void ComponentSolve::Keep(const Estimate& candidate) {
  const double cost = CostOf(candidate);
  if (cost > cost_) return;
  cost_ = cost;
  estimate_ = candidate;
}

// Solves the working set, or reads its result from the checkpoint: it is a step
// of its own.
SolveTermination ComponentSolve::SolveOrTake(const IterationReport& report,
                                             Estimate* candidate) {
  SolveTermination termination = SolveTermination::kNotRun;
  std::vector<JointIteration> iterations;
  size_t num_reported = 0;
  RunStep(
      options_.checkpoint, context_,
      [&] {
        termination = SolveWorkingSet(
            [&](JointIteration iteration) {
              iteration.cost = cost();
              if (lower_bound_ > 0) iteration.lower_bound = lower_bound_;
              iterations.push_back(iteration);
              report(iterations[num_reported++]);
            },
            candidate);
        if (do_others_fit_) do_others_fit_ = FitOthers(candidate);
      },
      [&](StepValues* values) {
        values->Value(&termination);
        values->OnFirst(&iterations);
        NameValues(values, candidate);
        NameValues(values, &estimate_);
        values->Value(&cost_);
        values->Value(&reached_);
        values->Value(&level_);
        values->Value(&do_others_fit_);
        values->Value(&lower_bound_);
        NameValues(values, &certificate_);
        known_.NameValues(values);
        values->Value(&iterations_);
        values->Value(&num_working_observations_);
      });
  while (num_reported < iterations.size()) report(iterations[num_reported++]);
  return termination;
}

// A set takes in the points with residuals above 0.9 of its cost, the worst
// first, up to thrice its points; after twelve sets all of them.
SolveTermination ComponentSolve::Run(const IterationReport& report) {
  if (options_.IsLowEnough(cost_)) return SolveTermination::kGapReached;
  // With so few points per frame, ties alone would take in most of them.
  if (SumOfRanks(context_, problem_.num_points) <
      int64_t{10} * problem_.num_frames) {
    set_.AddAll();
  }
  Estimate candidate = estimate_;
  for (int round = 1;; ++round) {
    const SolveTermination termination = SolveOrTake(report, &candidate);
    if (IsGapReached()) return SolveTermination::kGapReached;
    if (set_.IsAll() || termination == SolveTermination::kInterrupted ||
        termination == SolveTermination::kMaxIterations) {
      return termination;
    }
    const int64_t num_added = set_.AddAbove(
        candidate, options_.norm, 0.9 * level_, 2 * set_.num_points() + 1,
        ShareOfLevel(problem_, candidate, context_));
    if (do_others_fit_ || num_added == 0 || round == 12) set_.AddAll();
  }
}

}  // namespace krot::internal
