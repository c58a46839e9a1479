#include "krot/problem/gathered_part.h"

#include <utility>

namespace krot {

GatheredPart::GatheredPart(const KnownRotationProblem& problem,
                           const std::vector<int64_t>& observations,
                           Ranks* ranks)
    : ranks_(*ranks) {
  const int64_t first_in_whole =
      ranks->SumBefore(static_cast<int64_t>(problem.observations.size()));
  for (const int64_t i : observations) {
    const int32_t k = problem.observations[i].point;
    if (points_.empty() || points_.back() != k) points_.push_back(k);
  }
  num_points_ =
      ranks->Gather(std::vector<int64_t>{static_cast<int64_t>(points_.size())});
  auto point = static_cast<int32_t>(
                   ranks->SumBefore(static_cast<int64_t>(points_.size()))) -
               1;
  int32_t last = -1;  // its name here
  std::vector<Observation> own;
  std::vector<int64_t> in_whole;
  for (const int64_t i : observations) {
    own.push_back(problem.observations[i]);
    if (own.back().point != last) ++point;
    last = std::exchange(own.back().point, point);
    in_whole.push_back(first_in_whole + i);
  }
  problem_.num_frames = problem.num_frames;
  problem_.views = problem.views;
  problem_.observations = ranks->GatherOnFirst(own);
  in_whole_ = ranks->GatherOnFirst(in_whole);
  if (ranks->IsFirst()) {
    for (const int64_t count : num_points_) {
      problem_.num_points += static_cast<int32_t>(count);
    }
  }
  IndexObservations(&problem_);
}

Estimate GatheredPart::Collect(const Estimate& estimate) const {
  std::vector<Eigen::Vector3d> points;
  for (const int32_t k : points_) points.push_back(estimate.points[k]);
  return {estimate.translations, ranks_.GatherOnFirst(points)};
}

void GatheredPart::Scatter(const Estimate& part, Estimate* estimate) const {
  estimate->translations = part.translations;
  ranks_.Broadcast(&estimate->translations);
  std::vector<std::vector<Eigen::Vector3d>> to(ranks_.count());
  if (ranks_.IsFirst()) {
    auto begin = part.points.begin();
    for (int r = 0; r < ranks_.count(); ++r) {
      to[r].assign(begin, begin + num_points_[r]);
      begin += num_points_[r];
    }
  }
  const std::vector<Eigen::Vector3d> points =
      ranks_.ExchangeValues(std::move(to))[0];
  for (size_t n = 0; n < points_.size(); ++n) {
    estimate->points[points_[n]] = points[n];
  }
}

}  // namespace krot
