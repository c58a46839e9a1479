#pragma once

#include <optional>

#include "krot/bridge/bridge.h"
#include "krot/pipeline/solve_model.h"

namespace krot::internal {

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

}  // namespace krot::internal
