#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "krot/base/checkpoint.h"
#include "krot/base/context.h"
#include "krot/joint/known_multipliers.h"
#include "krot/math/norm.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/proof/certificate.h"

namespace krot::internal {

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

}  // namespace krot::internal
