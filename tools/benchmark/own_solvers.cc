#include "krot/minimax/fast_descent.h"
#include "tools/benchmark/subproblem_solver.h"

namespace krot {
namespace {

class OwnSolver : public SubproblemSolver {
 public:
  OwnSolver(std::string name, const FastDescentOptions& options,
            const DescentGoal& goal, Norm norm)
      : name_(std::move(name)), goal_(goal), descent_(options, norm) {}

  std::string Name() const override { return name_; }

  Eigen::Vector3d Minimize(const Subproblem& problem) override {
    descent_.residuals().Clear();
    for (const Residual& residual : problem.residuals) {
      descent_.residuals().Add(residual);
    }
    Eigen::Vector3d x = problem.start;
    ActiveResiduals none;
    descent_.Minimize(goal_, &none, &x);
    return x;
  }

 private:
  std::string name_;
  DescentGoal goal_;
  FastDescent descent_;
};

using Solvers = std::vector<std::unique_ptr<SubproblemSolver>>;

std::unique_ptr<SubproblemSolver> Fast(Norm norm) {
  return std::make_unique<OwnSolver>("KROT fast", FastDescentOptions{},
                                     DescentGoal{}, norm);
}

std::unique_ptr<SubproblemSolver> Paper(Norm norm) {
  FastDescentOptions options;
  options.settings = FastDescentSettings::kPaper;
  return std::make_unique<OwnSolver>("FDM (paper)", options, DescentGoal{},
                                     norm);
}

}  // namespace

Solvers OwnSolvers(Norm norm) {
  Solvers solvers;
  solvers.push_back(Fast(norm));
  solvers.push_back(std::make_unique<OwnSolver>(
      "fast, 1e-6", FastDescentOptions{},
      DescentGoal{kRivalTolerance, /*level=*/0}, norm));
  solvers.push_back(Paper(norm));
  return solvers;
}

Solvers FastAndPaper(Norm norm) {
  Solvers solvers;
  solvers.push_back(Fast(norm));
  solvers.push_back(Paper(norm));
  return solvers;
}

}  // namespace krot
