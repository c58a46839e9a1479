#include "krot/pipeline/start.h"

#include <string>
#include <utility>

#include "krot/bridge/position_rows.h"
#include "krot/bridge/reprojection.h"
#include "krot/geometry.h"
#include "krot/joint/initializer.h"
#include "krot/joint/step_values.h"

namespace krot::internal {
namespace {

constexpr char kStartFromNothing[] = "a start from nothing";

int64_t NumObservations(const BuiltProblem& built, const Context& context) {
  return SumOfRanks(context,
                    static_cast<int64_t>(built.problem.observations.size()));
}

// Whether all frames see the points from the same place, as in a model whose
// translations are all zero: any translations are better then. Rigs with
// baselines have several places.
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

// Whether the cameras are so far from where they are known to be that a start
// from there is no help.
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
  return {Build(model, options, context, /*ignore_translations=*/false),
          SolveInit::kModel};
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
      !coincide && IsFarFromPositions(model, own.built, options, context);
  if (!asked && !coincide && !is_far && count(LeftOut::kBehind) == 0 &&
      count(LeftOut::kNoPose) == 0) {
    return own;
  }
  if (asked) RequireOneRank(context, kStartFromNothing);

  Start all{Build(model, options, context, /*ignore_translations=*/true),
            SolveInit::kFeasible};
  if (asked) return all;
  if (is_far) {
    context.Note(
        "the model's cameras are far from their positions; looking for a start "
        "that is not");
    return all;
  }
  const int64_t num_missing =
      NumObservations(all.built, context) - NumObservations(own.built, context);
  const bool is_larger = num_missing > 0;
  if (!is_larger && !coincide) return own;
  if (method != SolveMethod::kAuto) {
    if (is_larger) {
      context.Note(
          std::to_string(num_missing) +
          " observations are left out because they have no pose or are "
          "behind their cameras; --Solver.init feasible takes them in");
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
  InitializerSummary summary;
  RunStep(
      options.checkpoint, context,
      [&] { summary = FindStart(problem, initializer, context, &estimate); },
      [&](StepValues* values) {
        NameValues(values, &estimate);
        values->Value(&summary.termination);
        values->Values(&summary.iterations);
        NameValues(values, &summary.certificate);
      });
  for (; num_logged < summary.iterations.size(); ++num_logged) {
    log(static_cast<int>(num_logged) + 1, summary.iterations[num_logged]);
  }
  FoundStart start;
  switch (summary.termination) {
    case InitializerTermination::kFeasible:
      start.estimate = std::move(estimate);
      break;
    case InitializerTermination::kInfeasible:
      start.termination = SolveTermination::kInfeasible;
      start.certificate = std::move(summary.certificate);
      break;
    case InitializerTermination::kInterrupted:
      start.termination = SolveTermination::kInterrupted;
      break;
    case InitializerTermination::kNotRun:
    case InitializerTermination::kFailed:
      start.termination = SolveTermination::kNoStart;
      break;
  }
  return start;
}

}  // namespace krot::internal
