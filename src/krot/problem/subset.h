#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "krot/problem/known_rotation_problem.h"

namespace krot {

// Some of a problem's observations as a problem of its own, and the way back to
// the whole. It has only the points, views and frames that they see, in the
// order that they have in the whole, so its optimal cost is at most that of the
// whole. Where that is everything it is the whole itself, not a copy.
class ProblemSubset {
 public:
  // `observations` must ascend strictly and be indices of `whole` (throws
  // std::invalid_argument). Keeps a reference to `whole`. O(observations given
  // + points + views + frames).
  ProblemSubset(const KnownRotationProblem& whole,
                std::vector<int64_t> observations);

  // All of it.
  explicit ProblemSubset(const KnownRotationProblem& whole) : whole_(whole) {}

  const KnownRotationProblem& problem() const {
    return copy_ ? *copy_ : whole_;
  }
  bool IsWhole() const { return copy_ == nullptr; }

  // What the subset's observation is called in the whole.
  int64_t InWhole(int64_t observation) const {
    return IsWhole() ? observation : observation_of_[observation];
  }
  std::vector<int64_t> InWhole(std::vector<int64_t> observations) const;

  // What the whole's view or point is called here; none if it is not.
  std::optional<int32_t> FindView(int32_t view) const;
  std::optional<int32_t> FindPoint(int32_t point) const;

  // The part of an estimate of the whole problem that the subset sees.
  Estimate Restrict(const Estimate& whole) const;

  // Puts the subset's estimate into its place in `whole`.
  void Replace(const Estimate& estimate, Estimate* whole) const;

 private:
  void Copy(const std::vector<char>& has_point,
            const std::vector<char>& has_view,
            const std::vector<char>& has_frame);

  const KnownRotationProblem& whole_;
  // Unless it is the whole: the problem, and what its parts are called there.
  std::unique_ptr<KnownRotationProblem> copy_;
  std::vector<int64_t> observation_of_;
  std::vector<int32_t> point_of_;
  std::vector<int32_t> view_of_;
  std::vector<int32_t> frame_of_;
};

// Drops, until none is left, every observation that alone holds a point or a
// frame that is not fixed: that point or frame can be moved until the residual
// is zero, so such an observation bounds nothing. Takes and returns ascending
// indices. O(observations given + points + frames).
std::vector<int64_t> PruneUnconstrained(
    const KnownRotationProblem& problem,
    const std::vector<int64_t>& observations);

}  // namespace krot
