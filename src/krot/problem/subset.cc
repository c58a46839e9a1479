#include "krot/problem/subset.h"

#include <algorithm>
#include <string>
#include <utility>

#include "krot/base/check.h"
#include "krot/base/numbers.h"

namespace krot::internal {
namespace {

bool IsAll(const std::vector<char>& is_kept) {
  return std::find(is_kept.begin(), is_kept.end(), 0) == is_kept.end();
}

// Numbers the marked elements in their order; unmarked ones get -1.
std::vector<int32_t> Renumber(const std::vector<char>& is_kept,
                              std::vector<int32_t>* old_of) {
  std::vector<int32_t> new_of(is_kept.size(), -1);
  for (size_t n = 0; n < is_kept.size(); ++n) {
    if (!is_kept[n]) continue;
    new_of[n] = static_cast<int32_t>(old_of->size());
    old_of->push_back(static_cast<int32_t>(n));
  }
  return new_of;
}

void CheckAscending(const KnownRotationProblem& problem,
                    const std::vector<int64_t>& observations) {
  const int64_t count = static_cast<int64_t>(problem.observations.size());
  int64_t previous = -1;
  for (size_t n = 0; n < observations.size(); ++n) {
    if (observations[n] <= previous || observations[n] >= count) {
      CheckArgument(
          false, "observations[" + std::to_string(n) + "]", observations[n],
          "> " + std::to_string(previous) + " and < " + std::to_string(count));
    }
    previous = observations[n];
  }
}

// The index of `value` among ascending values, if it is one of them.
std::optional<int32_t> FindAscending(const std::vector<int32_t>& values,
                                     int32_t value) {
  const auto found = std::lower_bound(values.begin(), values.end(), value);
  if (found == values.end() || *found != value) return std::nullopt;
  return static_cast<int32_t>(found - values.begin());
}

int32_t FrameOf(const KnownRotationProblem& problem, int64_t observation) {
  return problem.views[problem.observations[observation].view].frame;
}

}  // namespace

ProblemSubset::ProblemSubset(const KnownRotationProblem& whole,
                             std::vector<int64_t> observations)
    : whole_(whole), observation_of_(std::move(observations)) {
  CheckAscending(whole, observation_of_);
  std::vector<char> has_point(whole.num_points, 0);
  std::vector<char> has_view(whole.views.size(), 0);
  std::vector<char> has_frame(whole.num_frames, 0);
  for (const int64_t i : observation_of_) {
    has_point[whole.observations[i].point] = 1;
    has_view[whole.observations[i].view] = 1;
    has_frame[FrameOf(whole, i)] = 1;
  }
  const bool is_whole = observation_of_.size() == whole.observations.size() &&
                        IsAll(has_point) && IsAll(has_view) && IsAll(has_frame);
  if (is_whole) {
    observation_of_ = {};
  } else {
    Copy(has_point, has_view, has_frame);
  }
}

void ProblemSubset::Copy(const std::vector<char>& has_point,
                         const std::vector<char>& has_view,
                         const std::vector<char>& has_frame) {
  const std::vector<int32_t> new_point = Renumber(has_point, &point_of_);
  const std::vector<int32_t> new_view = Renumber(has_view, &view_of_);
  const std::vector<int32_t> new_frame = Renumber(has_frame, &frame_of_);
  copy_ = std::make_unique<KnownRotationProblem>();
  copy_->num_points = static_cast<int32_t>(point_of_.size());
  copy_->num_frames = static_cast<int32_t>(frame_of_.size());
  for (const int32_t v : view_of_) {
    copy_->views.push_back(whole_.views[v]);
    copy_->views.back().frame = new_frame[whole_.views[v].frame];
  }
  const auto copy_fixed =
      [](const std::vector<std::optional<Eigen::Vector3d>>& fixed,
         const std::vector<int32_t>& old_of,
         std::vector<std::optional<Eigen::Vector3d>>* copy) {
        if (fixed.empty()) return;
        for (const int32_t n : old_of) copy->push_back(fixed[n]);
      };
  copy_fixed(whole_.fixed_translations, frame_of_, &copy_->fixed_translations);
  copy_fixed(whole_.fixed_points, point_of_, &copy_->fixed_points);
  copy_->observations.reserve(observation_of_.size());
  for (const int64_t i : observation_of_) {
    copy_->observations.push_back(whole_.observations[i]);
    Observation& observation = copy_->observations.back();
    observation.view = new_view[observation.view];
    observation.point = new_point[observation.point];
  }
  IndexObservations(copy_.get());
}

std::optional<int32_t> ProblemSubset::FindView(int32_t view) const {
  return IsWhole() ? view : FindAscending(view_of_, view);
}

std::optional<int32_t> ProblemSubset::FindPoint(int32_t point) const {
  return IsWhole() ? point : FindAscending(point_of_, point);
}

std::vector<int64_t> ProblemSubset::InWhole(
    std::vector<int64_t> observations) const {
  for (int64_t& i : observations) i = InWhole(i);
  return observations;
}

Estimate ProblemSubset::Restrict(const Estimate& whole) const {
  if (IsWhole()) return whole;
  Estimate estimate;
  for (const int32_t f : frame_of_) {
    estimate.translations.push_back(whole.translations.at(f));
  }
  for (const int32_t k : point_of_) {
    estimate.points.push_back(whole.points.at(k));
  }
  return estimate;
}

void ProblemSubset::Replace(const Estimate& estimate, Estimate* whole) const {
  if (IsWhole()) {
    *whole = estimate;
    return;
  }
  for (size_t f = 0; f < frame_of_.size(); ++f) {
    whole->translations.at(frame_of_[f]) = estimate.translations.at(f);
  }
  for (size_t k = 0; k < point_of_.size(); ++k) {
    whole->points.at(point_of_[k]) = estimate.points.at(k);
  }
}

std::vector<int64_t> PruneUnconstrained(
    const KnownRotationProblem& problem,
    const std::vector<int64_t>& observations) {
  const ProblemSubset part(problem, observations);
  const KnownRotationProblem& p = part.problem();
  const size_t count = observations.size();
  std::vector<int64_t> left_of_point(p.num_points);
  std::vector<int64_t> left_of_frame(p.num_frames);
  std::vector<int64_t> doomed;  // to be dropped; may have duplicates
  std::vector<char> is_dropped(count, 0);

  // If a point or frame has only one observation left, adds it to `doomed`.
  const auto check_point = [&](int32_t k) {
    if (left_of_point[k] != 1 || p.IsFixedPoint(k)) return;
    for (int64_t i = p.point_begin[k]; i < p.point_begin[k + 1]; ++i) {
      if (!is_dropped[i]) doomed.push_back(i);
    }
  };
  const auto check_frame = [&](int32_t f) {
    if (left_of_frame[f] != 1 || p.IsFixedFrame(f)) return;
    for (int64_t n = p.frame_begin[f]; n < p.frame_begin[f + 1]; ++n) {
      const int64_t i = p.frame_observations[n];
      if (!is_dropped[i]) doomed.push_back(i);
    }
  };

  for (int32_t k = 0; k < p.num_points; ++k) {
    left_of_point[k] = p.point_begin[k + 1] - p.point_begin[k];
    check_point(k);
  }
  for (int32_t f = 0; f < p.num_frames; ++f) {
    left_of_frame[f] = p.frame_begin[f + 1] - p.frame_begin[f];
    check_frame(f);
  }
  while (!doomed.empty()) {
    const int64_t i = doomed.back();
    doomed.pop_back();
    if (is_dropped[i]) continue;
    is_dropped[i] = 1;
    const int32_t point = p.observations[i].point;
    const int32_t frame = FrameOf(p, i);
    --left_of_point[point];
    --left_of_frame[frame];
    check_point(point);
    check_frame(frame);
  }

  std::vector<int64_t> kept;
  for (size_t i = 0; i < count; ++i) {
    if (!is_dropped[i]) kept.push_back(observations[i]);
  }
  return kept;
}

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
  int32_t last = -1;  // index of the last point on this rank
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

namespace {

// Unites frames that points of other ranks connect.
void UniteRanks(Ranks* ranks, std::vector<char>* is_seen,
                DisjointSets* frames) {
  const auto num_frames = static_cast<int64_t>(is_seen->size());
  ranks->Reduce([](char a, char b) { return std::max(a, b); }, is_seen);
  std::vector<int64_t> roots;
  for (int64_t f = 0; f < num_frames; ++f) roots.push_back(frames->Find(f));
  const std::vector<int64_t> all = ranks->Gather(roots);
  for (size_t n = 0; n < all.size(); ++n) {
    frames->Unite(static_cast<int64_t>(n) % num_frames, all[n]);
  }
}

// Components of the graph that has only these edges: the observations with the
// indices index_of(n), n < count.
template <typename IndexOf>
Components FindComponentsOf(const KnownRotationProblem& problem, int64_t count,
                            const IndexOf& index_of, const Context& context) {
  const auto point_of = [&](int64_t n) {
    return problem.observations[index_of(n)].point;
  };
  const auto frame_of = [&](int64_t n) { return problem.FrameOf(index_of(n)); };

  // Two frames are connected if they see the same point.
  DisjointSets frames(problem.num_frames);
  std::vector<char> is_seen(problem.num_frames, 0);
  for (int64_t n = 0; n < count; ++n) {
    is_seen[frame_of(n)] = 1;
    if (n > 0 && point_of(n) == point_of(n - 1)) {
      frames.Unite(frame_of(n), frame_of(n - 1));
    }
  }
  if (context.ranks != nullptr) UniteRanks(context.ranks, &is_seen, &frames);

  Components components;
  components.of_frame.assign(problem.num_frames, -1);
  components.of_point.assign(problem.num_points, -1);
  for (int32_t frame = 0; frame < problem.num_frames; ++frame) {
    if (!is_seen[frame]) continue;
    const int64_t root = frames.Find(frame);
    components.of_frame[frame] =
        root == frame ? components.count++ : components.of_frame[root];
  }
  for (int64_t n = 0; n < count; ++n) {
    components.of_point[point_of(n)] = components.of_frame[frame_of(n)];
  }
  return components;
}

}  // namespace

Components FindComponents(const KnownRotationProblem& problem,
                          const Context& context) {
  return FindComponentsOf(
      problem, static_cast<int64_t>(problem.observations.size()),
      [](int64_t n) { return n; }, context);
}

std::vector<std::vector<int64_t>> SplitIntoComponents(
    const KnownRotationProblem& problem) {
  return SplitIntoComponents(
      problem,
      NumbersUpTo<int64_t>(static_cast<int64_t>(problem.observations.size())));
}

std::vector<std::vector<int64_t>> SplitIntoComponents(
    const KnownRotationProblem& problem, std::vector<int64_t> observations) {
  const Components components =
      FindComponentsOf(problem, static_cast<int64_t>(observations.size()),
                       [&](int64_t n) { return observations[n]; }, {});
  std::vector<std::vector<int64_t>> split(components.count);
  if (components.count == 1) {
    split[0] = std::move(observations);
    return split;
  }
  for (const int64_t i : observations) {
    split[components.of_point[problem.observations[i].point]].push_back(i);
  }
  return split;
}

}  // namespace krot::internal
