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

}  // namespace

std::vector<std::unique_ptr<SubproblemSolver>> OwnSolvers(Norm norm) {
  FastDescentOptions paper;
  paper.settings = FastDescentSettings::kPaper;
  std::vector<std::unique_ptr<SubproblemSolver>> solvers;
  const auto add = [&](const char* name, const FastDescentOptions& options,
                       const DescentGoal& goal) {
    solvers.push_back(std::make_unique<OwnSolver>(name, options, goal, norm));
  };
  add("KROT fast", {}, {});
  add("fast, 1e-6", {}, {kRivalTolerance, /*level=*/0});
  add("FDM (paper)", paper, {});
  return solvers;
}

}  // namespace krot
