#include "tools/benchmark/rivals/bisection.h"

#include "tools/benchmark/rivals/cone_program_solver.h"
#include "tools/benchmark/rivals/parametric_program.h"

namespace krot::internal {
namespace {

template <typename Cone>
class Bisection : public SubproblemSolver {
 public:
  std::string Name() const override { return "bisection"; }

  Eigen::Vector3d Minimize(const Subproblem& problem) override {
    using Program = ParametricProgram<Cone>;
    Eigen::Vector3d x = problem.start;
    double lower = 0;
    double upper = problem.Cost(x, Program::norm());
    while (upper - lower > kRivalTolerance * upper) {
      const double gamma = (lower + upper) / 2;
      program_.Set(problem, x, gamma, Program::Weights::kOne);
      Eigen::Vector4d y = program_.StartAt(x, /*margin=*/upper - gamma);
      ConeProgramOptions options;
      options.stop_below = 0;
      options.stop_above = 0;
      options.gap = 1e-10 * upper;
      const ConeProgramSummary summary =
          solver_.Minimize(&program_, options, &y);
      if (!(summary.tau < 0)) {
        lower = gamma;
        continue;
      }
      // The cost of the feasible x is a better upper bound than gamma.
      x = y.template head<3>();
      upper = problem.Cost(x, Program::norm());
    }
    return x;
  }

 private:
  ParametricProgram<Cone> program_;
  ConeProgramSolver<ParametricProgram<Cone>> solver_;
};

}  // namespace

std::unique_ptr<SubproblemSolver> MakeBisection(Norm norm) {
  if (norm.p == 2) return std::make_unique<Bisection<SecondOrderCone>>();
  return std::make_unique<Bisection<FourHalfLines>>();
}

}  // namespace krot::internal
