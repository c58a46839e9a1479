#include "krot/minimax/newton_descent.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace krot {
namespace {

using Eigen::Vector3d;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// So many residuals become members at a time, the largest first.
constexpr int kMaxAdded = 8;
// Residuals this small are zero, in pixels.
constexpr double kZeroPixels = 1e-10;
// kappa falls by kShrink after a good step and rises by kGrow after a failure.
// Below kSmallest rounding in the model, about 1e-16 / kappa, would show.
constexpr double kInitialKappa = 1e-2;
constexpr double kSmallestKappa = 1e-5;
constexpr double kLargestKappa = 1e9;
constexpr double kShrink = 0.01;
constexpr double kGrow = 10;
// A trial is taken if it keeps this share of its promise, and good from:
constexpr double kSufficientShare = 0.1;
constexpr double kGoodShare = 0.5;
// Promises below this, relative, are rounding if the trial does not keep them.
constexpr double kPromiseRounding = 1e-10;
constexpr double kFinestTolerance = DescentGoal{}.tolerance;
// So often a failed trial may teach the model before kappa rises.
constexpr int kMaxLessons = 5;
// A lesson after which the next trial costs no less than this share of the one
// before was none.
constexpr double kLessonWorth = 0.99;
// Depths that fall by less than this, relative, count as constant.
constexpr double kSmallFall = 0.1;

// Whether the minimiser lies so far away that going on has no point: where
// depths have grown a millionfold nothing changes by more than 1e-6 of it any
// more, and long before that little is left to gain.
bool IsFarAway(double depth_growth, double relative_promise) {
  return depth_growth > 1e6 || (depth_growth > 1e3 && relative_promise < 1e-8);
}

// What a Newton step leaves for the next one, to first order: what the trial
// misses of the level, and what the quadratic term held back.
double LeftAfter(const LocalModel::Step& step, double cost_trial) {
  return std::max(cost_trial - step.level, step.held_back);
}

// How much of a step is taken. Where all depths fall by the same share f of
// themselves, a residual changes with d / (1 + f) as much as its linearisation
// does with d. Small falls do not matter, and no depth falls below a tenth.
double ShareOf(const LocalModel& model, const Vector3d& d) {
  const double share = model.DepthShare((0.9 / kSmallFall) * d);
  if (share == 1) return 1;
  const double fall = kSmallFall / share;
  return std::min(1 / (1 + fall), 0.9 / fall);
}

}  // namespace

// Makes the largest residuals above `level` members, if they are not yet.
// Returns the largest of them, if there were any.
std::optional<double> NewtonDescent::AddMembers(const ResidualSet& residuals,
                                                double level) {
  const double* values = residuals.values();
  int largest[kMaxAdded];  // indices, by falling value
  int count = 0;
  for (int i = 0; i < residuals.size(); ++i) {
    if (!(values[i] > level) || is_member_[i]) continue;
    int place = count < kMaxAdded ? count++ : kMaxAdded - 1;
    for (; place > 0 && values[largest[place - 1]] < values[i]; --place) {
      largest[place] = largest[place - 1];
    }
    largest[place] = i;
    if (count == kMaxAdded) level = values[largest[kMaxAdded - 1]];
  }
  for (int k = 0; k < count; ++k) AddMember(residuals, largest[k]);
  if (count == 0) return std::nullopt;
  return values[largest[0]];
}

void NewtonDescent::AddMember(const ResidualSet& residuals, int index) {
  is_member_[index] = true;
  model_.AddMember(residuals, index);
}

// The first multipliers are those given or, without any, of a gradient step.
void NewtonDescent::StartModel(const ResidualSet& residuals, double cost,
                               Norm norm, const ActiveResiduals& active,
                               const Vector3d& x) {
  model_.Start(x);
  is_member_.assign(residuals.size(), false);
  AddMembers(residuals, /*level=*/-1);
  for (int k = 0; k < active.size; ++k) {
    if (!is_member_[active.index[k]]) AddMember(residuals, active.index[k]);
  }
  model_.Linearize(x, cost, norm);
  if (active.size > 0) {
    model_.StartFrom(active);
  } else {
    model_.Minimize(/*kappa=*/1);
    model_.AdoptMultipliers();
  }
}

