#include "krot/minimax/side_by_side_descent.h"

namespace krot::internal {
namespace {

// What a lane's end is called. Its status is one that is not kLaneGivesUp.
DescentTermination TerminationOf(double status) {
  if (status == kLaneStationary) return DescentTermination::kStationary;
  if (status == kLaneZeroCost) return DescentTermination::kZeroCost;
  if (status == kLaneLowEnough) return DescentTermination::kLowEnough;
  return DescentTermination::kBehind;
}

// Entry k of a row that is 0 / 1.
double IdleEntry(int k) { return k == kLaneRow - 1 ? 1 : 0; }

}  // namespace

SideBySideDescent::SideBySideDescent(const FastDescentOptions& options,
                                     Norm norm)
    : uses_lanes_(LanesPay() && norm.p == 2 &&
                  options.settings == FastDescentSettings::kFast),
      max_iterations_(options.max_iterations),
      alone_(options, norm) {}

bool SideBySideDescent::IsBusy() const {
  for (const Lane& lane : lanes_) {
    if (lane.problem != nullptr) return true;
  }
  return false;
}

void SideBySideDescent::Begin(int lane, int num_rows, const DescentGoal& goal,
                              Problem* problem) {
  lanes_[lane] = {problem, num_rows, num_rows};
  if (!uses_lanes_ || num_rows == 0 || num_rows > kMaxResiduals) {
    MinimizeAlone(lane, goal);
    return;
  }
  descents_.status[lane] = kLaneFresh;
  descents_.count[lane] = num_rows;
  for (int j = 0; j < 3; ++j) descents_.x[j][lane] = (*problem->x)[j];
  const ActiveResiduals& active = *problem->active;
  double sum = 0;
  for (int a = 0; a < active.size; ++a) sum += active.multiplier[a];
  for (int a = 0; a < kCorners; ++a) {
    const bool is_active = a < active.size;
    descents_.index[a][lane] = is_active ? active.index[a] : 0;
    descents_.multiplier[a][lane] = is_active ? active.multiplier[a] / sum : 0;
  }
  descents_.Begin(lane);
}

// Rows that are 0 / 1 where problems have fewer than `num_rows`.
void SideBySideDescent::Fill(int num_rows) {
  for (int k = 0; k < kLanes; ++k) {
    int& i = lanes_[k].num_filled;
    for (; i < num_rows; ++i) {
      for (int n = 0; n < kLaneRow; ++n) rows_[i].entry[n][k] = IdleEntry(n);
    }
  }
}

void SideBySideDescent::Step(const DescentGoal& goal) {
  int num_rows = 0;
  for (const Lane& lane : lanes_) {
    if (lane.problem != nullptr) num_rows = std::max(num_rows, lane.num_rows);
  }
  if (num_rows == 0) return;
  Fill(num_rows);
  if (pieces_.size() < rows_.size()) pieces_.resize(rows_.size());
  const LaneGoal lane_goal = {goal.tolerance, goal.level, goal.sufficient,
                              max_iterations_};
  StepLanes(rows_.data(), num_rows, lane_goal, &descents_, pieces_.data());
  for (int k = 0; k < kLanes; ++k) {
    if (lanes_[k].problem == nullptr || descents_.status[k] == kLaneRuns) {
      continue;
    }
    if (descents_.status[k] == kLaneGivesUp) {
      MinimizeAlone(k, goal);
    } else {
      Finish(k);
    }
  }
}

void SideBySideDescent::Finish(int lane) {
  Problem& problem = *lanes_[lane].problem;
  lanes_[lane].problem = nullptr;
  problem.summary.termination = TerminationOf(descents_.status[lane]);
  problem.summary.cost_initial = descents_.cost_initial[lane];
  problem.summary.cost = descents_.cost[lane];
  problem.summary.iterations = static_cast<int>(descents_.iterations[lane]);
  descents_.status[lane] = kLaneIdle;
  if (problem.summary.iterations == 0) return;
  for (int j = 0; j < 3; ++j) (*problem.x)[j] = descents_.x[j][lane];
  ActiveResiduals active;
  for (int a = 0; a < kCorners; ++a) {
    const double multiplier = descents_.multiplier[a][lane];
    if (!(multiplier > 0)) continue;
    active.index[active.size] = static_cast<int>(descents_.index[a][lane]);
    active.multiplier[active.size] = static_cast<float>(multiplier);
    ++active.size;
  }
  *problem.active = active;
}

// From its start: the problem's x and warm start are what they were.
void SideBySideDescent::MinimizeAlone(int lane, const DescentGoal& goal) {
  Problem& problem = *lanes_[lane].problem;
  lanes_[lane].problem = nullptr;
  descents_.status[lane] = kLaneIdle;
  alone_.residuals().Clear();
  for (int i = 0; i < lanes_[lane].num_rows; ++i) {
    double row[kLaneRow];
    for (int n = 0; n < kLaneRow; ++n) row[n] = rows_[i].entry[n][lane];
    alone_.residuals().Add(row);
  }
  problem.summary = alone_.Minimize(goal, problem.active, problem.x);
}

}  // namespace krot::internal
