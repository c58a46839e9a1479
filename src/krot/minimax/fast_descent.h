#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "krot/math/simplex_qp.h"
#include "krot/minimax.h"
#include "krot/minimax/kernels.h"
#include "krot/minimax/newton_descent.h"
#include "krot/minimax/residual_set.h"

namespace krot::internal {

// The normalised negative gradients of the active residuals, G of
// [Zhang18, (6)]: all r_i(x) >= (1 - active_tolerance) max_i r_i(x), (5) with
// a relative tolerance. For p = 1 and infinity every active piece of an active
// residual contributes one. Residuals without gradient (r = 0) contribute
// none. Requires that residuals.Evaluate(x, norm) was the last evaluation.
// O(N).
void FindDescentNormals(const ResidualSet& residuals, const Eigen::Vector3d& x,
                        Norm norm, double active_tolerance,
                        std::vector<Eigen::Vector3d>* descent_normals);

// The unit vector along the centre of the minimum enclosing ball of the
// descent normals [Zhang18, Alg. 3]; none if the centre is within
// `stationarity_tolerance` (eps_0) of the origin or there are no normals. For
// up to four normals it uses the closed form; for more, the point of least norm
// of their convex hull, which is the same. `scratch` keeps its memory between
// calls.
std::optional<Eigen::Vector3d> FindDescentDirection(
    const std::vector<Eigen::Vector3d>& descent_normals,
    double stationarity_tolerance, std::vector<LinearPiece>* scratch);

// A residual along a line:  r(alpha) = ||u alpha + v||_p / (w alpha + z)
// [Zhang18, (28)].
struct LineResidual {
  Eigen::Vector2d u;
  Eigen::Vector2d v;
  double w = 0;
  double z = 0;
};

// The step alpha >= 0 along the unit vector `direction` that minimises the
// largest residual, by modified bisection [Zhang18, Alg. 4]. `scratch` keeps
// its memory between calls. About 3 log2(max_step / step_tolerance)
// evaluations of all residuals.
double FindStepSize(const ResidualSet& residuals, const Eigen::Vector3d& x,
                    const Eigen::Vector3d& direction, Norm norm,
                    const FastDescentOptions& options,
                    std::vector<LineResidual>* scratch);

// Throws std::invalid_argument naming the first field out of range.
void CheckOptions(const FastDescentOptions& options);

// Solves problems (1), min over x in R^3 of max_i r_i(x), one after another
// [Zhang18, Alg. 2]. Owns the residuals and the scratch memory, so that
// refilling and solving do not allocate once warm. Not thread-safe: use one per
// thread.
class FastDescent {
 public:
  // Throws std::invalid_argument for options or a p out of range.
  FastDescent(const FastDescentOptions& options, Norm norm);

  ResidualSet& residuals() { return residuals_; }

  // Lowers the cost from *x; never raises it. If a depth at *x is not positive,
  // does nothing, and the cost is infinite.
  DescentSummary Minimize(Eigen::Vector3d* x);

  // The same, but only as far as `goal` asks. `*active` is a warm start and
  // becomes that of the next descent. kPaper ignores both.
  DescentSummary Minimize(const DescentGoal& goal, ActiveResiduals* active,
                          Eigen::Vector3d* x);

 private:
  DescentSummary MinimizeAsInPaper(Eigen::Vector3d* x);

  FastDescentOptions options_;
  Norm norm_;
  ResidualSet residuals_;
  NewtonDescent newton_;
  std::vector<Eigen::Vector3d> descent_normals_;
  std::vector<LinearPiece> pieces_;
  std::vector<LineResidual> line_;
};

// Solves many small problems (1), min over x in R^3 of max_i r_i(x), to the
// same goal as FastDescent. For p = 2 it solves eight at a time, one per lane
// of a vector (kernels.h); a lane whose problem ends takes the next one. The
// result of a problem does not depend on the other problems or on their order.
//
// FastDescent solves problems that are difficult for lanes (an optimum far
// away, many steps) or have more than 128 residuals, from their start. It
// solves all of them with `paper` settings, with other norms, and on machines
// with short vectors (LaneKernels::lanes_pay).
class SideBySideDescent {
 public:
  struct Problem {
    // The start, which becomes the optimum. Not null.
    Eigen::Vector3d* x = nullptr;
    // A warm start, which becomes that of the next descent. Not null.
    ActiveResiduals* active = nullptr;
    DescentSummary summary = {};
  };

  // Writes the residuals of one problem, as rows a_1, b_1, a_2, b_2, c, d.
  class RowWriter {
   public:
    void Add(const double row[kResidualRow]) {
      if (count_ == static_cast<int>(rows_->size())) rows_->emplace_back();
      LaneRow& lanes = (*rows_)[count_++];
      for (int k = 0; k < kResidualRow; ++k) lanes.entry[k][lane_] = row[k];
    }

   private:
    friend class SideBySideDescent;
    RowWriter(int lane, std::vector<LaneRow>* rows)
        : lane_(lane), rows_(rows) {}

    int lane_;
    std::vector<LaneRow>* rows_;
    int count_ = 0;
  };

  // Throws like the constructor of FastDescent.
  SideBySideDescent(const FastDescentOptions& options, Norm norm);

  // Minimises all problems. `add_rows(n, &writer)` writes the rows of problem
  // n; it is called once for each, in order. Lanes are idle least if problems
  // of similar length follow each other.
  template <typename AddRows>
  void Minimize(const DescentGoal& goal, const AddRows& add_rows,
                std::vector<Problem>* problems) {
    const int count = static_cast<int>(problems->size());
    for (int next = 0; next < count || IsBusy();) {
      for (int lane = 0; lane < kLanes && next < count; ++lane) {
        if (lanes_[lane].problem != nullptr) continue;
        RowWriter writer(lane, &rows_);
        add_rows(next, &writer);
        Begin(lane, writer.count_, goal, &(*problems)[next++]);
      }
      Step(goal);
    }
  }

 private:
  struct Lane {
    Problem* problem = nullptr;  // null if the lane is idle
    int num_rows = 0;
    int num_filled = 0;  // including rows that are 0 / 1
  };

  bool IsBusy() const;
  void Begin(int lane, int num_rows, const DescentGoal& goal, Problem* problem);
  void Fill(int num_rows);
  void Step(const DescentGoal& goal);
  void Finish(int lane);
  void MinimizeAlone(int lane, const DescentGoal& goal);

  const bool uses_lanes_;
  const int max_iterations_;
  FastDescent alone_;
  std::vector<LaneRow> rows_;
  std::vector<LanePiece> pieces_;
  LaneDescents descents_ = {};
  Lane lanes_[kLanes];
};

}  // namespace krot::internal
