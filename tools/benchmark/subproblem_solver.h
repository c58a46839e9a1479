#pragma once

#include <memory>
#include <string>
#include <vector>

#include "tools/benchmark/subproblem.h"

namespace krot::internal {

// A way to solve problems (1), the one or the other of which is measured. Keeps
// its scratch memory; not thread-safe.
class SubproblemSolver {
 public:
  virtual ~SubproblemSolver() = default;

  virtual std::string Name() const = 0;  // "Gugat"

  // The best point found from problem.start; its depths are positive and its
  // cost is not above the start's.
  virtual Eigen::Vector3d Minimize(const Subproblem& problem) = 0;

  // Those of all problems, for a solver that gains by more than one at a time.
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

// Rivals end when what they know of the optimum, be it an interval or the gain
// of a step, is narrower than this, relative.
inline constexpr double kRivalTolerance = 1e-6;

// KROT's own: `fast` to the optimum, `fast` to the rivals' tolerance, for p = 2
// many side by side, and `paper`. p >= 1.
std::vector<std::unique_ptr<SubproblemSolver>> OwnSolvers(Norm norm);

// `fast` to the optimum, one at a time or many side by side, and `paper` alone.
std::vector<std::unique_ptr<SubproblemSolver>> FastAndPaper(Norm norm);
std::vector<std::unique_ptr<SubproblemSolver>> SideBySideAndPaper(Norm norm);

// Those of the literature that can solve this norm: p = 2 or infinity.
std::vector<std::unique_ptr<SubproblemSolver>> RivalSolvers(Norm norm);

}  // namespace krot::internal
