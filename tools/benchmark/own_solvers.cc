#include <algorithm>

#include "krot/minimax/fast_descent.h"
#include "tools/benchmark/subproblem_solver.h"

namespace krot::internal {
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

// Solves as sweeps solve points: many at a time, the short ones first.
class SideBySideSolver : public SubproblemSolver {
 public:
  explicit SideBySideSolver(Norm norm) : descent_(FastDescentOptions{}, norm) {}

  std::string Name() const override { return "side by side"; }

  Eigen::Vector3d Minimize(const Subproblem& problem) override {
    return MinimizeAll({problem}).front();
  }

  std::vector<Eigen::Vector3d> MinimizeAll(
      const std::vector<Subproblem>& problems) override {
    std::vector<Eigen::Vector3d> points(problems.size());
    std::vector<ActiveResiduals> active(problems.size());
    std::vector<SideBySideDescent::Problem> tasks;
    const std::vector<size_t> order = ByLength(problems);
    for (const size_t i : order) {
      points[i] = problems[i].start;
      tasks.push_back({&points[i], &active[i]});
    }
    descent_.Minimize(
        DescentGoal{},
        [&](int n, SideBySideDescent::RowWriter* writer) {
          for (const Residual& residual : problems[order[n]].residuals) {
            double row[kResidualRow];
            RowOf(residual, row);
            writer->Add(row);
          }
        },
        &tasks);
    return points;
  }

 private:
  static std::vector<size_t> ByLength(const std::vector<Subproblem>& problems) {
    std::vector<size_t> order(problems.size());
    for (size_t i = 0; i < order.size(); ++i) order[i] = i;
    std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
      return problems[a].residuals.size() < problems[b].residuals.size();
    });
    return order;
  }

  SideBySideDescent descent_;
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
  if (norm.p == 2) solvers.push_back(std::make_unique<SideBySideSolver>(norm));
  solvers.push_back(Paper(norm));
  return solvers;
}

Solvers FastAndPaper(Norm norm) {
  Solvers solvers;
  solvers.push_back(Fast(norm));
  solvers.push_back(Paper(norm));
  return solvers;
}

Solvers SideBySideAndPaper(Norm norm) {
  Solvers solvers;
  solvers.push_back(std::make_unique<SideBySideSolver>(norm));
  solvers.push_back(Paper(norm));
  return solvers;
}

}  // namespace krot::internal
