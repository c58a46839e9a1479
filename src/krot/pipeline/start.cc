#include "krot/pipeline/stages.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "krot/convert/reprojection.h"
#include "krot/geometry.h"
#include "krot/joint/component_solve.h"
#include "krot/joint/joint.h"
#include "krot/problem/cost.h"
#include "krot/problem/gauge.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

JointCallback LogIterations(const JointCallback& callback, const Timer& timer,
                            SolveSummary* summary) {
  return [callback, &timer, summary](int, const JointIteration& state) {
    summary->iterations.push_back(state);
    summary->iterations.back().seconds = timer.Seconds();
    if (!callback) return;
    callback(static_cast<int>(summary->iterations.size()),
             summary->iterations.back());
  };
}

namespace {

constexpr char kStartFromNothing[] = "a start from nothing";

int64_t NumObservations(const BuiltProblem& built, const Context& context) {
  return SumOfRanks(context,
                    static_cast<int64_t>(built.problem.observations.size()));
}

// Whether all images see the points from the same place, as in a model whose
// translations are all zero. Such a start is worse than any other. A rig with
// baselines has several such places.
bool CentresCoincide(const BuiltProblem& built) {
  const auto centre = [&](const View& view) -> Eigen::Vector3d {
    const RigidTransform cam_from_rig{view.cam_from_rig_rotation,
                                      view.cam_from_rig_translation};
    return Center({view.cam_from_world_rotation,
                   cam_from_rig * built.start.translations[view.frame]});
  };
  if (built.frame_of.size() < 2) return false;
  const Eigen::Vector3d first = centre(built.problem.views.front());
  for (size_t v = 0; v < built.image_of.size(); ++v) {
    if (centre(built.problem.views[v]) != first) return false;
  }
  return true;
}

// Whether the cameras are so far from their known positions that the model is
// no useful start.
bool IsFarFromPositions(const Model& model, const BuiltProblem& own,
                        const SolveModelOptions& options,
                        const Context& context) {
  if (own.positions.empty()) return false;
  const double cost =
      Reprojection(model, own)
          .TrueCost(own.start, options.norm, context.num_threads);
  return !(cost * LargestPositionRatio(own, own.start) <=
           options.init_max_error);
}

// Moves the model as a whole to where it keeps known positions best.
void MoveToPositions(const BuiltProblem& built, Estimate* estimate) {
  KnownRotationProblem of_model = built.problem;
  of_model.observations.clear();
  for (size_t i = 0; i < built.problem.observations.size(); ++i) {
    if (!built.HasPixel(static_cast<int64_t>(i))) continue;
    of_model.observations.push_back(built.problem.observations[i]);
  }
  IndexObservations(&of_model);
  std::vector<WantedPlace> places;
  for (const BuiltPosition& position : built.positions) {
    WantedPlace place;
    place.centre = position.region.centre;
    place.unit_from_world = position.unit_from_world;
    const Eigen::Vector3d offset = OffsetOf(built, *estimate, position);
    if (position.of == KnownPosition::Of::kImage) {
      place.frame = built.problem.views[position.index].frame;
      place.x = place.centre + offset;
    } else {
      place.point = position.index;
      place.x = place.centre - offset;
    }
    places.push_back(place);
  }
  MoveToPlaces(of_model, places, estimate);
}

BuiltProblem Build(const Model& model, const SolveModelOptions& options,
                   const Context& context, bool ignore_translations) {
  BuildProblemOptions build_options = options.problem;
  build_options.num_threads = context.num_threads;
  build_options.ignore_translations = ignore_translations;
  build_options.ranks = context.ranks;
  return BuildProblem(model, build_options);
}

}  // namespace

bool HasOwnStart(const BuiltProblem& own) {
  return !own.problem.observations.empty() && !CentresCoincide(own);
}

