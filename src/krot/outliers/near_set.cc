#include "krot/outliers/near_set.h"

#include <algorithm>
#include <utility>

#include "krot/problem/components.h"

namespace krot::internal {
namespace {

constexpr int64_t kTiesPerPoint = 6;
constexpr int64_t kTiesPerFrame = 20;

}  // namespace

NearSet::NearSet(const KnownRotationProblem& problem)
    : problem_(&problem), contains_(problem.observations.size(), 0) {}

void NearSet::AddAbove(const std::vector<double>& errors, double level) {
  for (int32_t k = 0; k < problem_->num_points; ++k) {
    bool is_near = false;
    for (int64_t i = problem_->point_begin[k]; i < problem_->point_begin[k + 1];
         ++i) {
      if (!(errors[i] <= level)) contains_[i] = 1;
      is_near = is_near || Contains(i);
    }
    if (is_near) TiePoint(k);
  }
  TieFrames();
}

// Those that are missing are taken evenly along the track.
void NearSet::TiePoint(int32_t point) {
  const int64_t begin = problem_->point_begin[point];
  const int64_t end = problem_->point_begin[point + 1];
  const int64_t others =
      std::count(&contains_[0] + begin, &contains_[0] + end, 0);
  const int64_t missing =
      std::min(others, kTiesPerPoint - (end - begin - others));
  int64_t n = 0;
  for (int64_t i = begin; i < end && missing > 0; ++i) {
    if (Contains(i)) continue;
    contains_[i] = (n + 1) * missing / others > n * missing / others;
    ++n;
  }
}

void NearSet::TieFrames() {
  for (int32_t f = 0; f < problem_->num_frames; ++f) {
    std::vector<int64_t> others;
    int64_t missing = kTiesPerFrame;
    for (int64_t n = problem_->frame_begin[f]; n < problem_->frame_begin[f + 1];
         ++n) {
      const int64_t i = problem_->frame_observations[n];
      if (Contains(i)) {
        --missing;
      } else {
        others.push_back(i);
      }
    }
    for (size_t n = 0; n < others.size() && missing > 0; ++n, --missing) {
      contains_[others[n]] = 1;
      TiePoint(problem_->observations[others[n]].point);
    }
  }
}

std::vector<std::vector<int64_t>> NearSet::Parts() const {
  std::vector<int64_t> observations;
  for (size_t i = 0; i < contains_.size(); ++i) {
    if (contains_[i]) observations.push_back(static_cast<int64_t>(i));
  }
  return SplitIntoComponents(*problem_, std::move(observations));
}

}  // namespace krot::internal
