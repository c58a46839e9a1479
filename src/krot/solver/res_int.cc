#include "krot/solver/res_int.h"

#include <algorithm>
#include <cmath>

#include "krot/base/check.h"
#include "krot/base/parallel_for.h"
#include "krot/base/timer.h"
#include "krot/problem/cost.h"
#include "krot/problem/observation_rows.h"

namespace krot {
namespace {

// Points are many and small, frames few and large.
constexpr int64_t kPointsPerChunk = 256;
constexpr int64_t kFramesPerChunk = 1;

// One FastDescent per thread: their scratch memory stays warm over all sweeps.
class BlockSolver {
 public:
  BlockSolver(const KnownRotationProblem& problem, const ResIntOptions& options)
      : problem_(problem),
        options_(options),
        num_threads_(ResolveNumThreads(options.num_threads)),
        descents_(num_threads_,
                  FastDescent(options.fast_descent, options.norm)) {}

  // Every point's own optimum with the frames fixed: (Int_k) for all k.
  void IntersectPoints(Estimate* estimate) {
    ParallelFor(problem_.num_points, kPointsPerChunk, num_threads_,
                [&](int64_t begin, int64_t end, int worker) {
                  if (IsCancelled(options_.cancel)) return;
                  for (int64_t k = begin; k < end; ++k) {
                    IntersectPoint(k, &descents_[worker], estimate);
                  }
                });
  }

  // Every frame's own optimum with the points fixed: (Res_j) for all j.
  void ResectFrames(Estimate* estimate) {
    ParallelFor(problem_.num_frames, kFramesPerChunk, num_threads_,
                [&](int64_t begin, int64_t end, int worker) {
                  if (IsCancelled(options_.cancel)) return;
                  for (int64_t f = begin; f < end; ++f) {
                    ResectFrame(f, &descents_[worker], estimate);
                  }
                });
  }

 private:
  void IntersectPoint(int64_t k, FastDescent* descent, Estimate* estimate) {
    const int64_t begin = problem_.point_begin[k];
    const int64_t end = problem_.point_begin[k + 1];
    if (begin == end) return;
    double row[kResidualRow];
    descent->residuals().Clear();
    for (int64_t i = begin; i < end; ++i) {
      const Observation& observation = problem_.observations[i];
      const View& view = problem_.views[observation.view];
      IntersectionRow(view, observation, estimate->translations[view.frame],
                      row);
      descent->residuals().Add(row);
    }
    descent->Minimize(&estimate->points[k]);
  }

  void ResectFrame(int64_t f, FastDescent* descent, Estimate* estimate) {
    const int64_t begin = problem_.frame_begin[f];
    const int64_t end = problem_.frame_begin[f + 1];
    if (begin == end) return;
    double row[kResidualRow];
    descent->residuals().Clear();
    for (int64_t n = begin; n < end; ++n) {
      const Observation& observation =
          problem_.observations[problem_.frame_observations[n]];
      ResectionRow(problem_.views[observation.view], observation,
                   estimate->points[observation.point], row);
      descent->residuals().Add(row);
    }
    descent->Minimize(&estimate->translations[f]);
  }

  const KnownRotationProblem& problem_;
  const ResIntOptions& options_;
  const int num_threads_;
  std::vector<FastDescent> descents_;
};

void CheckOptions(const ResIntOptions& options) {
  CheckArgument(options.norm.p >= 1, "norm.p", options.norm.p, ">= 1");
  CheckArgument(options.max_sweeps >= 0, "max_sweeps", options.max_sweeps,
                ">= 0");
  CheckArgument(options.sweep_tolerance >= 0, "sweep_tolerance",
                options.sweep_tolerance, ">= 0");
}

}  // namespace

ResIntSummary SolveResInt(const KnownRotationProblem& problem,
                          const ResIntOptions& options, Estimate* estimate) {
  CheckOptions(options);
  const Timer timer;
  ResIntSummary summary;
  double cost = Cost(problem, *estimate, options.norm, options.num_threads);
  CheckArgument(std::isfinite(cost), "cost of the start", cost,
                "finite: all depths positive");
  summary.cost_initial = summary.cost_final = cost;
  summary.termination = ResIntTermination::kMaxSweeps;

  BlockSolver blocks(problem, options);
  for (int sweep = 1; sweep <= options.max_sweeps; ++sweep) {
    blocks.IntersectPoints(estimate);
    if (options.update_frames) blocks.ResectFrames(estimate);
    const double cost_before = cost;
    cost = Cost(problem, *estimate, options.norm, options.num_threads);
    summary.cost_final = cost;
    if (IsCancelled(options.cancel)) {
      summary.termination = ResIntTermination::kInterrupted;
      break;
    }
    summary.sweeps.push_back({cost, timer.Seconds()});
    if (options.callback) options.callback(sweep, summary.sweeps.back());
    if (cost_before - cost <= options.sweep_tolerance * cost_before) {
      summary.termination = ResIntTermination::kStalled;
      break;
    }
  }
  return summary;
}

}  // namespace krot
