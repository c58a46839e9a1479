#pragma once

#include <memory>
#include <string>
#include <vector>

#include "tools/benchmark/subproblem.h"

namespace krot::internal {

// A method, to be measured, that solves problems (1). Keeps its scratch memory;
// not thread-safe.
class SubproblemSolver {
 public:
  virtual ~SubproblemSolver() = default;

  virtual std::string Name() const = 0;  // "Gugat"

  // The best point found from problem.start; its depths are positive and its
  // cost is not above the start's.
  virtual Eigen::Vector3d Minimize(const Subproblem& problem) = 0;

  // The same for all problems; overridden by solvers that are faster with
  // several problems at a time.
  virtual std::vector<Eigen::Vector3d> MinimizeAll(
      const std::vector<Subproblem>& problems) {
    std::vector<Eigen::Vector3d> points;
    points.reserve(problems.size());
    for (const Subproblem& problem : problems) {
      points.push_back(Minimize(problem));
    }
    return points;
  }
};

// Rivals end when their interval around the optimum, or the gain of a step, is
// below this, relative to the cost.
inline constexpr double kRivalTolerance = 1e-6;

// KROT's own solvers: `fast` to the optimum; `fast` to the rivals' tolerance;
// for p = 2, many side by side; and `paper`. p >= 1.
std::vector<std::unique_ptr<SubproblemSolver>> OwnSolvers(Norm norm);

// `fast` to the optimum, one at a time or many side by side, and `paper` alone.
std::vector<std::unique_ptr<SubproblemSolver>> FastAndPaper(Norm norm);
std::vector<std::unique_ptr<SubproblemSolver>> SideBySideAndPaper(Norm norm);

// The solvers of the literature that can handle this norm, p = 2 or infinity.
std::vector<std::unique_ptr<SubproblemSolver>> RivalSolvers(Norm norm);

}  // namespace krot::internal
