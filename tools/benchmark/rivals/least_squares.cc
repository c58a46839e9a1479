#include "tools/benchmark/rivals/full_rivals.h"
#include "tools/benchmark/rivals/projection_error.h"

namespace krot {
namespace {

class LeastSquares : public KnownRotationSolver {
 public:
  explicit LeastSquares(int num_threads) : num_threads_(num_threads) {}

  std::string Name() const override { return "least squares"; }
  int NumThreads() const override { return num_threads_; }

  bool Minimize(const KnownRotationProblem& problem, double time_limit,
                Estimate* estimate) override {
    ceres::Problem least_squares;
    BuildLeastSquares(problem, nullptr, estimate, &least_squares);
    ceres::Solver::Options options =
        LeastSquaresOptions(problem, num_threads_, estimate);
    options.max_num_iterations = 100;
    options.max_solver_time_in_seconds = time_limit;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &least_squares, &summary);
    return summary.total_time_in_seconds < time_limit;
  }

 private:
  int num_threads_;
};

}  // namespace

std::unique_ptr<KnownRotationSolver> MakeLeastSquares(int num_threads) {
  return std::make_unique<LeastSquares>(num_threads);
}

}  // namespace krot
