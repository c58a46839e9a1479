#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "krot/base/context.h"
#include "krot/bridge/bridge.h"
#include "krot/math/norm.h"
#include "krot/model/model.h"
#include "krot/problem/subset.h"
#include "krot/tolerance/extent.h"

namespace krot {

// What holds the estimates in their place.
struct ToleranceGauge {
  // Views: the first one's frame stands still and, where that leaves the scale
  // free, the second one keeps its distance from it along the line between the
  // two. Without a first, what the problem fixes does both.
  std::optional<int32_t> first;
  std::optional<int32_t> second;
};

// A gauge for a problem that fixes nothing: the view with the most observations
// and the one farthest from it, at the estimate, that is connected to it. No
// second if a baseline sets the scale.
ToleranceGauge ChooseGauge(const KnownRotationProblem& problem,
                           const Estimate& estimate);

// The estimates whose true errors are all at most `bound`, in a gauge: what the
// ends of all boxes share.
class ToleranceProblem {
 public:
  // `centre` is one of them, all of whose errors are below the bound, and tells
  // where the gauge holds. Keeps references to all but the gauge; takes the
  // rows of `built` anew (TakeOuterRows).
  ToleranceProblem(const Model& model, BuiltProblem* built,
                   const Estimate& centre, const ToleranceGauge& gauge,
                   Norm norm, double bound, const Context& context);

  const Model& model() const { return model_; }
  const BuiltProblem& built() const { return built_; }
  const KnownRotationProblem& problem() const { return built_.problem; }
  const Estimate& centre() const { return centre_; }
  const std::optional<ScaleRow>& scale() const { return scale_; }
  Norm norm() const { return norm_; }
  double bound() const { return bound_; }

  // Of the observations that bound anything and hang together with what is
  // fixed: without those that have no outer row, and without far points, but
  // for `target`. None if the target is not among what they see.
  std::optional<ProblemSubset> UsablePart(const Pull& target) const;

  int64_t num_rowless() const { return num_rowless_; }
  int64_t num_far_points() const { return num_far_points_; }

 private:
  const Model& model_;
  const BuiltProblem& built_;
  const Estimate& centre_;
  const Norm norm_;
  const double bound_;
  std::optional<ScaleRow> scale_;
  std::vector<char> has_row_;  // per observation
  std::vector<char> is_far_;   // per point
  int64_t num_rowless_ = 0;
  int64_t num_far_points_ = 0;
};

// Of some observations of a problem, those in components in which something is
// fixed. Ascending.
std::vector<int64_t> HeldObservations(const KnownRotationProblem& problem,
                                      std::vector<int64_t> observations);

}  // namespace krot