Start OwnStart(const Model& model, const SolveModelOptions& options,
               const Context& context) {
  Start start{Build(model, options, context, /*ignore_translations=*/false),
              SolveInit::kModel};
  BuiltProblem& built = start.built;
  if (!(LargestPositionRatio(built, built.start) > 1)) return start;
  const Reprojection reprojection(model, built);
  const auto cost = [&] {
    return reprojection.TrueCost(built.start, options.norm,
                                 context.num_threads);
  };
  const double before = cost();
  MoveToPositions(built, &built.start);
  start.has_lost_digits = cost() > (1 + kErrorRounding) * before;
  return start;
}

Start ChooseStart(const Model& model, const SolveModelOptions& options,
                  SolveMethod method, const Context& context) {
  Start own = OwnStart(model, options, context);
  const auto count = [&](LeftOut reason) {
    return SumOfRanks(context, own.built.left_out[static_cast<size_t>(reason)]);
  };
  const bool coincide = CentresCoincide(own.built);
  const bool asked = options.init == SolveInit::kFeasible;
  const bool is_far =
      !coincide && (own.has_lost_digits ||
                    IsFarFromPositions(model, own.built, options, context));
  if (!asked && !coincide && !is_far && count(LeftOut::kBehind) == 0 &&
      count(LeftOut::kNoPose) == 0) {
    return own;
  }
  if (asked) RequireOneRank(context, kStartFromNothing);

  Start all{Build(model, options, context, /*ignore_translations=*/true),
            SolveInit::kFeasible};
  if (asked) return all;
  const int64_t num_missing =
      NumObservations(all.built, context) - NumObservations(own.built, context);
  if (own.has_lost_digits && num_missing < 0) return own;
  if (is_far) {
    context.Note(
        "the model's cameras are far from their positions; looking for a start "
        "that is not");
    return all;
  }
  const bool is_larger = num_missing > 0;
  if (!is_larger && !coincide) return own;
  if (method != SolveMethod::kAuto) {
    if (is_larger) {
      context.Note(
          std::to_string(num_missing) +
          " observations are left out because they have no pose or are "
          "behind their cameras; krot solver --Solver.init feasible takes "
          "them in");
    }
    return own;
  }
  RequireOneRank(context, kStartFromNothing);
  context.Note(is_larger ? "the model's translations and points leave out " +
                               std::to_string(num_missing) +
                               " observations; looking for a start that has "
                               "all of them"
                         : std::string("all cameras of the model stand in one "
                                       "place; looking for a start"));
  return all;
}

FoundStart FindFeasibleStart(const KnownRotationProblem& problem,
                             const SolveModelOptions& options,
                             const Context& context, const JointCallback& log) {
  RequireOneRank(context, kStartFromNothing);
  InitializerOptions initializer;
  initializer.norm = options.norm;
  initializer.max_error = options.init_max_error;
  size_t num_logged = 0;
  initializer.callback = [&](int iteration, const JointIteration& state) {
    ++num_logged;
    log(iteration, state);
  };
  Estimate estimate;
  FoundStart start;
  InitializerSummary& summary = start;
  RunStep(
      options.checkpoint, context,
      [&] { summary = FindStart(problem, initializer, context, &estimate); },
      [&](StepValues* values) {
        NameValues(values, &estimate);
        values->Value(&start.termination);
        values->Values(&start.iterations);
        NameValues(values, &start.certificate);
      });
  for (; num_logged < start.iterations.size(); ++num_logged) {
    log(static_cast<int>(num_logged) + 1, start.iterations[num_logged]);
  }
  if (start.termination == SolveTermination::kWithinBound) {
    start.estimate = std::move(estimate);
  }
  return start;
}

