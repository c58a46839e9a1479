#include <algorithm>
#include <cmath>

#include "krot/problem/cost.h"
#include "tools/benchmark/rivals/cone_program_solver.h"
#include "tools/benchmark/rivals/full_rivals.h"
#include "tools/benchmark/rivals/joint_program.h"

namespace krot::internal {
namespace {

// Ends when the interval is narrower, or a step gains less, than this,
// relative. It is the gap that `krot solver` proves.
constexpr double kTolerance = 1e-4;

class FullGugat : public KnownRotationSolver {
 public:
  std::string Name() const override { return "Gugat"; }
  int NumThreads() const override { return 1; }

  bool Minimize(const KnownRotationProblem& problem, const CancelFlag* cancel,
                Estimate* estimate) override {
    JointProgram program(problem);
    double upper = CostOf(problem, *estimate);
    double lower = 0;
    double gamma = upper;
    while (upper - lower > kTolerance * upper) {
      program.Set(*estimate, gamma);
      Eigen::VectorXd y = program.StartAt(/*margin=*/0.1 * gamma);
      ConeProgramOptions options;
      options.gap = 0.1 * kTolerance * gamma;
      options.cancel = cancel;
      const ConeProgramSummary summary =
          solver_.Minimize(&program, options, &y);
      const Estimate next_estimate = program.ToEstimate(y);
      const double cost = CostOf(problem, next_estimate);
      if (cost < upper) {
        *estimate = next_estimate;
        upper = cost;
      }
      if (IsCancelled(cancel)) return false;
      if (summary.tau_bound > 0) lower = std::max(lower, gamma);
      double next = gamma + summary.tau / Slope(program, y);
      if (!(lower < next && next < upper)) next = upper;
      if (std::abs(next - gamma) <= kTolerance * gamma) break;
      gamma = next;
    }
    return true;
  }

 private:
  static double CostOf(const KnownRotationProblem& problem,
                       const Estimate& estimate) {
    return Cost(problem, estimate, Norm::L2(), /*num_threads=*/1);
  }

  // Minus the slope of F, sum_i lambda_i w_i; see gugat.h.
  double Slope(const JointProgram& program, const Eigen::VectorXd& y) const {
    double slope = 0;
    for (int i = 0; i < program.num_observations(); ++i) {
      slope += solver_.multipliers()[i][0] * program.Depth(i, y);
    }
    return slope;
  }

  ConeProgramSolver<JointProgram> solver_;
};

}  // namespace

std::unique_ptr<KnownRotationSolver> MakeFullGugat() {
  return std::make_unique<FullGugat>();
}

}  // namespace krot::internal