DescentSummary NewtonDescent::Minimize(ResidualSet* residuals, Norm norm,
                                       int max_iterations,
                                       const DescentGoal& goal,
                                       ActiveResiduals* active, Vector3d* x) {
  DescentSummary summary;
  double cost = residuals->Evaluate(*x, norm);
  summary.cost_initial = cost;
  summary.cost = cost;
  if (!std::isfinite(cost)) {
    summary.termination = DescentTermination::kBehind;
    return summary;
  }
  if (cost <= goal.level) {
    summary.termination = DescentTermination::kLowEnough;
    return summary;
  }
  double kappa = kInitialKappa;
  if (cost > kZeroPixels) StartModel(*residuals, cost, norm, *active, *x);
  int lessons = 0;                 // since the last step taken
  double cost_failed = kInfinity;  // of the last trial since then
  summary.termination = DescentTermination::kMaxIterations;
  while (summary.iterations < max_iterations) {
    if (!(cost > kZeroPixels)) {
      summary.termination = DescentTermination::kZeroCost;
      break;
    }
    LocalModel::Step step = model_.Minimize(kappa);
    const double promise = cost - step.level;
    const double share = ShareOf(model_, step.d);
    // A promise that takes depths near zero says little: residuals go with
    // 1 / depth.
    const double tolerance = share < 1 ? kFinestTolerance : goal.tolerance;
    const bool is_last = !(promise > tolerance * cost);
    // Is it small for the sake of a kappa that nothing has raised here?
    if (is_last && kappa > kSmallestKappa && lessons == 0) {
      model_.RaiseMultipliers();
      kappa = kSmallestKappa;
      ++summary.iterations;
      continue;
    }
    if (IsFarAway(model_.DepthGrowth(), promise / cost)) {
      summary.termination = DescentTermination::kFarAway;
      break;
    }
    ++summary.iterations;
    const Vector3d x_trial = *x + share * step.d;
    const double cost_trial = residuals->Evaluate(x_trial, norm);
    const double kept = (cost - cost_trial) / (share * promise);
    // The pieces of polyhedral norms lack the curvature of Newton's step.
    const bool is_newton =
        !norm.IsPolyhedral() && kappa <= kSmallestKappa && share == 1;
    const bool arrives =
        is_newton && LeftAfter(step, cost_trial) <= goal.tolerance * cost;
    const bool is_rounding = is_newton && !(kept > kSufficientShare) &&
                             promise <= kPromiseRounding * cost;
    if (is_last || arrives || is_rounding) {
      if (cost_trial < cost) {
        *x = x_trial;
        cost = cost_trial;
      }
      summary.termination = DescentTermination::kStationary;
      break;
    }
    std::optional<double> overlooked;
    if (cost_trial > step.level) {
      overlooked = AddMembers(*residuals, step.level);
    }
    if (kept > kSufficientShare) {
      *x = x_trial;
      cost = cost_trial;
      model_.AdoptMultipliers();
      model_.Linearize(*x, cost, norm);
      if (kept > kGoodShare) kappa = std::max(kappa * kShrink, kSmallestKappa);
      lessons = 0;
      cost_failed = kInfinity;
      continue;
    }
    if (overlooked) {
      model_.Linearize(*x, cost, norm);
      // Whether the model knew the largest residual, and misjudged it.
      const bool misjudged = *overlooked < cost_trial;
      if (!misjudged || ++lessons <= kMaxLessons) continue;
    } else {
      bool learned = model_.RaiseMultipliers();
      learned |= model_.AddTangents(x_trial, residuals->values(), step.level);
      learned &= cost_trial < kLessonWorth * cost_failed;
      cost_failed = cost_trial;
      if (learned && ++lessons <= kMaxLessons) continue;
    }
    kappa *= kGrow;
    if (kappa > kLargestKappa) {
      summary.termination = DescentTermination::kNoDecrease;
      break;
    }
  }
  summary.cost = cost;
  if (summary.iterations > 0) *active = model_.Active();
  return summary;
}

}  // namespace krot
