#include "tools/benchmark/rivals/full_rivals.h"
#include "tools/benchmark/rivals/projection_error.h"

namespace krot::internal {
namespace {

class CancelCallback : public ceres::IterationCallback {
 public:
  explicit CancelCallback(const CancelFlag* cancel) : cancel_(cancel) {}

  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& /*iteration*/) override {
    return IsCancelled(cancel_) ? ceres::SOLVER_TERMINATE_SUCCESSFULLY
                                : ceres::SOLVER_CONTINUE;
  }

 private:
  const CancelFlag* cancel_;
};

class LeastSquares : public KnownRotationSolver {
 public:
  explicit LeastSquares(int num_threads) : num_threads_(num_threads) {}

  std::string Name() const override { return "least squares"; }
  int NumThreads() const override { return num_threads_; }

  bool Minimize(const KnownRotationProblem& problem, const CancelFlag* cancel,
                Estimate* estimate) override {
    ceres::Problem least_squares;
    BuildLeastSquares(problem, nullptr, estimate, &least_squares);
    ceres::Solver::Options options =
        LeastSquaresOptions(problem, num_threads_, estimate);
    options.max_num_iterations = 100;
    CancelCallback callback(cancel);
    options.callbacks.push_back(&callback);
    ceres::Solver::Summary summary;
    ceres::Solve(options, &least_squares, &summary);
    return summary.termination_type != ceres::USER_SUCCESS;
  }

 private:
  int num_threads_;
};

}  // namespace

std::unique_ptr<KnownRotationSolver> MakeLeastSquares(int num_threads) {
  return std::make_unique<LeastSquares>(num_threads);
}

}  // namespace krot::internal
