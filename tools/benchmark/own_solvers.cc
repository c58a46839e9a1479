#include "krot/minimax/fast_descent.h"
#include "tools/benchmark/subproblem_solver.h"

namespace krot {
namespace {

class OwnSolver : public SubproblemSolver {
 public:
  OwnSolver(std::string name, const FastDescentOptions& options, Norm norm)
      : name_(std::move(name)), descent_(options, norm) {}

  std::string Name() const override { return name_; }

  Eigen::Vector3d Minimize(const Subproblem& problem) override {
    descent_.residuals().Clear();
    for (const Residual& residual : problem.residuals) {
      descent_.residuals().Add(residual);
    }
    Eigen::Vector3d x = problem.start;
    descent_.Minimize(&x);
    return x;
  }

 private:
  std::string name_;
  FastDescent descent_;
};

}  // namespace

std::vector<std::unique_ptr<SubproblemSolver>> OwnSolvers(Norm norm) {
  FastDescentOptions paper;
  paper.settings = FastDescentSettings::kPaper;
  std::vector<std::unique_ptr<SubproblemSolver>> solvers;
  solvers.push_back(
      std::make_unique<OwnSolver>("KROT fast", FastDescentOptions{}, norm));
  solvers.push_back(std::make_unique<OwnSolver>("FDM (paper)", paper, norm));
  return solvers;
}

}  // namespace krot
