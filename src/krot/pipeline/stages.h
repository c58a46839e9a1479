#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "krot/base/context.h"
#include "krot/context.h"
#include "krot/convert/build_problem.h"
#include "krot/convert/pixel_certificate.h"
#include "krot/convert/reprojection.h"
#include "krot/model.h"
#include "krot/pipeline/solve_model.h"
#include "krot/verify/certificate_check.h"

namespace krot::internal {

// p = 1, 2 and infinity.
inline bool HasJointSolver(Norm norm) {
  return norm.p == 2 || norm.IsPolyhedral();
}

// What the stages of one solve share. Holds references.
struct SolveRun {
  const Model& model;
  const SolveModelOptions& options;
  SolveMethod method;
  const Context& context;
  const Timer& timer;  // since the solve's start
};

// The known positions of what must not move.
struct FixedPositions {
  int64_t count = 0;
  double largest_ratio =
      0;  // of a distance from a known position to its radius
};

// Throws ModelError for what stands outside its known position (by more than
// kKeptPosition) and must not move. O(images + positions).
FixedPositions CheckFixedPositions(const Model& model, const FixedParts& fixed,
                                   const std::vector<KnownPosition>& positions);

// SolveModel in the coordinates of the model as they are. SolveModel calls it
// with a model that was moved to a local frame near the origin if necessary.
SolveModelResult SolveInFrame(const Model& model,
                              const SolveModelOptions& options,
                              const Context& context);

// A callback for the iterative stages of a solve: it appends every iteration to
// `summary->iterations`, with the seconds of the solve's `timer`, and then
// calls `callback`, with iterations counted over all stages. Keeps references
// to `timer` and `summary`.
JointCallback LogIterations(const JointCallback& callback, const Timer& timer,
                            SolveSummary* summary);

// Where a solve starts.
struct Start {
  // Has all observations that can take part from this start. built.start are
  // the model's own positions, moved as a whole to where cameras are known to
  // be; also the reference for the coordinate frame.
  BuiltProblem built;
  SolveInit init = SolveInit::kModel;
  // Whether that move has raised errors: those of points in cameras, whose
  // depths are a few digits.
  bool has_lost_digits = false;
};

// Decides where to start, and notes it: from the model's own estimate or, if
// asked for or if `method` is kAuto and the model's own estimate does not serve
// all observations, from one that is still to be found (SolveInit::kFeasible).
Start ChooseStart(const Model& model, const SolveModelOptions& options,
                  SolveMethod method, const Context& context);

// Whether a model's own translations can be a start at all: some observations
// can take part, and not all cameras stand in one place.
bool HasOwnStart(const BuiltProblem& own);

// The model's own start; observations that cannot take part are left out.
Start OwnStart(const Model& model, const SolveModelOptions& options,
               const Context& context);

struct FoundStart : InitializerSummary {
  std::optional<Estimate> estimate;  // all depths are positive
};

// Looks for an estimate whose residuals are below options.init_max_error. Calls
// `log` for every iteration.
FoundStart FindFeasibleStart(const KnownRotationProblem& problem,
                             const SolveModelOptions& options,
                             const Context& context, const JointCallback& log);

// Called after SolveInRounds. Where that stalled far from any bound, tries two
// other ways to the optimum until one is proved: joint iterations alone from
// the model's own start, and rounds from a start that is found from nothing.
// The former come first where the present start has points in cameras. Leaves
// the estimate of the least true cost, its problem, and the highest
// certificate; appends to the summary's rounds, sweeps and iterations. Each way
// may take a hundred iterations, or as many as the solve has taken if more.
void TryOtherWays(const SolveRun& run, Start* start, Estimate* estimate,
                  std::optional<PixelCertificate>* certificate,
                  SolveSummary* summary);

// Minimises the largest *true* error in rounds. A round takes every row where
// its point projects, solves the linear problem (SolveRows), and takes the step
// towards its solution that lowers the true cost most. Rounds end when a
// certificate in true pixels shows the gap asked for or a round lowers nothing.
// A fixed point satisfies the first-order conditions of the true problem. Where
// rows do not depend on where they are taken, as for pinholes, one round is
// enough.
//
// The true cost never rises. After a step shorter than 1, the next round bounds
// how far the projections move whose rows promised too much (TrustRegions).
//
// Where positions are known (krot/convert/reprojection.h) every round has a
// level, and the levelled cost is what never rises within a level. The result
// is the best estimate that keeps the positions, or kInfeasible with a proof
// that no estimate does so with all errors below options.init_max_error.
//
// Fills in costs, rounds, termination, sweeps and iterations of the summary and
// returns the certificate with the highest bound, unchecked. In the end the
// rows of `built` are those taken at `*estimate`.
std::optional<PixelCertificate> SolveInRounds(const SolveRun& run,
                                              BuiltProblem* built,
                                              Estimate* estimate,
                                              SolveSummary* summary);

// Solves the linear rows of one round by the stages of run.method, from an
// estimate of positive depths. Appends to the summary's sweeps and iterations,
// with the seconds of run.timer, and sets its termination. Returns the
// certificate of the joint solver, if it has one. The rows' cost rises by
// rounding at most. `have_rows_served` may be empty. kAuto calls it after its
// sweeps, with their estimate and the rows' cost in pixels; if it returns true,
// because it is better to take the rows anew, the joint solver is not run and
// the termination is kStalled.
std::optional<Certificate> SolveRows(
    const KnownRotationProblem& problem, const SolveRun& run,
    const std::function<bool(const Estimate& swept, double linear_cost)>&
        have_rows_served,
    Estimate* estimate, KnownMultipliers* known, SolveSummary* summary);

// A certificate of rows. observation_of maps indices of its rows to those of
// the whole problem's observations; -1 marks a row that is no observation;
// empty means identity.
struct RowsCertificate {
  Certificate certificate;
  std::vector<int64_t> observation_of;
};

// A lower bound in true pixels for all estimates, from the observations that
// set the maximum of the linear rows: `support`, ascending indices. `built` has
// the rows that were taken at `x_hat`; the nearer that is to the optimum of the
// true errors, the higher is the bound.
//
// Solves the problem of the support alone, which is small, for these rows. If a
// row's support line (pixel_certificate.h) cuts the set of rays whose true
// error is within the bound, the row is widened and the problem solved again,
// until the bound is `sufficient`, pixels. None if nothing is proved.
std::optional<PixelCertificate> ProveInPixels(const Model& model,
                                              const BuiltProblem& built,
                                              const Estimate& x_hat, Norm norm,
                                              std::vector<int64_t> support,
                                              double sufficient,
                                              const Context& context);

// The same from a certificate of the rows that were solved. Where rows do not
// depend on where they are taken, as for pinholes, that certificate is itself
// the proof. Where ranks share the points, the first one returns the result,
// with indices of the whole problem (certificate_file.h), and the others only
// its lower bound. It is one step of the checkpoint; of the options it uses
// norm and checkpoint.
std::optional<PixelCertificate> ProveRows(
    const Model& model, const BuiltProblem& built, const Estimate& x_hat,
    const SolveModelOptions& options, const RowsCertificate& rows,
    double sufficient, const Context& context);

// The observations of a certificate, as indices of the whole problem; rows that
// are no observations are left out.
std::vector<int64_t> SupportOf(const RowsCertificate& rows);

// Checks a certificate independently of the solver that made it, and writes to
// the summary what it proves about the estimate. Where ranks share the points
// all must call it, and only the first one's summary is filled in.
void Certify(const Model& model, const BuiltProblem& built,
             const Estimate& estimate, const SolveModelOptions& options,
             const Context& context,
             std::optional<PixelCertificate> certificate,
             SolveSummary* summary);

// Certifies, in true pixels, that no estimate is below the bound of a start
// from nothing; `certificate` is what FindFeasibleStart returned.
void CertifyInfeasible(const Model& model, const BuiltProblem& built,
                       const SolveModelOptions& options, const Context& context,
                       const std::optional<Certificate>& certificate,
                       SolveSummary* summary);

// If the cost is within this of the cap, relative, there is no finish: it would
// have no room to move.
inline constexpr double kLeastRoom = 1e-6;

// The error below which a finish can start without a search for the lowest
// maximum; 0 if that is to be found.
double SufficientCost(const SolveModelOptions& options, SolveMethod method);

// Runs the finish that the options ask for, from an estimate whose largest true
// error is as low as it gets: the least squares of true errors below a cap. The
// cap is max_error or, without that, (1 + slack) times the lowest maximum, but
// at most the start's largest error unless positions are known. The lowest
// maximum is `lower_bound` if that is within the gap asked for and within half
// of the slack, otherwise the estimate's own.
//
// Fills in SolveSummary::finish if it succeeds. In the end the rows of `built`
// are those taken at `*estimate`.
void RunFinish(const SolveRun& run, std::optional<double> lower_bound,
               BuiltProblem* built, Estimate* estimate, SolveSummary* summary);

// Half the sum of the losses of the true errors, squared pixels: the objective
// of the finish. O(observations).
double SumOfLosses(const Reprojection& reprojection,
                   const KnownRotationProblem& problem, const ErrorLoss& loss,
                   const Estimate& estimate, const Context& context);

// Estimates the largest resident set, in bytes, of a process that holds `model`
// and runs SolveModel on it with summary.method and summary.init. The estimate
// is within a quarter of the truth if the joint solver's working set does not
// grow (docs/method/joint_solver.md, "Memory"). O(problem).
int64_t EstimateSolveMemory(const Model& model, const BuiltProblem& built,
                            const SolveSummary& summary,
                            const Context& context = {});

}  // namespace krot::internal
