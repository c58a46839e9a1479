#include "krot/solver/dual_repair.h"

#include <algorithm>
#include <cmath>

#include "krot/problem/cost.h"
#include "krot/solver/dual_system.h"

namespace krot {
namespace {

using Eigen::Vector2d;
using Eigen::VectorXd;

// By how much (2) stays below zero, relative to delta sum lambda w: what the
// checker may need, and what it costs of the bound.
constexpr double kConstantMargin = 1e-8;
// The bound that is claimed leaves this for the last roundings, relative.
constexpr double kBoundMargin = 4e-13;
// p is below this, beside multipliers of length 1, if eta is unique.
constexpr double kNoFreedom = 1e-9;
constexpr int kNumRefinements = 3;
constexpr int kSectionSteps = 90;  // 0.618^90 is below double precision
constexpr int kNumPolishes = 3;
// Lengthening eta_i costs the bound in first order, turning it in second.
constexpr double kLengthWeight = 1e3;

double DualNorm(const Eigen::Vector2d& y, Norm norm) {
  if (norm.p == 1) return y.cwiseAbs().maxCoeff();
  return norm.p == 2 ? y.norm() : y.cwiseAbs().sum();
}

double LargestDualNorm(const VectorXd& eta, Norm norm) {
  double largest = 0;
  for (int64_t i = 0; i < eta.size(); i += 2) {
    largest = std::max(largest, DualNorm(eta.segment<2>(i), norm));
  }
  return largest;
}

// The minimiser of the convex function in [0, high], by golden section.
template <typename Function>
double MinimizeConvex(const Function& function, double high) {
  const double ratio = (std::sqrt(5.0) - 1) / 2;
  double low = 0;
  double left = high - ratio * (high - low);
  double right = low + ratio * (high - low);
  double at_left = function(left);
  double at_right = function(right);
  for (int step = 0; step < kSectionSteps; ++step) {
    if (at_left <= at_right) {
      high = right;
      right = left;
      at_right = at_left;
      left = high - ratio * (high - low);
      at_left = function(left);
    } else {
      low = left;
      left = right;
      at_left = at_right;
      right = low + ratio * (high - low);
      at_right = function(right);
    }
  }
  return at_left <= at_right ? left : right;
}

// eta_i = y_i / lambda_i, the lambda_i, and the delta that they suggest.
struct Dual {
  std::vector<double> lambda;
  VectorXd eta;
  double delta = 0;
  double weighted_depth = 0;  // sum lambda w
};

Dual MakeDual(const KnownRotationProblem& problem, const Estimate& estimate,
              const std::vector<Multiplier>& multipliers) {
  Dual dual;
  dual.eta.resize(2 * static_cast<int64_t>(multipliers.size()));
  for (size_t i = 0; i < multipliers.size(); ++i) {
    const Multiplier& multiplier = multipliers[i];
    const ViewedPoint viewed =
        ViewPoint(problem, problem.observations[i], estimate);
    dual.lambda.push_back(multiplier.lambda);
    dual.eta.segment<2>(2 * static_cast<int64_t>(i)) =
        multiplier.y / multiplier.lambda;
    dual.weighted_depth += multiplier.lambda * viewed.depth;
    dual.delta -= multiplier.y.dot(viewed.v);
  }
  dual.delta /= dual.weighted_depth;  // (1) times the estimate
  return dual;
}

// The changes of eta among those of all multipliers.
VectorXd WithoutScalings(const VectorXd& x) {
  VectorXd eta(x.size() / 3 * 2);
  for (int64_t i = 0; i < eta.size() / 2; ++i) {
    eta.segment<2>(2 * i) = x.segment<2>(3 * i);
  }
  return eta;
}

// The best dual with these lambda.
struct Repaired {
  double bound = 0;  // 0: none
  VectorXd eta;      // of length 1 at most; M eta + bound c = 0
};

Repaired RepairEta(const DualSystem& system, const VectorXd& eta0, Norm norm) {
  LeastNormSolver solver;
  if (!solver.Factorize(system.Equations())) return {};
  const auto solve = [&](const DualSystem::VectorXr& rhs) {
    return WithoutScalings(solver.Solve(rhs.cast<double>()));
  };
  // eta(theta) = theta p + q satisfies M eta = -c for every theta, p being
  // eta0 without its part in the row space of M. It proves the bound
  // 1 / max |eta_i|_dual, whose inverse is convex in theta = 1 / delta.
  const VectorXd p = eta0 - solve(system.Multiply(eta0));
  const VectorXd q = solve(-system.c());
  const auto inverse_bound = [&](double theta) {
    return LargestDualNorm(theta * p + q, norm);
  };
  // |theta p| > 2 max |q| cannot be better than theta = 0.
  const double longest_p = LargestDualNorm(p, norm);
  const double theta =
      longest_p > kNoFreedom
          ? MinimizeConvex(inverse_bound, 2 * inverse_bound(0) / longest_p)
          : 0;

  Repaired repaired;
  repaired.eta = theta * p + q;
  repaired.bound = 1;
  for (int n = 0; n < kNumRefinements; ++n) {
    const double longest = LargestDualNorm(repaired.eta, norm);
    if (!(longest > 0) || !std::isfinite(longest)) return {};
    const double shrink = (1 - kBoundMargin) / longest;
    repaired.bound *= shrink;
    repaired.eta *= shrink;
    repaired.eta += solve(-DualSystem::Real{repaired.bound} * system.c() -
                          system.Multiply(repaired.eta));
  }
  return repaired;
}

// One Gauss-Newton step on (1) and (2) in eta and log lambda at a fixed delta,
// in which eta_i turns and lambda_i changes rather than eta_i grows. False if
// it leaves lambda > 0.
bool Polish(const DualSystem& system, Dual* dual) {
  const int64_t count = static_cast<int64_t>(dual->lambda.size());
  LeastNormProblem equations =
      system.EquationsWithScalings(dual->eta, dual->delta);
  // Turn the columns of eta_i to (along it, across it).
  std::vector<Eigen::Matrix2d> axes(count);
  for (int64_t i = 0; i < count; ++i) {
    const Vector2d along =
        dual->eta.segment<2>(2 * i).normalized() / kLengthWeight;
    axes[i].row(0) = along;
    axes[i].row(1) = kLengthWeight * Vector2d(-along[1], along[0]);
    LeastNormProblem::Columns& columns = equations.columns[i];
    columns.point_rows.topRows<2>() =
        axes[i] * columns.point_rows.topRows<2>().eval();
    columns.frame_rows.topRows<2>() =
        axes[i] * columns.frame_rows.topRows<2>().eval();
    columns.last_row.head<2>() = axes[i] * columns.last_row.head<2>().eval();
  }
  LeastNormSolver solver;
  if (!solver.Factorize(std::move(equations))) return false;
  const DualSystem::VectorXr rest =
      -DualSystem::Real{dual->delta} * system.c() - system.Multiply(dual->eta);
  const VectorXd step = solver.Solve(rest.cast<double>());
  for (int64_t i = 0; i < count; ++i) {
    const double growth = step[3 * i + 2];
    if (!(std::abs(growth) < 0.5)) return false;
    dual->lambda[i] *= 1 + growth;
    dual->eta.segment<2>(2 * i) +=
        axes[i].transpose() * step.segment<2>(3 * i) / (1 + growth);
  }
  return true;
}

Certificate MakeCertificate(const Dual& dual, const Repaired& repaired) {
  Certificate certificate;
  certificate.lower_bound = repaired.bound;
  for (size_t i = 0; i < dual.lambda.size(); ++i) {
    certificate.observations.push_back(
        {static_cast<int64_t>(i), dual.lambda[i],
         dual.lambda[i] *
             repaired.eta.segment<2>(2 * static_cast<int64_t>(i))});
  }
  return certificate;
}

}  // namespace

std::optional<Certificate> RepairMultipliers(
    const KnownRotationProblem& problem, Norm norm, const Estimate& estimate,
    const std::vector<Multiplier>& multipliers) {
  if (multipliers.empty()) return std::nullopt;
  Dual dual = MakeDual(problem, estimate, multipliers);
  std::optional<Certificate> best;
  for (int n = 0; n <= kNumPolishes; ++n) {
    DualSystem system(problem, dual.lambda);
    system.SetConstantMargin(kConstantMargin * dual.weighted_depth);
    const Repaired repaired = RepairEta(system, dual.eta, norm);
    if (repaired.bound > (best ? best->lower_bound : 0)) {
      best = MakeCertificate(dual, repaired);
    }
    if (!Polish(system, &dual)) break;
  }
  return best;
}

}  // namespace krot
