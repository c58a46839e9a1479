#include "krot/minimax/newton_descent.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "krot/base/numbers.h"
#include "krot/minimax/kernels.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

// At most this many residuals become members at a time, the largest first. With
// more, steps cost more; with fewer, it takes more trials to find those that
// matter.
constexpr int kMaxAdded = 8;

// Whether the minimiser is so far away, perhaps at infinity, that going on is
// useless: once depths have grown a millionfold, residuals change by at most
// 1e-6 of their value. Beyond kNearby, it is useless if the promise is small.
bool IsFarAway(double depth_growth, double relative_promise) {
  return depth_growth > 1e6 ||
         (depth_growth > kNearby && relative_promise < 1e-8);
}

// One descent from a feasible x.
class Descent {
 public:
  Descent(ResidualSet* residuals, Norm norm, const DescentGoal& goal,
          LocalModel* model, std::vector<char>* is_member)
      : residuals_(*residuals),
        norm_(norm),
        goal_(goal),
        smallest_kappa_(SmallestKappa(goal.tolerance)),
        model_(*model),
        is_member_(*is_member) {}

  // Requires that the residuals were evaluated at x; `cost` is their maximum.
  void Start(const Vector3d& x, double cost, const ActiveResiduals& active);
  DescentTermination Run(int max_iterations);

  const Vector3d& x() const { return x_; }
  double cost() const { return cost_; }
  int iterations() const { return iterations_; }

 private:
  // A step of the model.
  struct Proposal {
    LocalModel::Step step;
    double promise;         // decrease of the cost that the model predicts
    double share;           // of the step that is tried
    bool promises_nothing;  // up to the tolerance
  };
  // The result of trying it.
  struct Trial {
    Vector3d x;
    double cost;
    double kept;  // of the promise; 1 where the model is right
  };

  Proposal Propose();
  bool LowerKappaAtOnce();
  Trial Try(const Proposal& proposal);
  bool EndsWith(const Proposal& proposal, const Trial& trial) const;
  void MoveTo(const Trial& trial);
  void Accept(const Trial& trial);
  bool Learn(const Proposal& proposal, const Trial& trial,
             const std::optional<double>& overlooked);
  std::optional<double> AddMembers(double level);
  void AddMember(int index);

  ResidualSet& residuals_;
  const Norm norm_;
  const DescentGoal& goal_;
  const double smallest_kappa_;
  LocalModel& model_;
  std::vector<char>& is_member_;

  Vector3d x_;
  double cost_ = 0;
  double kappa_ = kFirstKappa;
  int iterations_ = 0;
  // Since x has moved last:
  int lessons_ = 0;
  double cost_failed_ = kInfinity;  // of the last trial that failed
};

// The first multipliers are those of `active` or, without any, of a step with
// H = G.
void Descent::Start(const Vector3d& x, double cost,
                    const ActiveResiduals& active) {
  x_ = x;
  cost_ = cost;
  if (!(cost > kZeroPixels)) return;
  model_.Start(x);
  is_member_.assign(residuals_.size(), false);
  AddMembers(/*level=*/-1);
  for (int k = 0; k < active.size; ++k) {
    if (!is_member_[active.index[k]]) AddMember(active.index[k]);
  }
  model_.Linearize(x, cost, norm_);
  if (active.size > 0) {
    model_.StartFrom(active);
  } else {
    model_.Minimize(/*kappa=*/1);
    model_.AdoptMultipliers();
  }
}

DescentTermination Descent::Run(int max_iterations) {
  while (iterations_ < max_iterations) {
    if (!(cost_ > kZeroPixels)) return DescentTermination::kZeroCost;
    if (cost_ <= goal_.sufficient) return DescentTermination::kLowEnough;
    const Proposal proposal = Propose();
    if (proposal.promises_nothing && LowerKappaAtOnce()) continue;
    if (IsFarAway(model_.DepthGrowth(), proposal.promise / cost_)) {
      return DescentTermination::kFarAway;
    }
    const Trial trial = Try(proposal);
    if (EndsWith(proposal, trial)) {
      if (trial.cost < cost_) MoveTo(trial);
      return DescentTermination::kStationary;
    }
    std::optional<double> overlooked;
    if (trial.cost > proposal.step.level) {
      overlooked = AddMembers(proposal.step.level);
    }
    if (trial.kept > kSufficientShare) {
      Accept(trial);
    } else if (!Learn(proposal, trial, overlooked)) {
      kappa_ *= kKappaRise;
      if (kappa_ > kLargestKappa) return DescentTermination::kNoDecrease;
    }
  }
  return DescentTermination::kMaxIterations;
}

// If the step is shortened because depths fall, its promise is unreliable and
// only the finest tolerance counts.
Descent::Proposal Descent::Propose() {
  const LocalModel::Step step = model_.Minimize(kappa_);
  const double promise = cost_ - step.level;
  const double share = model_.ShareOf(step.d);
  const double tolerance = share < 1 ? kFinestTolerance : goal_.tolerance;
  return {step, promise, share, !(promise > tolerance * cost_)};
}

