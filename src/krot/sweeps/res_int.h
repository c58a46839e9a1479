#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "krot/base/context.h"
#include "krot/geometry.h"
#include "krot/minimax/fast_descent.h"
#include "krot/problem/cost.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/solve.h"

namespace krot::internal {

// Where ranks share the points: the frames that this rank resects, as a problem
// of their own. They are consecutive, and the observations of each rank's
// frames are about equally many. Their observations are stored a second time,
// in the order of the whole problem, so that a frame's sub-problem has the same
// rows as in one process.
//
// Every rank makes one, and all call its functions together.
class FrameShare {
 public:
  FrameShare(const KnownRotationProblem& problem, Ranks* ranks);

  // All frames and views, the observations of this rank's frames, and the
  // points of these observations.
  const KnownRotationProblem& problem() const { return problem_; }

  // Returns the estimate of problem(), made of all ranks' estimates. For each
  // of its points a rank sends 24 bytes to each rank whose frames see it.
  Estimate Receive(const Estimate& estimate) const;

  // Sends the translations of this rank's frames to all ranks.
  void Publish(const Estimate& share, Estimate* estimate) const;

 private:
  Ranks& ranks_;
  KnownRotationProblem problem_;
  std::vector<int32_t> frame_begin_;  // first frame per rank, and the end
  // Per rank, the points of this rank that its frames see.
  std::vector<std::vector<int32_t>> seen_by_;
};

// The two half-sweeps of [Zhang18, Alg. 1]. Blocks are points and frames; they
// are independent of each other and spread over threads. The result does not
// depend on the number of threads. Points are solved side by side, those with
// few observations first. Each thread keeps its descents, so that sweeps do not
// allocate once warm. After a cancellation the remaining blocks are skipped.
// Fixed points and frames do not move.
//
// Where ranks share the points, each takes its own points and a share of the
// frames; all ranks call both functions together.
//
// Both return the cost that is reached, pixels, which is Cost() up to rounding.
// It is infinite if a block starts at a depth that is not positive; then the
// estimate is useless.
class BlockSweep {
 public:
  // Keeps a reference to `problem`.
  BlockSweep(const KnownRotationProblem& problem,
             const FastDescentOptions& options, Norm norm,
             const Context& context);

  // Sets how far blocks go from now on. Initially they go to their optima.
  void SetGoal(const DescentGoal& goal) { goal_ = goal; }

  // Line 3: every point's own optimum, the frames fixed: (Int_k) for all k.
  double IntersectPoints(Estimate* estimate);

  // Line 4: every frame's own optimum, the points fixed: (Res_j) for all j.
  double ResectFrames(Estimate* estimate);

 private:
  // The memory that a thread keeps between sweeps.
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
  // One per thread, made at its first use, because the system may provide fewer
  // threads than were asked for.
  std::vector<std::unique_ptr<Worker>> workers_;
  std::vector<AffineMap> cameras_;  // per view, while points move
  std::vector<char> is_reference_;  // per view
  // The warm starts of all blocks.
  std::vector<ActiveResiduals> point_active_;
  std::vector<ActiveResiduals> frame_active_;
  // Used where ranks share the points; made when frames first move.
  std::unique_ptr<FrameShare> frame_share_;
  std::unique_ptr<BlockSweep> frame_blocks_;
};

// Resection-Intersection [Zhang18, Alg. 1]: sweeps that minimise every
// point's own maximum residual with the frames fixed, then every frame's with
// the points fixed. With `paper` settings of the descent the sweeps are the
// paper's. With `fast` settings they have momentum, and are coarse at first: a
// block whose maximum is below half of the cost does not move, and any other
// stops once a step promises less than a tolerance, relative, which is a tenth
// of the last sweep's relative gain, limited to [1e-3, 1e-2]. When coarse
// sweeps no longer help, and in the last of `max_sweeps`, every block goes to
// its optimum.
//
// At best the result is a fixed point of such sweeps. Unlike the paper says,
// that need not be the optimum (docs/method/problem.md, "How alternation gets
// stuck").

struct Sweep {
  double cost = 0;     // the lowest so far, up to rounding; pixels
  double seconds = 0;  // wall clock since the start
};

struct ResIntOptions {
  Norm norm;
  // As in the paper, or faster methods for the same sub-problems.
  FastDescentOptions fast_descent;
  int max_sweeps = 1000;  // >= 0
  // Stop when sweeps lower the cost by less than this, relative; >= 0.
  double sweep_tolerance = 1e-6;
  // Stop after this many such sweeps in a row; >= 1. A sweep with momentum may
  // fail where the next one, without momentum, does not. Paper settings stop
  // after the first.
  int patience = 3;
  bool update_frames = true;  // false: points only (triangulation)
  // Called after every sweep, counted from 1; may be empty.
  std::function<void(int sweep, const Sweep&)> callback;
};

struct ResIntSummary {
  // kStalled: sweeps lower the cost by less than the tolerance; kMaxSweeps or
  // kInterrupted.
  SolveTermination termination = SolveTermination::kNotRun;
  double cost_initial = 0;  // pixels
  double cost_final = 0;    // <= cost_initial
  std::vector<Sweep> sweeps;
};

// Improves `estimate`, all of whose depths must be positive (throws
// std::invalid_argument otherwise). The cost never rises. Beyond the problem
// it needs about 200 bytes per point and per frame.
ResIntSummary SolveResInt(const KnownRotationProblem& problem,
                          const ResIntOptions& options, const Context& context,
                          Estimate* estimate);

}  // namespace krot::internal
