#include "krot/outliers/scarce.h"

#include <algorithm>
#include <iterator>

namespace krot::internal {
namespace {

// What an observation is worth that others of its track need.
constexpr float kWorthToItsTrack = 0.3F;
constexpr int64_t kCompanions = 2;

}  // namespace

std::vector<float> Worths(const KnownRotationProblem& problem,
                          const std::vector<char>& is_free,
                          const std::vector<int64_t>& open) {
  std::vector<float> worth(is_free.begin(), is_free.end());
  for (const int64_t i : open) {
    const int32_t k = problem.observations[i].point;
    const int64_t begin = problem.point_begin[k];
    const int64_t end = problem.point_begin[k + 1];
    if (std::count(&is_free[0] + begin, &is_free[0] + end, 1) > 2) continue;
    for (int64_t j = begin; j < end; ++j) {
      if (is_free[j]) worth[j] = kWorthToItsTrack;
    }
  }
  return worth;
}

std::vector<int64_t> TakeCrowded(const KnownRotationProblem& problem,
                                 const std::vector<char>& is_free,
                                 std::vector<int64_t>* open) {
  std::vector<int64_t> spare(problem.views.size(), 0);
  for (size_t i = 0; i < is_free.size(); ++i) {
    spare[problem.observations[i].view] += is_free[i];
  }
  const auto view_of = [&](int64_t i) { return problem.observations[i].view; };
  for (const int64_t i : *open) spare[view_of(i)] -= kCompanions;
  std::vector<int64_t> crowded;
  std::vector<int64_t> others;
  std::partition_copy(open->begin(), open->end(), std::back_inserter(crowded),
                      std::back_inserter(others),
                      [&](int64_t i) { return spare[view_of(i)] < 0; });
  *open = std::move(others);
  return crowded;
}

}  // namespace krot::internal
