#pragma once

#include <memory>
#include <vector>

#include "krot/base/context.h"
#include "krot/minimax/fast_descent.h"
#include "krot/minimax/side_by_side_descent.h"
#include "krot/problem/cameras.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/sweeps/frame_share.h"

namespace krot {

// The two half-sweeps of [Zhang18, Alg. 1]. Blocks are independent of each
// other and spread over threads; the result does not depend on how many. Points
// are solved side by side, in the order of their numbers of observations. Each
// thread keeps its descents, so that sweeps do not allocate once warm.
// Once it is cancelled, the blocks that are left are skipped. What the problem
// fixes stays.
//
// Where ranks share the points each takes its own, and a share of the frames
// (frame_share.h): they call both together.
//
// Both return the cost that is reached, pixels, to rounding what Cost() gives:
// infinity where a block starts at a depth that is not positive, and then the
// estimate is of no use.
class BlockSweep {
 public:
  // Keeps a reference to `problem`.
  BlockSweep(const KnownRotationProblem& problem,
             const FastDescentOptions& options, Norm norm,
             const Context& context);

  // How far blocks go from now on; at first, to their optima.
  void SetGoal(const DescentGoal& goal) { goal_ = goal; }

  // Line 3: every point's own optimum, the frames fixed: (Int_k) for all k.
  double IntersectPoints(Estimate* estimate);

  // Line 4: every frame's own optimum, the points fixed: (Res_j) for all j.
  double ResectFrames(Estimate* estimate);

 private:
  // What a thread keeps.
  struct Worker {
    FastDescent frame_descent;
    SideBySideDescent point_descent;
    std::vector<int32_t> points;
    std::vector<SideBySideDescent::Problem> problems;
  };

  Worker* WorkerOf(int worker);
  template <typename Function>
  double LargestOver(int64_t num_blocks, int64_t blocks_per_chunk,
                     const Function& minimize);
  int64_t NumObservations(int32_t point) const {
    return problem_.point_begin[point + 1] - problem_.point_begin[point];
  }
  double IntersectPoints(int64_t begin, int64_t end, int worker,
                         Estimate* estimate);
  double ChoosePoints(int64_t begin, int64_t end, const Estimate& estimate,
                      std::vector<int32_t>* points) const;
  double ResectShare(Estimate* estimate);
  void AddPointRows(int32_t point, SideBySideDescent::RowWriter* writer) const;
  double ResectFrame(int64_t f, FastDescent* descent, Estimate* estimate);

  const KnownRotationProblem& problem_;
  const FastDescentOptions options_;
  Norm norm_;
  const Context context_;
  DescentGoal goal_;
  // One per thread, made when that begins: of a thousand only a few may exist.
  std::vector<std::unique_ptr<Worker>> workers_;
  std::vector<AffineMap> cameras_;  // per view, while points move
  std::vector<char> is_reference_;  // per view
  // Every block's warm start.
  std::vector<ActiveResiduals> point_active_;
  std::vector<ActiveResiduals> frame_active_;
  // Where ranks share the points, once frames have moved.
  std::unique_ptr<FrameShare> frame_share_;
  std::unique_ptr<BlockSweep> frame_blocks_;
};

}  // namespace krot
