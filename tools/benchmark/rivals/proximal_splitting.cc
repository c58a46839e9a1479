#include "tools/benchmark/rivals/proximal_splitting.h"

#include <algorithm>

#include <ceres/tiny_solver.h>

#include "tools/benchmark/rivals/proximal_operator.h"

namespace krot::internal {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kMaxIterations = 4000;
constexpr double kPenaltyGrowth = 1.01;

// The stacked r_i(x) - target_i, as a function for TinySolver.
class Residuals {
 public:
  using Scalar = double;
  enum { NUM_RESIDUALS = Eigen::Dynamic, NUM_PARAMETERS = 3 };

  Residuals(const Subproblem& problem, const std::vector<Vector2d>& targets)
      : problem_(problem), targets_(targets) {}

  int NumResiduals() const { return 2 * static_cast<int>(targets_.size()); }

  // Returns false if the point is behind a camera.
  bool operator()(const double* parameters, double* residuals,
                  double* jacobian) const {
    const Eigen::Map<const Vector3d> x(parameters);
    Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, 3>> J(jacobian,
                                                           NumResiduals(), 3);
    for (size_t i = 0; i < targets_.size(); ++i) {
      const Residual& residual = problem_.residuals[i];
      const double w = residual.Depth(x);
      if (!(w > 0)) return false;
      const Vector2d r = residual.Numerator(x) / w;
      Eigen::Map<Vector2d>(residuals + 2 * i) = r - targets_[i];
      if (jacobian == nullptr) continue;
      J.middleRows<2>(2 * static_cast<int>(i)) =
          (residual.A - r * residual.c.transpose()) / w;
    }
    return true;
  }

 private:
  const Subproblem& problem_;
  const std::vector<Vector2d>& targets_;
};

class ProximalSplitting : public SubproblemSolver {
 public:
  std::string Name() const override { return "proximal"; }

  Vector3d Minimize(const Subproblem& problem) override {
    const size_t count = problem.residuals.size();
    Vector3d x = problem.start;
    Vector3d best = x;
    double best_cost = problem.Cost(x, Norm::L2());
    double rho = 4 / (best_cost * static_cast<double>(count));
    std::vector<Vector2d> u(count, Vector2d::Zero());
    std::vector<Vector2d> z = ImageErrors(problem, x);
    std::vector<Vector2d> targets(count);
    for (int iteration = 0; iteration < kMaxIterations && best_cost > 0;
         ++iteration) {
      for (size_t i = 0; i < count; ++i) targets[i] = z[i] - u[i];
      LeastSquaresStep(problem, targets, &x);
      const std::vector<Vector2d> r = ImageErrors(problem, x);
      for (size_t i = 0; i < count; ++i) z[i] = r[i] + u[i];
      ApplyMaxNormProx(rho, &z);
      double gap = 0;
      double largest = 0;
      for (size_t i = 0; i < count; ++i) {
        u[i] += r[i] - z[i];
        gap = std::max(gap, (r[i] - z[i]).norm());
        largest = std::max(largest, r[i].norm());
        u[i] /= kPenaltyGrowth;  // u is the multiplier over rho
      }
      rho *= kPenaltyGrowth;
      if (largest < best_cost) {
        best_cost = largest;
        best = x;
      }
      if (gap < kRivalTolerance * best_cost) break;
    }
    return best;
  }

 private:
  static std::vector<Vector2d> ImageErrors(const Subproblem& problem,
                                           const Vector3d& x) {
    std::vector<Vector2d> errors;
    for (const Residual& residual : problem.residuals) {
      errors.push_back(residual.Numerator(x) / residual.Depth(x));
    }
    return errors;
  }

  void LeastSquaresStep(const Subproblem& problem,
                        const std::vector<Vector2d>& targets, Vector3d* x) {
    solver_.options.max_num_iterations = 2;  // the first only evaluates
    solver_.Solve(Residuals(problem, targets), x);
  }

  ceres::TinySolver<Residuals> solver_;
};

}  // namespace

std::unique_ptr<SubproblemSolver> MakeProximalSplitting() {
  return std::make_unique<ProximalSplitting>();
}

}  // namespace krot::internal
