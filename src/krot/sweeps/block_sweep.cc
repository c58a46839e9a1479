#include "krot/sweeps/res_int.h"

#include <algorithm>
#include <functional>
#include <limits>
#include <numeric>
#include <utility>

#include "krot/base/parallel_for.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

// The first frame of each rank, and the end, such that all ranks get about the
// same number of observations.
std::vector<int32_t> CutFrames(const KnownRotationProblem& problem,
                               Ranks* ranks) {
  std::vector<int64_t> counts;
  for (int32_t f = 0; f < problem.num_frames; ++f) {
    counts.push_back(problem.frame_begin[f + 1] - problem.frame_begin[f]);
  }
  ranks->Reduce(std::plus<int64_t>(), &counts);
  const int64_t total =
      std::accumulate(counts.begin(), counts.end(), int64_t{0});
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

// The observations of a frame are far apart in memory, and so are their points.
// They are prefetched by this many observations: without that, sweeps take 6 to
// 30 % longer.
constexpr int64_t kObservationsAhead = 32;
constexpr int64_t kPointsAhead = 8;

// Fetches memory into the cache, by lines of 64 bytes. It must be inlined, as
// GCC removes calls of functions that only prefetch.
[[gnu::always_inline]] inline void Prefetch(const void* memory, int64_t size) {
  const char* begin = static_cast<const char*>(memory);
  for (int64_t i = 0; i < size; i += 64) __builtin_prefetch(begin + i);
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

BlockSweep::BlockSweep(const KnownRotationProblem& problem,
                       const FastDescentOptions& options, Norm norm,
                       const Context& context)
    : problem_(problem),
      options_(options),
      norm_(norm),
      context_(context),
      workers_(ResolveNumThreads(context.num_threads)),
      point_active_(problem.num_points),
      frame_active_(problem.num_frames) {
  for (const View& view : problem.views) {
    is_reference_.push_back(IsReference(view));
  }
  WorkerOf(0);  // so that wrong options throw here already
}

BlockSweep::Worker* BlockSweep::WorkerOf(int worker) {
  std::unique_ptr<Worker>& its = workers_[worker];
  if (its == nullptr) {
    its.reset(new Worker{FastDescent(options_, norm_),
                         SideBySideDescent(options_, norm_),
                         {},
                         {}});
  }
  return its.get();
}

double BlockSweep::IntersectPoints(Estimate* estimate) {
  cameras_ = CamerasFromWorld(problem_, estimate->translations);
  // More points at a time would not fit into a core's cache. With fewer, lanes
  // are idle more often, at the end of each chunk.
  return MaxOfRanks(context_,
                    LargestOver(problem_.num_points, /*blocks_per_chunk=*/512,
                                [&](int64_t begin, int64_t end, int worker) {
                                  return IntersectPoints(begin, end, worker,
                                                         estimate);
                                }));
}

double BlockSweep::ResectFrames(Estimate* estimate) {
  if (context_.ranks != nullptr) return ResectShare(estimate);
  return LargestOver(
      problem_.num_frames, /*blocks_per_chunk=*/1,
      [&](int64_t begin, int64_t end, int worker) {
        double largest = 0;
        for (int64_t f = begin; f < end; ++f) {
          FastDescent* descent = &WorkerOf(worker)->frame_descent;
          largest = std::max(largest, ResectFrame(f, descent, estimate));
        }
        return largest;
      });
}

double BlockSweep::ResectShare(Estimate* estimate) {
  if (!frame_share_) {
    frame_share_ = std::make_unique<FrameShare>(problem_, context_.ranks);
    frame_blocks_ = std::make_unique<BlockSweep>(
        frame_share_->problem(), options_, norm_, WithoutRanks(context_));
  }
  Estimate share = frame_share_->Receive(*estimate);
  frame_blocks_->SetGoal(goal_);
  const double cost = frame_blocks_->ResectFrames(&share);
  frame_share_->Publish(share, estimate);
  return MaxOfRanks(context_, cost);
}

// The largest of the values that `minimize` returns for the chunks of blocks.
template <typename Function>
double BlockSweep::LargestOver(int64_t num_blocks, int64_t blocks_per_chunk,
                               const Function& minimize) {
  std::vector<double> chunk_max(NumChunks(num_blocks, blocks_per_chunk), 0);
  ParallelFor(num_blocks, blocks_per_chunk, static_cast<int>(workers_.size()),
              [&](int64_t begin, int64_t end, int worker) {
                if (context_.IsCancelled()) return;
                chunk_max[begin / blocks_per_chunk] =
                    minimize(begin, end, worker);
              });
  return chunk_max.empty()
             ? 0.0
             : *std::max_element(chunk_max.begin(), chunk_max.end());
}

double BlockSweep::IntersectPoints(int64_t begin, int64_t end, int worker,
                                   Estimate* estimate) {
  Worker& own = *WorkerOf(worker);
  std::vector<int32_t>& points = own.points;
  double largest = ChoosePoints(begin, end, *estimate, &points);
  std::vector<SideBySideDescent::Problem>& problems = own.problems;
  problems.clear();
  for (const int32_t k : points) {
    problems.push_back({&estimate->points[k], &point_active_[k]});
  }
  const int count = static_cast<int>(points.size());
  own.point_descent.Minimize(
      goal_,
      [&](int n, SideBySideDescent::RowWriter* writer) {
        if (n + 1 < count) {
          const int32_t next = points[n + 1];
          Prefetch(&problem_.observations[problem_.point_begin[next]],
                   NumObservations(next) *
                       static_cast<int64_t>(sizeof(Observation)));
        }
        AddPointRows(points[n], writer);
      },
      &problems);
  for (const SideBySideDescent::Problem& problem : problems) {
    largest = std::max(largest, problem.summary.cost);
  }
  return largest;
}

// Lists the points that are to move, those with few observations first. Fixed
// points and points below the goal's level do not move; returns the largest
// cost of these.
double BlockSweep::ChoosePoints(int64_t begin, int64_t end,
                                const Estimate& estimate,
                                std::vector<int32_t>* points) const {
  points->clear();
  double largest = 0;
  for (int32_t k = static_cast<int32_t>(begin); k < end; ++k) {
    const bool is_fixed = problem_.IsFixedPoint(k);
    const double level =
        is_fixed ? std::numeric_limits<double>::infinity() : goal_.level;
    if (NumObservations(k) == 0) continue;
    if (level > 0) {
      const double cost =
          ResidualAbove(level, problem_, cameras_, estimate.points, norm_,
                        problem_.point_begin[k], problem_.point_begin[k + 1]);
      if (cost <= level) {
        largest = std::max(largest, cost);
        continue;
      }
    }
    points->push_back(k);
  }
  std::sort(points->begin(), points->end(), [this](int32_t a, int32_t b) {
    const int64_t difference = NumObservations(a) - NumObservations(b);
    return difference != 0 ? difference < 0 : a < b;
  });
  return largest;
}

void BlockSweep::AddPointRows(int32_t point,
                              SideBySideDescent::RowWriter* writer) const {
  double row[kResidualRow];
  for (const int64_t i : problem_.OfPoint(point)) {
    const Observation& observation = problem_.observations[i];
    AffineRow(cameras_[observation.view], observation, row);
    writer->Add(row);
  }
}

double BlockSweep::ResectFrame(int64_t f, FastDescent* descent,
                               Estimate* estimate) {
  const int64_t begin = problem_.frame_begin[f];
  const int64_t end = problem_.frame_begin[f + 1];
  if (begin == end) return 0;
  if (problem_.IsFixedFrame(static_cast<int32_t>(f))) {
    return CostOf(problem_, *estimate, norm_, problem_.OfFrame(f));
  }
  const auto observation_of = [&](int64_t n) -> const Observation& {
    return problem_.observations[problem_.frame_observations[n]];
  };
  double row[kResidualRow];
  descent->residuals().Clear();
  for (int64_t n = begin; n < end; ++n) {
    if (n + kObservationsAhead < end) {
      Prefetch(&observation_of(n + kObservationsAhead), sizeof(Observation));
    }
    if (n + kPointsAhead < end) {
      const int32_t soon = observation_of(n + kPointsAhead).point;
      Prefetch(&estimate->points[soon], sizeof(Eigen::Vector3d));
    }
    const Observation& observation = observation_of(n);
    const View& view = problem_.views[observation.view];
    const Eigen::Vector3d& point = estimate->points[observation.point];
    if (is_reference_[observation.view]) {
      ReferenceResectionRow(view, observation, point, row);
    } else {
      ResectionRow(view, observation, point, row);
    }
    descent->residuals().Add(row);
  }
  return descent->Minimize(goal_, &frame_active_[f], &estimate->translations[f])
      .cost;
}

}  // namespace krot::internal
