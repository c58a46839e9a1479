#include "krot/solver/block_sweep.h"

#include "krot/base/parallel_for.h"
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
                       int num_threads, const CancelFlag* cancel)
    : problem_(problem),
      cancel_(cancel),
      num_threads_(ResolveNumThreads(num_threads)),
      descents_(num_threads_, FastDescent(options, norm)),
      point_active_(problem.num_points),
      frame_active_(problem.num_frames) {}

void BlockSweep::IntersectPoints(Estimate* estimate) {
  ParallelFor(problem_.num_points, kPointsPerChunk, num_threads_,
              [&](int64_t begin, int64_t end, int worker) {
                if (IsCancelled(cancel_)) return;
                for (int64_t k = begin; k < end; ++k) {
                  IntersectPoint(k, &descents_[worker], estimate);
                }
              });
}

void BlockSweep::ResectFrames(Estimate* estimate) {
  ParallelFor(problem_.num_frames, kFramesPerChunk, num_threads_,
              [&](int64_t begin, int64_t end, int worker) {
                if (IsCancelled(cancel_)) return;
                for (int64_t f = begin; f < end; ++f) {
                  ResectFrame(f, &descents_[worker], estimate);
                }
              });
}

void BlockSweep::IntersectPoint(int64_t k, FastDescent* descent,
                                Estimate* estimate) {
  const int64_t begin = problem_.point_begin[k];
  const int64_t end = problem_.point_begin[k + 1];
  if (begin == end) return;
  double row[kResidualRow];
  descent->residuals().Clear();
  for (int64_t i = begin; i < end; ++i) {
    const Observation& observation = problem_.observations[i];
    const View& view = problem_.views[observation.view];
    IntersectionRow(view, observation, estimate->translations[view.frame], row);
    descent->residuals().Add(row);
  }
  descent->Minimize(goal_, &point_active_[k], &estimate->points[k]);
}

void BlockSweep::ResectFrame(int64_t f, FastDescent* descent,
                             Estimate* estimate) {
  const int64_t begin = problem_.frame_begin[f];
  const int64_t end = problem_.frame_begin[f + 1];
  if (begin == end) return;
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
  descent->Minimize(goal_, &frame_active_[f], &estimate->translations[f]);
}

}  // namespace krot
