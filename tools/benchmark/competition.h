#pragma once

#include <memory>
#include <string>
#include <vector>

#include "tools/benchmark/subproblem_solver.h"

namespace krot::internal {

// The results of one solver on a list of sub-problems, compared with others.
struct Standing {
  std::string name;
  double seconds = 0;  // per instance: median over rounds of the mean
  // How far its costs are above the lowest of any solver, relative to that or
  // to kSmallCost, whichever is larger.
  double max_excess = 0;
  double mean_excess = 0;
};

// Below this, pixels, costs are compared absolutely, because the optimum of a
// track of two or three rays is often about 0.
inline constexpr double kSmallCost = 1e-3;

// Costs within this of the lowest, relative, count as the same optimum.
inline constexpr double kSameOptimum = 1e-5;

// Runs every solver on every instance, in `repeats` rounds, in each of which
// the solvers take turns.
std::vector<Standing> Compete(
    const std::vector<Subproblem>& instances, Norm norm,
    const std::vector<std::unique_ptr<SubproblemSolver>>& solvers, int repeats);

// KROT's own solvers, then the rivals that can solve this norm.
std::vector<std::unique_ptr<SubproblemSolver>> AllSolvers(Norm norm);

}  // namespace krot::internal
