#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "krot/base/context.h"
#include "krot/bridge/bridge.h"
#include "krot/math/norm.h"
#include "krot/model.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/problem/subset.h"
#include "krot/tolerance/extent.h"

namespace krot::internal {

// Marks the points whose residuals are all below `bound`, pixels, if the point
// is infinitely far away in some direction. Wherever the frames are, such a
// point fits in if it is far enough away, and so it says nothing about the
// frames. O(observations).
std::vector<char> FindFarPoints(const KnownRotationProblem& problem, Norm norm,
                                double bound, const Context& context);

// What holds place and scale of the estimates.
struct ToleranceGauge {
  // Views: the frame of the first is fixed and, if that leaves the scale free,
  // the second keeps its distance from it along the line between the two.
  // Without a first, what the problem fixes does both.
  std::optional<int32_t> first;
  std::optional<int32_t> second;
};

// A gauge for a problem that fixes nothing: the view with the most observations
// and, of the views connected to it, the one that is farthest away in the
// estimate. No second if a baseline sets the scale.
ToleranceGauge ChooseGauge(const KnownRotationProblem& problem,
                           const Estimate& estimate);

// The estimates whose true errors are all at most `bound`, in a gauge: the
// problem that all boxes are about.
class ToleranceProblem {
 public:
  // `centre` is an estimate whose errors are all below the bound; the gauge
  // holds what it holds at its place there. Keeps references to all arguments
  // but the gauge. Takes the rows of `built` anew (TakeOuterRows).
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

  // The part of the problem that bounds anything and is connected to something
  // fixed: without observations that have no outer row, and without far points
  // other than `target`. None if it does not contain the target.
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

// Those of some observations that are in components in which something is
// fixed; ascending.
std::vector<int64_t> HeldObservations(const KnownRotationProblem& problem,
                                      std::vector<int64_t> observations);

}  // namespace krot::internal