namespace {

bool IsWithin(double relative_gap,
              const std::optional<PixelCertificate>& certificate, double cost) {
  return certificate && cost - certificate->lower_bound <= relative_gap * cost;
}

// Whether the estimate is a local minimum up to the gap: a bound on the rows
// taken at it shows that.
bool IsLocalMinimum(double relative_gap, const SolveSummary& summary) {
  if (summary.rounds.empty()) return false;
  const std::optional<double> bound = summary.rounds.back().linear_lower_bound;
  return bound &&
         summary.cost_final - *bound <= relative_gap * summary.cost_final;
}

// The estimate from which another way starts; none if none is found.
std::optional<Estimate> OtherStart(const Start& other, const SolveRun& run,
                                   SolveSummary* summary) {
  if (other.init == SolveInit::kModel) return other.built.start;
  return FindFeasibleStart(
             other.built.problem, run.options, run.context,
             LogIterations(run.options.joint.callback, run.timer, summary))
      .estimate;
}

template <typename Value>
void Append(const std::vector<Value>& from, std::vector<Value>* to) {
  to->insert(to->end(), from.begin(), from.end());
}

}  // namespace

void TryOtherWays(const SolveRun& run, Start* start, Estimate* estimate,
                  std::optional<PixelCertificate>* certificate,
                  SolveSummary* summary) {
  const SolveModelOptions& options = run.options;
  const Context& context = run.context;
  SolveModelOptions other_options = options;
  other_options.joint.max_iterations = std::min(
      options.joint.max_iterations,
      static_cast<int>(std::max<size_t>(100, summary->iterations.size())));
  // Sweeps leave points where they are, in a camera, and their depths consist
  // of rounding. The way without sweeps comes first then.
  const bool is_own_first =
      HasPointsInCameras(start->built.problem, start->built.start);
  // That way leads past what stops sweeps, and a local minimum is no such
  // place.
  const bool is_minimum = IsLocalMinimum(options.joint.relative_gap, *summary);
  for (const bool is_own : {is_own_first, !is_own_first}) {
    if (is_own && is_minimum) continue;
    // A stall with a gap of a few times the one asked for is an answer.
    if (summary->termination != SolveTermination::kStalled ||
        IsWithin(10 * options.joint.relative_gap, *certificate,
                 summary->cost_final)) {
      return;
    }
    other_options.init = is_own ? SolveInit::kModel : SolveInit::kFeasible;
    context.Stage(is_own ? "that stalled; joint iterations from the model"
                         : "that stalled; from a start from nothing");
    const SolveRun other_run{run.model, other_options,
                             is_own ? SolveMethod::kJoint : run.method, context,
                             run.timer};
    Start other =
        is_own ? OwnStart(run.model, other_options, context)
               : ChooseStart(run.model, other_options, run.method, context);
    if (other.built.NumPixels() != start->built.NumPixels()) continue;
    SolveSummary way;
    way.method = summary->method;
    way.norm = summary->norm;
    std::optional<Estimate> found = OtherStart(other, other_run, &way);
    if (found) {
      std::optional<PixelCertificate> proof =
          SolveInRounds(other_run, &other.built, &*found, &way);
      // An estimate that keeps known positions is better than one that does
      // not.
      const auto how_bad = [](const BuiltProblem& built, const Estimate& x,
                              double cost) {
        return std::pair(LargestPositionRatio(built, x) > 1 + kKeptPosition,
                         cost);
      };
      if (how_bad(other.built, *found, way.cost_final) <
          how_bad(start->built, *estimate, summary->cost_final)) {
        *start = std::move(other);
        summary->init = start->init;
        *estimate = *std::move(found);
        summary->cost_final = way.cost_final;
      }
      if (proof &&
          (!*certificate || proof->lower_bound > (*certificate)->lower_bound)) {
        *certificate = std::move(proof);
      }
      if (IsWithin(options.joint.relative_gap, *certificate,
                   summary->cost_final)) {
        summary->termination = SolveTermination::kGapReached;
      }
    }
    if (context.IsCancelled()) {
      summary->termination = SolveTermination::kInterrupted;
    }
    Append(way.rounds, &summary->rounds);
    Append(way.sweeps, &summary->sweeps);
    Append(way.iterations, &summary->iterations);
  }
}

}  // namespace krot::internal
