#include "krot/sweeps/block_sweep.h"

#include <algorithm>
#include <limits>

#include "krot/base/parallel_for.h"
#include "krot/problem/cost.h"
#include "krot/problem/observation_rows.h"

namespace krot {
namespace {

// Points are many and small, frames few and large.
constexpr int64_t kPointsPerChunk = 256;
constexpr int64_t kFramesPerChunk = 1;
constexpr int64_t kPrefetchAhead = 16;

}  // namespace

BlockSweep::BlockSweep(const KnownRotationProblem& problem,
                       const FastDescentOptions& options, Norm norm,
                       const Context& context)
    : problem_(problem),
      options_(options),
      norm_(norm),
      context_(context),
      descents_(ResolveNumThreads(context.num_threads),
                FastDescent(options, norm)),
      point_active_(problem.num_points),
      frame_active_(problem.num_frames) {}

double BlockSweep::IntersectPoints(Estimate* estimate) {
  cameras_ = CamerasFromWorld(problem_, estimate->translations);
  return context_.Max(LargestOver(problem_.num_points, kPointsPerChunk,
                                  [&](int64_t k, FastDescent* descent) {
                                    return IntersectPoint(k, descent, estimate);
                                  }));
}

double BlockSweep::ResectFrames(Estimate* estimate) {
  if (context_.ranks != nullptr) return ResectShare(estimate);
  return LargestOver(problem_.num_frames, kFramesPerChunk,
                     [&](int64_t f, FastDescent* descent) {
                       return ResectFrame(f, descent, estimate);
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

// The largest of what `minimize` returns for every block.
template <typename Function>
double BlockSweep::LargestOver(int64_t num_blocks, int64_t blocks_per_chunk,
                               const Function& minimize) {
  std::vector<double> chunk_max(NumChunks(num_blocks, blocks_per_chunk), 0);
  ParallelFor(num_blocks, blocks_per_chunk, static_cast<int>(descents_.size()),
              [&](int64_t begin, int64_t end, int worker) {
                if (context_.IsCancelled()) return;
                double largest = 0;
                for (int64_t block = begin; block < end; ++block) {
                  largest =
                      std::max(largest, minimize(block, &descents_[worker]));
                }
                chunk_max[begin / blocks_per_chunk] = largest;
              });
  return chunk_max.empty()
             ? 0.0
             : *std::max_element(chunk_max.begin(), chunk_max.end());
}

double BlockSweep::IntersectPoint(int64_t k, FastDescent* descent,
                                  Estimate* estimate) {
  const int64_t begin = problem_.point_begin[k];
  const int64_t end = problem_.point_begin[k + 1];
  if (begin == end) return 0;
  if (problem_.IsFixedPoint(static_cast<int32_t>(k))) {
    return ResidualAbove(std::numeric_limits<double>::infinity(), problem_,
                         cameras_, estimate->points, norm_, begin, end);
  }
  if (goal_.level > 0) {  // whether it waits is known before rows are built
    const double cost = ResidualAbove(goal_.level, problem_, cameras_,
                                      estimate->points, norm_, begin, end);
    if (cost <= goal_.level) return cost;
  }
  double row[kResidualRow];
  descent->residuals().Clear();
  for (int64_t i = begin; i < end; ++i) {
    const Observation& observation = problem_.observations[i];
    IntersectionRow(cameras_[observation.view], observation, row);
    descent->residuals().Add(row);
  }
  return descent->Minimize(goal_, &point_active_[k], &estimate->points[k]).cost;
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
    // The observations of a frame lie far apart.
    if (n + kPrefetchAhead < end) {
      __builtin_prefetch(
          &problem_
               .observations[problem_.frame_observations[n + kPrefetchAhead]]);
    }
    const Observation& observation =
        problem_.observations[problem_.frame_observations[n]];
    ResectionRow(problem_.views[observation.view], observation,
                 estimate->points[observation.point], row);
    descent->residuals().Add(row);
  }
  return descent->Minimize(goal_, &frame_active_[f], &estimate->translations[f])
      .cost;
}

}  // namespace krot
