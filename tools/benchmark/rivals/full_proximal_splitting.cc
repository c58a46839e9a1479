#include <algorithm>

#include "krot/problem/cost.h"
#include "tools/benchmark/rivals/full_rivals.h"
#include "tools/benchmark/rivals/projection_error.h"
#include "tools/benchmark/rivals/proximal_operator.h"

namespace krot::internal {
namespace {

using Eigen::Vector2d;

constexpr int kMaxIterations = 4000;
constexpr double kPenaltyGrowth = 1.02;
// Ends when the copies agree with the errors to this, relative to the cost.
constexpr double kTolerance = 1e-4;

class FullProximalSplitting : public KnownRotationSolver {
 public:
  explicit FullProximalSplitting(int num_threads) : num_threads_(num_threads) {}

  std::string Name() const override { return "proximal"; }
  int NumThreads() const override { return num_threads_; }

  bool Minimize(const KnownRotationProblem& problem, const CancelFlag* cancel,
                Estimate* estimate) override {
    const size_t count = problem.observations.size();
    Estimate x = *estimate;
    std::vector<Vector2d> z = ImageErrors(problem, x);
    std::vector<Vector2d> u(count, Vector2d::Zero());
    std::vector<Vector2d> targets(count);
    double best = Cost(problem, x, Norm::L2(), num_threads_);
    double rho = 4 / (best * static_cast<double>(count));
    ceres::Problem least_squares;
    BuildLeastSquares(problem, &targets, &x, &least_squares);
    ceres::Solver::Options options =
        LeastSquaresOptions(problem, num_threads_, &x);
    options.max_num_iterations = 1;
    ceres::Solver::Summary summary;
    for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
      if (IsCancelled(cancel)) return false;
      for (size_t i = 0; i < count; ++i) targets[i] = z[i] - u[i];
      ceres::Solve(options, &least_squares, &summary);
      const std::vector<Vector2d> r = ImageErrors(problem, x);
      for (size_t i = 0; i < count; ++i) z[i] = r[i] + u[i];
      ApplyMaxNormProx(rho, &z);
      double gap = 0;
      for (size_t i = 0; i < count; ++i) {
        u[i] = (u[i] + r[i] - z[i]) / kPenaltyGrowth;
        gap = std::max(gap, (r[i] - z[i]).norm());
      }
      rho *= kPenaltyGrowth;
      const double cost = Cost(problem, x, Norm::L2(), num_threads_);
      if (cost < best) {
        best = cost;
        *estimate = x;
      }
      if (gap < kTolerance * best) return true;
    }
    return true;
  }

 private:
  static std::vector<Vector2d> ImageErrors(const KnownRotationProblem& problem,
                                           const Estimate& estimate) {
    std::vector<Vector2d> errors;
    errors.reserve(problem.observations.size());
    for (const Observation& observation : problem.observations) {
      const ViewedPoint viewed = ViewPoint(problem, observation, estimate);
      errors.push_back(viewed.v / viewed.depth);
    }
    return errors;
  }

  int num_threads_;
};

}  // namespace

std::unique_ptr<KnownRotationSolver> MakeFullProximalSplitting(
    int num_threads) {
  return std::make_unique<FullProximalSplitting>(num_threads);
}

}  // namespace krot::internal
