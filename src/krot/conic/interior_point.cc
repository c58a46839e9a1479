#include "krot/conic/interior_point.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "krot/base/check.h"
#include "krot/conic/conic_solver.h"
#include "krot/minimax/residual.h"
#include "krot/problem/fixed.h"

namespace krot {
namespace {

template <typename Cone>
InteriorPointSummary Run(const KnownRotationProblem& problem,
                         const InteriorPointOptions& options,
                         const Context& context, const ConeProgram& program,
                         const Estimate& start, double scalar,
                         Estimate* estimate,
                         std::vector<Multiplier>* multipliers) {
  ConicSolver<Cone> solver(problem, options, context, program, start, scalar);
  const InteriorPointSummary summary = solver.Run();
  if (program.kind != ConeProgram::Kind::kFeasibility ||
      summary.termination == InteriorPointTermination::kFeasible) {
    *estimate = solver.best();
  }
  *multipliers = solver.TakeMultipliers();
  return summary;
}

InteriorPointSummary RunForNorm(
    const KnownRotationProblem& problem, const InteriorPointOptions& options,
    const Context& context, const ConeProgram& program, const Estimate& start,
    double scalar, Estimate* estimate, std::vector<Multiplier>* multipliers) {
  CheckArgument(options.norm.p == 2 || options.norm.IsPolyhedral(), "norm.p",
                options.norm.p, "1, 2 or infinity");
  CheckArgument(options.max_iterations >= 1, "max_iterations",
                options.max_iterations, ">= 1");
  CheckArgument(options.smallest_gap > 0, "smallest_gap", options.smallest_gap,
                "> 0");
  return options.norm.p == 2
             ? Run<SecondOrderCone>(problem, options, context, program, start,
                                    scalar, estimate, multipliers)
             : Run<FourHalfLines>(problem, options, context, program, start,
                                  scalar, estimate, multipliers);
}

}  // namespace

InteriorPointSummary MinimizeJointly(const KnownRotationProblem& problem,
                                     const InteriorPointOptions& options,
                                     const Context& context, Estimate* estimate,
                                     std::vector<Multiplier>* multipliers) {
  CheckArgument(options.start_margin > 0, "start_margin", options.start_margin,
                "> 0");
  const double cost =
      Cost(problem, *estimate, options.norm, context.num_threads);
  CheckArgument(std::isfinite(cost), "cost of the start", cost,
                "finite: all depths positive");
  if (options.known_multipliers != nullptr) {
    const size_t count = options.known_multipliers->size();
    CheckArgument(count == problem.observations.size(),
                  "number of known multipliers", count,
                  "that of the observations");
  }
  if (!(cost > 0)) {  // already at the lowest possible
    multipliers->assign(problem.observations.size(), {});
    InteriorPointSummary summary;
    summary.termination = InteriorPointTermination::kSmallestGap;
    return summary;
  }
  return RunForNorm(problem, options, context, ConeProgram{}, *estimate,
                    (1 + options.start_margin) * cost, estimate, multipliers);
}

InteriorPointSummary FindFeasible(const KnownRotationProblem& problem,
                                  const InteriorPointOptions& options,
                                  const Context& context, double bound,
                                  double unit_depth, Estimate* estimate,
                                  std::vector<Multiplier>* multipliers) {
  CheckArgument(bound > 0, "bound", bound, "> 0");
  CheckArgument(unit_depth > 0, "unit_depth", unit_depth, "> 0");
  ConeProgram program;
  program.kind = ConeProgram::Kind::kFeasibility;
  program.bound = bound;
  program.unit_depth = unit_depth;
  const Estimate origin = AllAtOrigin(problem);
  // The least tau that leaves every cone at the origin, and a margin: the
  // origin's depths and v vanish but for the baselines.
  double scalar = 1;
  for (const Observation& observation : problem.observations) {
    const ViewedPoint viewed = ViewPoint(problem, observation, origin);
    scalar = std::max(
        scalar, 1 + (NormOf(viewed.v, options.norm) / bound - viewed.depth) /
                        unit_depth);
  }
  return RunForNorm(problem, options, context, program, origin, scalar + 1,
                    estimate, multipliers);
}

InteriorPointSummary MinimizeLinear(const KnownRotationProblem& problem,
                                    const InteriorPointOptions& options,
                                    const Context& context, double bound,
                                    const LinearObjective& objective,
                                    Estimate* estimate,
                                    std::vector<Multiplier>* multipliers) {
  const double cost =
      Cost(problem, *estimate, options.norm, context.num_threads);
  CheckArgument(cost < bound, "cost of the start", cost, "below the bound");
  ConeProgram program;
  program.kind = ConeProgram::Kind::kLinear;
  program.bound = bound;
  program.unit_depth = 0;
  program.linear = &objective;
  const double start =
      objective.h.Dot({estimate->points, estimate->translations});
  return RunForNorm(problem, options, context, program, *estimate, start,
                    estimate, multipliers);
}

int64_t EstimateInteriorPointMemory(const KnownRotationProblem& problem,
                                    Norm norm) {
  return norm.p == 2 ? ConicSolver<SecondOrderCone>::MemoryBytes(problem)
                     : ConicSolver<FourHalfLines>::MemoryBytes(problem);
}

}  // namespace krot
