#include "krot/sweeps/frame_share.h"

#include <algorithm>
#include <functional>
#include <utility>

namespace krot {
namespace {

using Eigen::Vector3d;

// Consecutive frames for every rank, by the observations of the whole.
std::vector<int32_t> CutFrames(const KnownRotationProblem& problem,
                               Ranks* ranks) {
  std::vector<int64_t> counts;
  for (int32_t f = 0; f < problem.num_frames; ++f) {
    counts.push_back(problem.frame_begin[f + 1] - problem.frame_begin[f]);
  }
  ranks->Reduce(std::plus<int64_t>(), &counts);
  int64_t total = 0;
  for (const int64_t count : counts) total += count;
  std::vector<int32_t> begin = {0};
  int64_t sum = 0;
  for (int32_t f = 0; f < problem.num_frames; ++f) {
    if (sum * ranks->count() > total * static_cast<int64_t>(begin.size())) {
      begin.push_back(f);
    }
    sum += counts[f];
  }
  begin.resize(ranks->count() + 1, problem.num_frames);
  return begin;
}

}  // namespace

FrameShare::FrameShare(const KnownRotationProblem& problem, Ranks* ranks)
    : ranks_(*ranks),
      frame_begin_(CutFrames(problem, ranks)),
      seen_by_(ranks->count()) {
  std::vector<std::vector<Observation>> to(ranks->count());
  for (const Observation& observation : problem.observations) {
    const int32_t frame = problem.views[observation.view].frame;
    const auto owner = std::upper_bound(frame_begin_.begin() + 1,
                                        frame_begin_.end() - 1, frame) -
                       frame_begin_.begin() - 1;
    std::vector<int32_t>& seen = seen_by_[owner];
    if (seen.empty() || seen.back() != observation.point) {
      seen.push_back(observation.point);
    }
    to[owner].push_back(observation);
    to[owner].back().point = static_cast<int32_t>(seen.size()) - 1;
  }
  problem_.num_frames = problem.num_frames;
  problem_.views = problem.views;
  problem_.fixed_translations = problem.fixed_translations;
  for (std::vector<Observation>& from : ranks_.ExchangeValues(std::move(to))) {
    const int32_t first = problem_.num_points;
    for (const Observation& observation : from) {
      problem_.observations.push_back(observation);
      problem_.observations.back().point += first;
    }
    if (!from.empty()) {
      problem_.num_points = problem_.observations.back().point + 1;
    }
    from = {};
  }
  problem_.observations.shrink_to_fit();
  IndexObservations(&problem_);
}

Estimate FrameShare::Receive(const Estimate& estimate) const {
  std::vector<std::vector<Vector3d>> to(ranks_.count());
  for (int r = 0; r < ranks_.count(); ++r) {
    for (const int32_t k : seen_by_[r]) to[r].push_back(estimate.points[k]);
  }
  Estimate share{estimate.translations, {}};
  for (const std::vector<Vector3d>& from :
       ranks_.ExchangeValues(std::move(to))) {
    share.points.insert(share.points.end(), from.begin(), from.end());
  }
  return share;
}

void FrameShare::Publish(const Estimate& share, Estimate* estimate) const {
  const auto begin = share.translations.begin();
  estimate->translations = ranks_.Gather(
      std::vector<Vector3d>(begin + frame_begin_[ranks_.rank()],
                            begin + frame_begin_[ranks_.rank() + 1]));
}

}  // namespace krot
