#pragma once

#include <cstdint>
#include <vector>

#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// The observations that a slack programme looks at: those that come near the
// bound, and enough others to tie their points and every frame. An optimum of
// theirs is one of all as long as no other exceeds the bound there.
class NearSet {
 public:
  // Empty. Keeps a reference to `problem`.
  explicit NearSet(const KnownRotationProblem& problem);

  // Adds the observations whose error, one each, is above `level`, and ties.
  // O(observations).
  void AddAbove(const std::vector<double>& errors, double level);

  bool Contains(int64_t i) const { return contains_[i] != 0; }
  // By connected component, each ascending.
  std::vector<std::vector<int64_t>> Parts() const;

 private:
  void TiePoint(int32_t point);
  void TieFrames();

  const KnownRotationProblem* problem_;
  std::vector<char> contains_;  // per observation
};

}  // namespace krot::internal