// A promise may be small only because kappa is large. If there were no lessons
// at this x, sets kappa to its smallest value; that counts as an iteration.
// Returns whether it did.
bool Descent::LowerKappaAtOnce() {
  if (!(kappa_ > smallest_kappa_ && lessons_ == 0)) return false;
  model_.RaiseMultipliers();
  kappa_ = smallest_kappa_;
  ++iterations_;
  return true;
}

Descent::Trial Descent::Try(const Proposal& proposal) {
  ++iterations_;
  Trial trial;
  trial.x = x_ + proposal.share * proposal.step.d;
  trial.cost = residuals_.Evaluate(trial.x, norm_);
  trial.kept = (cost_ - trial.cost) / (proposal.share * proposal.promise);
  return trial;
}

// Whether nothing is left to gain after this trial.
bool Descent::EndsWith(const Proposal& proposal, const Trial& trial) const {
  if (proposal.promises_nothing) return true;
  // For polyhedral norms the model has no curvature, so steps are not Newton's.
  const bool is_newton =
      !norm_.IsPolyhedral() && kappa_ <= smallest_kappa_ && proposal.share == 1;
  if (!is_newton) return false;
  // The decrease that a Newton step leaves to the next one, to first order: how
  // far the trial's cost is above the model's level, or what the quadratic term
  // held back.
  const double left =
      std::max(trial.cost - proposal.step.level, proposal.step.held_back);
  const bool is_rounding = !(trial.kept > kSufficientShare) &&
                           proposal.promise <= kPromiseRounding * cost_;
  return left <= goal_.tolerance * cost_ || is_rounding;
}

void Descent::MoveTo(const Trial& trial) {
  x_ = trial.x;
  cost_ = trial.cost;
}

void Descent::Accept(const Trial& trial) {
  MoveTo(trial);
  model_.AdoptMultipliers();
  model_.Linearize(x_, cost_, norm_);
  if (trial.kept > kGoodShare) {
    kappa_ = std::max(kappa_ * kKappaFall, smallest_kappa_);
  }
  lessons_ = 0;
  cost_failed_ = kInfinity;
}

// Improves the model after a failed trial; `overlooked` is the largest of the
// residuals above the level that were no members. Returns whether another trial
// with the same kappa is worthwhile.
bool Descent::Learn(const Proposal& proposal, const Trial& trial,
                    const std::optional<double>& overlooked) {
  if (overlooked) {
    model_.Linearize(x_, cost_, norm_);
    // The maximum is a residual that the model did not have, so the model has
    // not misjudged a member: this does not count as a lesson.
    if (!(*overlooked < trial.cost)) return true;
  } else {
    bool learned = model_.RaiseMultipliers();
    learned |=
        model_.AddTangents(trial.x, residuals_.values(), proposal.step.level);
    learned &= trial.cost < kLessonWorth * cost_failed_;
    cost_failed_ = trial.cost;
    if (!learned) return false;
  }
  return ++lessons_ <= kMaxLessons;
}

// Makes the largest residuals above `level` members, if they are not members
// yet. Returns the largest of these, if there are any.
std::optional<double> Descent::AddMembers(double level) {
  const double* values = residuals_.values();
  int largest[kMaxAdded];  // indices, by falling value
  int count = 0;
  for (int i = 0; i < residuals_.size(); ++i) {
    if (!(values[i] > level) || is_member_[i]) continue;
    int place = count < kMaxAdded ? count++ : kMaxAdded - 1;
    for (; place > 0 && values[largest[place - 1]] < values[i]; --place) {
      largest[place] = largest[place - 1];
    }
    largest[place] = i;
    if (count == kMaxAdded) level = values[largest[kMaxAdded - 1]];
  }
  for (int k = 0; k < count; ++k) AddMember(largest[k]);
  if (count == 0) return std::nullopt;
  return values[largest[0]];
}

void Descent::AddMember(int index) {
  is_member_[index] = true;
  model_.AddMember(residuals_, index);
}

}  // namespace

DescentSummary NewtonDescent::Minimize(ResidualSet* residuals, Norm norm,
                                       int max_iterations,
                                       const DescentGoal& goal,
                                       ActiveResiduals* active, Vector3d* x) {
  DescentSummary summary;
  const double cost = residuals->Evaluate(*x, norm);
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
  Descent descent(residuals, norm, goal, &model_, &is_member_);
  descent.Start(*x, cost, *active);
  summary.termination = descent.Run(max_iterations);
  summary.cost = descent.cost();
  summary.iterations = descent.iterations();
  *x = descent.x();
  if (summary.iterations > 0) *active = model_.Active();
  return summary;
}

}  // namespace krot::internal
