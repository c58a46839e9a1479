#include "krot/minimax/fast_descent.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "krot/base/check.h"
#include "krot/minimax.h"

namespace krot::internal {

void FindDescentNormals(const ResidualSet& residuals, const Eigen::Vector3d& x,
                        Norm norm, double active_tolerance,
                        std::vector<Eigen::Vector3d>* descent_normals) {
  descent_normals->clear();
  const double* values = residuals.values();
  const double cost = *std::max_element(values, values + residuals.size());
  const double share = 1 - active_tolerance;
  for (int i = 0; i < residuals.size(); ++i) {
    if (values[i] < share * cost) continue;  // (5)
    ResidualPiece pieces[kMaxPieces];
    const int count = ResidualPieces(residuals[i], x, norm, share, pieces);
    for (int k = 0; k < count; ++k) {
      const double length = pieces[k].gradient.norm();
      if (!(length > 0)) continue;
      descent_normals->push_back(-pieces[k].gradient / length);  // (6)
    }
  }
}

std::optional<Eigen::Vector3d> FindDescentDirection(
    const std::vector<Eigen::Vector3d>& descent_normals,
    double stationarity_tolerance, std::vector<LinearPiece>* scratch) {
  const int count = static_cast<int>(descent_normals.size());
  if (count == 0) return std::nullopt;
  const Eigen::Vector3d center =  // (7)
      count <= 4 ? MinEnclosingBall(descent_normals.data(), count).center
                 : MinNormPoint(descent_normals.data(), count, scratch);
  const double length = center.norm();
  if (!(length > stationarity_tolerance)) return std::nullopt;
  return center / length;
}

namespace {

// f(alpha) = max_i r_i(alpha)  [Zhang18, Alg. 4, line 2]
double Evaluate(const std::vector<LineResidual>& line, double alpha,
                Norm norm) {
  double largest = 0;
  for (const LineResidual& r : line) {
    const double depth = r.w * alpha + r.z;
    if (!(depth > 0)) return std::numeric_limits<double>::infinity();
    largest = std::max(largest, NormOf(r.u * alpha + r.v, norm) / depth);
  }
  return largest;
}

}  // namespace

double FindStepSize(const ResidualSet& residuals, const Eigen::Vector3d& x,
                    const Eigen::Vector3d& direction, Norm norm,
                    const FastDescentOptions& options,
                    std::vector<LineResidual>* scratch) {
  std::vector<LineResidual>& line = *scratch;
  line.clear();
  double lb = 0;
  double ub = options.max_step;
  for (int i = 0; i < residuals.size(); ++i) {
    const Residual r = residuals[i];
    line.push_back(
        {r.A * direction, r.Numerator(x), r.c.dot(direction), r.Depth(x)});
    // The supremum of alpha with w alpha + z > 0 (Sec. 3.2).
    if (line.back().w < 0) ub = std::min(ub, -line.back().z / line.back().w);
  }
  while (ub - lb > options.step_tolerance) {
    const double alpha = (ub + lb) / 2;
    const double r_left = Evaluate(line, alpha - options.slope_probe, norm);
    const double r = Evaluate(line, alpha, norm);
    const double r_right = Evaluate(line, alpha + options.slope_probe, norm);
    if (r_left > r && r > r_right) {
      lb = alpha;  // on the decreasing part of f
    } else if (r_left < r && r < r_right) {
      ub = alpha;  // on the increasing part of f
    } else {
      break;  // stationary up to the probe
    }
  }
  return (ub + lb) / 2;
}

void CheckOptions(const FastDescentOptions& options) {
  CheckAtLeast(1, options.max_iterations, "max_iterations");
  CheckAtLeast(0, options.stationarity_tolerance, "stationarity_tolerance");
  CheckPositive(options.step_tolerance, "step_tolerance");
  CheckPositive(options.slope_probe, "slope_probe");
  CheckArgument(options.active_tolerance >= 0 && options.active_tolerance < 1,
                "active_tolerance", options.active_tolerance, "in [0, 1)");
  CheckPositive(options.max_step, "max_step");
}

FastDescent::FastDescent(const FastDescentOptions& options, Norm norm)
    : options_(options), norm_(norm) {
  CheckOptions(options);
  CheckAtLeast(1, norm.p, "norm.p");
}

DescentSummary FastDescent::Minimize(Eigen::Vector3d* x) {
  ActiveResiduals none;
  return Minimize(DescentGoal{}, &none, x);
}

DescentSummary FastDescent::Minimize(const DescentGoal& goal,
                                     ActiveResiduals* active,
                                     Eigen::Vector3d* x) {
  if (options_.settings == FastDescentSettings::kPaper) {
    return MinimizeAsInPaper(x);
  }
  return newton_.Minimize(&residuals_, norm_, options_.max_iterations, goal,
                          active, x);
}

// [Zhang18, Alg. 2]. Because of the tolerances a step may fail to lower the
// cost, for which the paper has no test: here that ends the descent.
DescentSummary FastDescent::MinimizeAsInPaper(Eigen::Vector3d* x) {
  DescentSummary summary;
  summary.cost_initial = residuals_.Evaluate(*x, norm_);
  summary.cost = summary.cost_initial;
  if (!std::isfinite(summary.cost)) {
    summary.termination = DescentTermination::kBehind;
    return summary;
  }
  summary.termination = DescentTermination::kMaxIterations;
  while (summary.iterations < options_.max_iterations) {
    FindDescentNormals(residuals_, *x, norm_, options_.active_tolerance,
                       &descent_normals_);
    const std::optional<Eigen::Vector3d> direction = FindDescentDirection(
        descent_normals_, options_.stationarity_tolerance, &pieces_);
    if (!direction) {
      summary.termination = DescentTermination::kStationary;
      break;
    }
    ++summary.iterations;
    const double step =
        FindStepSize(residuals_, *x, *direction, norm_, options_, &line_);
    const Eigen::Vector3d x_next = *x + step * *direction;
    const double cost = residuals_.Evaluate(x_next, norm_);
    if (!(cost < summary.cost)) {
      residuals_.Evaluate(*x, norm_);
      summary.termination = DescentTermination::kNoDecrease;
      break;
    }
    *x = x_next;
    summary.cost = cost;
  }
  return summary;
}

namespace {

// The termination for the status of a lane that has ended, which must not be
// kLaneGivesUp.
DescentTermination TerminationOf(double status) {
  if (status == kLaneStationary) return DescentTermination::kStationary;
  if (status == kLaneZeroCost) return DescentTermination::kZeroCost;
  if (status == kLaneLowEnough) return DescentTermination::kLowEnough;
  return DescentTermination::kBehind;
}

// Entry k of a row with the residual 0 / 1.
double IdleEntry(int k) { return k == kResidualRow - 1 ? 1 : 0; }

}  // namespace

SideBySideDescent::SideBySideDescent(const FastDescentOptions& options,
                                     Norm norm)
    : uses_lanes_(best_lane_kernels.lanes_pay && norm.p == 2 &&
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
  // A longer problem fills the lanes of a vector by itself, and eight of them
  // would not fit into a cache.
  if (!uses_lanes_ || num_rows == 0 || num_rows > 128) {
    MinimizeAlone(lane, goal);
    return;
  }
  descents_.status[lane] = kLaneFresh;
  descents_.count[lane] = num_rows;
  for (int j = 0; j < 3; ++j) descents_.x[j][lane] = (*problem->x)[j];
  const ActiveResiduals& active = *problem->active;
  double sum = 0;
  for (int a = 0; a < active.size; ++a) sum += active.multiplier[a];
  bool is_warm = false;
  for (int a = 0; a < kCorners; ++a) {
    const double multiplier =
        a < active.size ? active.multiplier[a] / sum : 0.0;
    const bool is_corner = multiplier > 0;
    descents_.index[a][lane] = is_corner ? active.index[a] : kNoPieceIndex;
    descents_.weight[a][lane] = multiplier;
    descents_.multiplier[a][lane] = multiplier;
    is_warm |= is_corner;
  }
  descents_.is_cold[lane] = is_warm ? 0 : 1;
  descents_.raises[lane] = 0;
  descents_.kappa[lane] = kFirstKappa;
  descents_.iterations[lane] = 0;
  descents_.lessons[lane] = 0;
  descents_.cost_failed[lane] = std::numeric_limits<double>::infinity();
  descents_.calls[lane] = 0;
}

// Adds residuals 0 / 1 to problems that have fewer than `num_rows`.
void SideBySideDescent::Fill(int num_rows) {
  for (int k = 0; k < kLanes; ++k) {
    int& i = lanes_[k].num_filled;
    for (; i < num_rows; ++i) {
      for (int n = 0; n < kResidualRow; ++n)
        rows_[i].entry[n][k] = IdleEntry(n);
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
  best_lane_kernels.step_lanes(rows_.data(), num_rows, lane_goal, &descents_,
                               pieces_.data());
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

// Solves a lane's problem by FastDescent, from its start: problem.x and
// problem.active are still the original ones.
void SideBySideDescent::MinimizeAlone(int lane, const DescentGoal& goal) {
  Problem& problem = *lanes_[lane].problem;
  lanes_[lane].problem = nullptr;
  descents_.status[lane] = kLaneIdle;
  alone_.residuals().Clear();
  for (int i = 0; i < lanes_[lane].num_rows; ++i) {
    double row[kResidualRow];
    for (int n = 0; n < kResidualRow; ++n) row[n] = rows_[i].entry[n][lane];
    alone_.residuals().Add(row);
  }
  problem.summary = alone_.Minimize(goal, problem.active, problem.x);
}

}  // namespace krot::internal
