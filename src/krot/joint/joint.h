#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "krot/base/checkpoint.h"
#include "krot/base/context.h"
#include "krot/conic/interior_point.h"
#include "krot/math/norm.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/proof/certificate.h"
#include "krot/verify/certificate_check.h"

namespace krot::internal {

// What a solve leaves to the next, similar one: multipliers of some of a
// problem's observations, named by increasing numbers. Only those that are
// known take memory.
class KnownMultipliers {
 public:
  // `multipliers` of the observations that `names` ascend through take the
  // place of what was known of them; `optimum`, pixels, is where their solve
  // would have come to. O(known + names).
  void Keep(const std::vector<int64_t>& names,
            const std::vector<Multiplier>& multipliers, double optimum);

  // Of the solve that was kept last; 0: none was.
  double optimum() const { return optimum_.empty() ? 0 : optimum_[0]; }

  // Of the observations that `names` ascend through, zero where it is not
  // known; empty if none is. O(known + names).
  std::vector<Multiplier> Of(const std::vector<int64_t>& names) const;

  // For a checkpoint; where ranks share a problem, the first one's.
  void NameValues(StepValues* values) {
    values->OnFirst(&known_);
    values->OnFirst(&optimum_);
  }

 private:
  std::vector<CertifiedObservation> known_;
  std::vector<double> optimum_;  // one, if any
};

// What steps have in common.

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

// The global optimum of the known rotation problem, with a proof: all frames
// and points at once by the interior point of conic/, each connected component
// for itself, until a certificate that CheckCertificate accepts shows the
// relative gap.

// An iteration of the interior point: on the problem, or, with a `target`, on
// the way to a start.
struct JointIteration {
  std::optional<double> cost;  // pixels, the best so far, if there is one
  std::optional<double> lower_bound;  // pixels, certified so far
  // Of the interior point on the problem: an estimate, not a bound.
  std::optional<double> gap;
  double seconds = 0;  // since the call
  // Pixels: a start is looked for whose residuals are all below.
  std::optional<double> target = std::nullopt;
};

// Called after every iteration, counted from 1.
using JointCallback =
    std::function<void(int iteration, const JointIteration& state)>;

struct JointOptions {
  Norm norm;                         // p = 1, 2 or infinity
  double relative_gap = 1e-4;        // (cost - lower_bound) / cost; > 0
  int max_iterations = 2000;         // per component; >= 1
  double sufficient_cost = 0;        // nothing below it is sought, pixels; >= 0
  JointCallback callback;            // counts over all components; may be empty
  Checkpoint* checkpoint = nullptr;  // of working sets; may be null
};

enum class JointTermination {
  kNotRun,
  // Certified, or a cost that is zero up to rounding, or sufficient.
  kGapReached,
  kMaxIterations,
  kStalled,  // rounding ended the progress before the gap was reached
  kInterrupted,
};

struct JointSummary {
  JointTermination termination = JointTermination::kNotRun;
  double cost_initial = 0;  // pixels
  double cost_final = 0;    // <= cost_initial
  // The highest certified bound of any component: also one of the whole.
  std::optional<Certificate> certificate;
  double lower_bound = 0;  // pixels, what the certificate proves; 0 if none
  int32_t num_components = 0;
  // Of the working sets whose optima were the whole's in the end.
  int64_t num_working_observations = 0;
  std::vector<JointIteration> iterations;

  double RelativeGap() const {
    return cost_final > 0 ? (cost_final - lower_bound) / cost_final : 0;
  }
};

// Improves `estimate`, all of whose depths must be positive (throws
// std::invalid_argument otherwise, and for options out of range). Never worse
// than the start. Frames and points without observations stay. Takes about
// 600 bytes for each observation that it looks at, beside the reduced camera
// system. Where there is one component, `known` are multipliers of a similar
// problem with the same observations, which save iterations, and then this
// one's.
JointSummary SolveJoint(const KnownRotationProblem& problem,
                        const JointOptions& options, const Context& context,
                        Estimate* estimate, KnownMultipliers* known = nullptr);

struct FeasibleStartOptions {
  Norm norm;
  int max_iterations = 200;  // >= 1
  // A depth that is small against the scene, scene units; it only shapes the
  // way. None: a share of the longest baseline or distance
  // of fixed positions, or 1 where the scale is free.
  std::optional<double> unit_depth;
  // Nothing below this is sought, pixels.
  double known_bound = 0;
  // Gives up once the programme's gap is this small and the
  // bound not met; 0: never.
  double hopeless_gap = 0;
  // Called after every iteration with the bound that it is to meet, pixels; may
  // be empty.
  std::function<void(double bound)> callback;
};

// An estimate of a connected problem whose residuals are all below `bound`,
// pixels, from nothing: FindFeasible with a unit of depth that suits the
// problem's baselines. As that starts from the centre of the cones, the
// estimate is a good start for MinimizeJointly. `*estimate` is only written if
// one is found (kFeasible); otherwise `*multipliers` may prove that there is
// none (MakeInfeasibilityCertificate).
InteriorPointTermination FindEstimateBelow(
    const KnownRotationProblem& problem, double bound,
    const FeasibleStartOptions& options, const Context& context,
    Estimate* estimate, std::vector<Multiplier>* multipliers);

// Lowers an estimate by FindEstimateBelow at a quarter of its cost, again and
// again as long as there is one; returns whether there was. Takes some five
// iterations each.
bool LowerByFeasibility(const KnownRotationProblem& problem,
                        const FeasibleStartOptions& options,
                        const Context& context, Estimate* estimate);

// A start from nothing but rotations and observations: the paper's "one
// bisection iteration at a loose upper bound" [Zhang18, Sec. 4.2].

struct InitializerOptions {
  Norm norm;                 // p = 1, 2 or infinity
  double max_error = 100;    // the bound that the start must meet, pixels; > 0
  int max_iterations = 200;  // per component; >= 1
  JointCallback callback;    // counts over all components; may be empty
};

enum class InitializerTermination {
  kNotRun,
  kFeasible,    // every depth is positive, every residual below max_error
  kInfeasible,  // proved: no estimate does that
  kFailed,      // neither was shown: no estimate was found at any bound
  kInterrupted,
};

struct InitializerSummary {
  InitializerTermination termination = InitializerTermination::kNotRun;
  double cost = 0;  // pixels, of the estimate if feasible
  std::vector<JointIteration> iterations;
  // kInfeasible: proves lower_bound > max_error.
  std::optional<Certificate> certificate;
  double lower_bound = 0;  // pixels, what it proves
};

// Finds an estimate whose residuals are all below max_error, and as far below
// as comes easily, each connected component for itself; `*estimate` is only
// written if there is one, its points and frames without observations not even
// then. Where nothing is fixed and baselines do not set the scale, components
// come out with a median depth of one. Throws std::invalid_argument for options
// out of range.
InitializerSummary FindStart(const KnownRotationProblem& problem,
                             const InitializerOptions& options,
                             const Context& context, Estimate* estimate);

}  // namespace krot::internal
