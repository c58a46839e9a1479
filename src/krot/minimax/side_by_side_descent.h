#pragma once

#include <algorithm>
#include <vector>

#include <Eigen/Core>

#include "krot/minimax/fast_descent.h"
#include "krot/minimax/lane_descent.h"

namespace krot::internal {

// Solves many small problems (1), min over x in R^3 of max_i r_i(x): each to
// its goal as FastDescent does, but for p = 2 eight at a time, one per lane of
// a vector (lane_descent.h). A lane whose problem ends takes the next one.
// What comes of a problem depends on that problem alone: not on which others
// there are, nor in which order.
//
// A problem that gives lanes trouble (an optimum far away, many steps), and one
// with more than kMaxResiduals, is handed to FastDescent, from its start; with
// `paper` settings, other norms and short vectors (LanesPay) every one is.
class SideBySideDescent {
 public:
  // Longer problems fill the lanes of a vector by themselves, and eight of them
  // no cache.
  static constexpr int kMaxResiduals = 128;

  struct Problem {
    // The start, and the optimum afterwards. Not null.
    Eigen::Vector3d* x = nullptr;
    // A warm start, and that of the next descent afterwards. Not null.
    ActiveResiduals* active = nullptr;
    DescentSummary summary = {};
  };

  // The rows of the residuals of one problem, a_1, b_1, a_2, b_2, c, d.
  class RowWriter {
   public:
    void Add(const double row[kLaneRow]) {
      if (count_ == static_cast<int>(rows_->size())) rows_->emplace_back();
      LaneRow& lanes = (*rows_)[count_++];
      for (int k = 0; k < kLaneRow; ++k) lanes.entry[k][lane_] = row[k];
    }

   private:
    friend class SideBySideDescent;
    RowWriter(int lane, std::vector<LaneRow>* rows)
        : lane_(lane), rows_(rows) {}

    int lane_;
    std::vector<LaneRow>* rows_;
    int count_ = 0;
  };

  // Throws as FastDescent's.
  SideBySideDescent(const FastDescentOptions& options, Norm norm);

  // Minimises all problems; `add_rows(n, &writer)` writes the rows of number n.
  // It is called once for each, in order: fewest steps are idle where problems
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
    Problem* problem = nullptr;  // none: idle
    int num_rows = 0;
    int num_filled = 0;  // with those that are 0 / 1
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
