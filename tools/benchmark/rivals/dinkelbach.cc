#include "tools/benchmark/rivals/dinkelbach.h"

#include "tools/benchmark/rivals/cone_program_solver.h"
#include "tools/benchmark/rivals/parametric_program.h"

namespace krot::internal {
namespace {

template <typename Cone>
class Dinkelbach : public SubproblemSolver {
 public:
  std::string Name() const override { return "Dinkelbach"; }

  Eigen::Vector3d Minimize(const Subproblem& problem) override {
    using Program = ParametricProgram<Cone>;
    Eigen::Vector3d x = problem.start;
    double gamma = problem.Cost(x, Program::norm());
    while (gamma > 0) {
      program_.Set(problem, x, gamma, Program::Weights::kOne);
      Eigen::Vector4d y = program_.StartAt(x, /*margin=*/0.1 * gamma);
      ConeProgramOptions options;
      options.gap = 0.1 * kRivalTolerance * gamma;
      solver_.Minimize(&program_, options, &y);
      const Eigen::Vector3d x_next = y.template head<3>();
      const double cost = problem.Cost(x_next, Program::norm());
      if (cost < gamma) x = x_next;
      if (!(cost < (1 - kRivalTolerance) * gamma)) break;
      gamma = cost;
    }
    return x;
  }

 private:
  ParametricProgram<Cone> program_;
  ConeProgramSolver<ParametricProgram<Cone>> solver_;
};

}  // namespace

std::unique_ptr<SubproblemSolver> MakeDinkelbach(Norm norm) {
  if (norm.p == 2) return std::make_unique<Dinkelbach<SecondOrderCone>>();
  return std::make_unique<Dinkelbach<FourHalfLines>>();
}

}  // namespace krot::internal
