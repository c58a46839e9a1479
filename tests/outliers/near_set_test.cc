#include "krot/outliers/removal.h"

#include <algorithm>
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "tests/problem/random_problem.h"

namespace krot::internal {
namespace {

constexpr double kLevel = 1;

KnownRotationProblem MakeProblem() {
  RandomSceneOptions options = {12, 80};
  options.seed = 3;
  return MakeRandomScene(options).problem;
}

int64_t CountOfPoint(const KnownRotationProblem& problem, const NearSet& set,
                     int32_t k) {
  int64_t count = 0;
  for (int64_t i = problem.point_begin[k]; i < problem.point_begin[k + 1];
       ++i) {
    count += set.Contains(i);
  }
  return count;
}

TEST(NearSet, TiesEveryPointThatItHasAndEveryFrame) {
  const KnownRotationProblem problem = MakeProblem();
  std::vector<double> errors(problem.observations.size(), kLevel / 2);
  errors[17] = 2 * kLevel;
  NearSet set(problem);
  set.AddAbove(errors, kLevel);
  EXPECT_TRUE(set.Contains(17));
  for (int32_t k = 0; k < problem.num_points; ++k) {
    const int64_t count = CountOfPoint(problem, set, k);
    const int64_t length = problem.point_begin[k + 1] - problem.point_begin[k];
    if (count > 0) {
      EXPECT_GE(count, std::min<int64_t>(length, 3));
    }
  }
  for (int32_t f = 0; f < problem.num_frames; ++f) {
    int64_t count = 0;
    for (int64_t n = problem.frame_begin[f]; n < problem.frame_begin[f + 1];
         ++n) {
      count += set.Contains(problem.frame_observations[n]);
    }
    EXPECT_GE(count, 6);
  }
}

TEST(NearSet, KeepsWhatItHasAndHasEverythingThatWasEverAbove) {
  const KnownRotationProblem problem = MakeProblem();
  const size_t count = problem.observations.size();
  NearSet set(problem);
  for (size_t above = 0; above < count; ++above) {
    std::vector<double> errors(count, 0.0);
    errors[above] = 2 * kLevel;
    set.AddAbove(errors, kLevel);
    for (size_t i = 0; i <= above; ++i) {
      EXPECT_TRUE(set.Contains(static_cast<int64_t>(i)));
    }
  }
  size_t in_parts = 0;
  for (const std::vector<int64_t>& part : set.Parts()) in_parts += part.size();
  EXPECT_EQ(in_parts, count);
}

}  // namespace
}  // namespace krot::internal
