#include "krot/sweeps/block_sweep.h"

#include <algorithm>
#include <limits>

#include "krot/base/parallel_for.h"
#include "krot/problem/cost.h"
#include "krot/problem/observation_rows.h"

namespace krot {
namespace {

// Points are many and small, frames few and large. More points at a time would
// not fit in a core's cache, of fewer a larger part are the last ones, whose
// neighbours' lanes are idle.
constexpr int64_t kPointsPerChunk = 512;
constexpr int64_t kFramesPerChunk = 1;

// The observations of a frame lie far apart, and so do their points. So many
// ahead they are fetched: with half as many a frame takes a quarter longer.
constexpr int64_t kObservationsAhead = 32;
constexpr int64_t kFramePointsAhead = 8;
constexpr int64_t kCacheLine = 64;  // bytes

// Inlined by force: to GCC a function that does no more has no effect, and its
// calls are dropped.
[[gnu::always_inline]] inline void Prefetch(const void* memory, int64_t size) {
  const char* begin = static_cast<const char*>(memory);
  for (int64_t i = 0; i < size; i += kCacheLine) __builtin_prefetch(begin + i);
}

// The observations of a point.
[[gnu::always_inline]] inline void PrefetchPoint(
    const KnownRotationProblem& problem, int32_t point) {
  const int64_t begin = problem.point_begin[point];
  const int64_t count = problem.point_begin[point + 1] - begin;
  Prefetch(&problem.observations[begin],
           count * static_cast<int64_t>(sizeof(Observation)));
}

// What is wanted soon after a frame's observation number n, before `end`.
[[gnu::always_inline]] inline void PrefetchFrame(
    const KnownRotationProblem& problem, const Estimate& estimate, int64_t n,
    int64_t end) {
  const std::vector<int32_t>& index = problem.frame_observations;
  if (n + kObservationsAhead < end) {
    Prefetch(&problem.observations[index[n + kObservationsAhead]],
             sizeof(Observation));
  }
  if (n + kFramePointsAhead < end) {
    const Observation& soon =
        problem.observations[index[n + kFramePointsAhead]];
    Prefetch(&estimate.points[soon.point], sizeof(Eigen::Vector3d));
  }
}

}  // namespace

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
  WorkerOf(0);  // tells of wrong options here
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
  return context_.Max(LargestOver(problem_.num_points, kPointsPerChunk,
                                  [&](int64_t begin, int64_t end, int worker) {
                                    return IntersectPoints(begin, end, worker,
                                                           estimate);
                                  }));
}

double BlockSweep::ResectFrames(Estimate* estimate) {
  if (context_.ranks != nullptr) return ResectShare(estimate);
  return LargestOver(
      problem_.num_frames, kFramesPerChunk,
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
        frame_share_->problem(), options_, norm_, context_.Alone());
  }
  Estimate share = frame_share_->Receive(*estimate);
  frame_blocks_->SetGoal(goal_);
  const double cost = frame_blocks_->ResectFrames(&share);
  frame_share_->Publish(share, estimate);
  return context_.Max(cost);
}

// The largest of what `minimize` returns for every chunk of blocks.
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
        if (n + 1 < count) PrefetchPoint(problem_, points[n + 1]);
        AddPointRows(points[n], writer);
      },
      &problems);
  for (const SideBySideDescent::Problem& problem : problems) {
    largest = std::max(largest, problem.summary.cost);
  }
  return largest;
}

// The points that are to move, those with few observations first. Returns the
// largest cost of the others: of fixed points and of those that wait, which is
// known before rows are built.
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
  for (int64_t i = problem_.point_begin[point];
       i < problem_.point_begin[point + 1]; ++i) {
    const Observation& observation = problem_.observations[i];
    IntersectionRow(cameras_[observation.view], observation, row);
    writer->Add(row);
  }
}

double BlockSweep::ResectFrame(int64_t f, FastDescent* descent,
                               Estimate* estimate) {
  const int64_t begin = problem_.frame_begin[f];
  const int64_t end = problem_.frame_begin[f + 1];
  if (begin == end) return 0;
  if (problem_.IsFixedFrame(static_cast<int32_t>(f))) {
    return FrameCost(problem_, *estimate, norm_, f);
  }
  double row[kResidualRow];
  descent->residuals().Clear();
  for (int64_t n = begin; n < end; ++n) {
    PrefetchFrame(problem_, *estimate, n, end);
    const Observation& observation =
        problem_.observations[problem_.frame_observations[n]];
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

}  // namespace krot
