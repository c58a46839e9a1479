#pragma once

#include <cstdint>
#include <functional>
#include <optional>

#include "krot/base/context.h"
#include "krot/context.h"
#include "krot/convert/build_problem.h"
#include "krot/convert/pixel_certificate.h"
#include "krot/convert/reprojection.h"
#include "krot/model.h"
#include "krot/pipeline/solve_model.h"

namespace krot::internal {

// p = 1, 2 and infinity.
inline bool HasJointSolver(Norm norm) {
  return norm.p == 2 || norm.IsPolyhedral();
}

// SolveModel in the coordinates of the model, however far away: what that does
// in a frame amid the model.
SolveModelResult SolveInFrame(const Model& model,
                              const SolveModelOptions& options,
                              const Context& context);

// For the stages of a solve that iterate: appends every iteration to
// `summary->iterations`, with the seconds of the solve's `timer`, and hands it
// on to `callback`, counted over all stages. Keeps references to the other two.
JointCallback LogIterations(const JointCallback& callback, const Timer& timer,
                            SolveSummary* summary);

// Where a solve starts.
struct Start {
  // Of all observations that the start can serve; built.start is what the
  // model says, and the reference for its coordinate frame.
  BuiltProblem built;
  SolveInit init = SolveInit::kModel;
};

// The model's own start or, if asked for or if `method` is kAuto and the
// model's own is not fit for all observations, one to be found. Says so.
Start ChooseStart(const Model& model, const SolveModelOptions& options,
                  SolveMethod method, const Context& context);

// Whether a model's own translations are a start at all: there are observations
// that they serve, and not all cameras stand in one place.
bool HasOwnStart(const BuiltProblem& own);

// The model's own start; observations that it cannot serve are left out.
Start OwnStart(const Model& model, const SolveModelOptions& options,
               const Context& context);

struct FoundStart {
  std::optional<Estimate> estimate;  // all depths are positive
  // Without one: why.
  SolveTermination termination = SolveTermination::kNotRun;
  std::optional<Certificate> certificate;  // kInfeasible
};

// One whose residuals are below options.init_max_error. Iterations are told to
// `log`.
FoundStart FindFeasibleStart(const KnownRotationProblem& problem,
                             const SolveModelOptions& options,
                             const Context& context, const JointCallback& log);

// After SolveInRounds, where that stalled far from any bound: the other ways to
// the optimum, joint iterations alone from the model's own start and rounds
// from a start that is found from nothing, until one is proved; the former come
// first where that start has points in cameras. Leaves the
// estimate of the least true cost, its problem, and the highest certificate;
// appends to the summary's rounds, sweeps and iterations. Each way may take a
// hundred iterations, or as many as the solve has taken.
void TryOtherWays(const Model& model, const SolveModelOptions& options,
                  const Context& context, const Timer& timer, Start* start,
                  Estimate* estimate,
                  std::optional<PixelCertificate>* certificate,
                  SolveSummary* summary);

// Minimises the largest *true* error in rounds: takes every row where its point
// projects, solves the linear problem (SolveRows), goes as far along the way to
// its solution as lowers the true cost most, and takes the rows anew, until a
// certificate in true pixels shows the gap asked for or a round lowers nothing.
// A fixed point satisfies the first-order conditions of the true problem. One
// round where rows do not depend on where they are taken.
//
// The true cost never rises. Where a full step would raise it, the next round
// bounds how far the observations to blame may move (trust_regions.h).
//
// Where positions are known (krot/convert/reprojection.h) every round has a
// level, and what falls is the cost at that; the result is the best estimate
// that keeps them, or kInfeasible with a proof that none does below
// options.init_max_error.
//
// Fills in costs, rounds, termination, sweeps and iterations of the summary and
// returns the highest certificate, unchecked. The rows of `built` are in the
// end those at `*estimate`.
std::optional<PixelCertificate> SolveInRounds(
    const Model& model, const SolveModelOptions& options, SolveMethod method,
    const Context& context, const Timer& timer, BuiltProblem* built,
    Estimate* estimate, SolveSummary* summary);

// One round: the stages of `method` on the linear rows of a problem, from an
// estimate of positive depths. Adds to the sweeps and the iterations of the
// summary, with the seconds of `timer`, and sets its termination. Returns the
// certificate of the joint solver, if it has one. The rows' cost rises by
// rounding at most. Only the first round of kAuto looks for another start.
// kAuto ends with its sweeps, as kStalled, where `have_rows_served` says of
// their estimate and the rows' cost, pixels, that it is better to take the rows
// anew; may be empty.
std::optional<Certificate> SolveRows(
    const KnownRotationProblem& problem, const SolveModelOptions& options,
    SolveMethod method, bool is_first_round,
    const std::function<bool(const Estimate& swept, double linear_cost)>&
        have_rows_served,
    const Context& context, const Timer& timer, Estimate* estimate,
    KnownMultipliers* known, SolveSummary* summary);

// An estimate that is nearer to the cap, relative, leaves no room for a finish.
inline constexpr double kLeastRoom = 1e-6;

// Takes an estimate whose largest true error is as low as it gets to the end
// that the options ask for: the least squares of true errors below a cap, which
// is max_error or, if there is none, (1 + slack) times the lowest maximum
// (`lower_bound` if the gap asked for is reached and at most half of the slack,
// else the estimate's own), but no more than the start's largest.
//
// Fills in SolveSummary::finish if they were found. The rows of `built` are in
// the end those at `*estimate`.
void RunFinish(const Model& model, const SolveModelOptions& options,
               std::optional<double> lower_bound, const Context& context,
               BuiltProblem* built, Estimate* estimate, SolveSummary* summary);

// Half the sum of the losses of the true errors, squared pixels: what the least
// squares have lowered. O(observations).
double SumOfLosses(const Reprojection& reprojection,
                   const KnownRotationProblem& problem, const ErrorLoss& loss,
                   const Estimate& estimate, const Context& context);

// SolveModel with all radii of options.problem.positions times the smallest
// factor, at least 1, at which the largest error can be at most
// options.inflate_positions_to, pixels. The lowest maximum falls as radii grow;
// the factor is bracketed by solves that end at most there and by bounds above
// it, which prove that no smaller factor will do. The result is that of the
// upper end; as with SolveModel, with the proof alone if even the largest
// factor tried is refuted. Some ten solves, each from the last one's estimate.
SolveModelResult SolveWithInflatedPositions(const Model& model,
                                            const SolveModelOptions& options,
                                            const Context& context);

// The largest resident set, in bytes, of a process that holds `model` and runs
// SolveModel on it with summary.method and summary.init, if the joint solver
// gets by with the observations that it looks at first: within a quarter of the
// truth then (docs/method/joint_solver.md, "Memory"). O(problem).
int64_t EstimateSolveMemory(const Model& model, const BuiltProblem& built,
                            const SolveSummary& summary,
                            const Context& context = {});

}  // namespace krot::internal
