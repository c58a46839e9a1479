#include "tools/benchmark/rivals/bisection.h"
#include "tools/benchmark/subproblem_solver.h"

namespace krot {

std::vector<std::unique_ptr<SubproblemSolver>> RivalSolvers(Norm norm) {
  std::vector<std::unique_ptr<SubproblemSolver>> solvers;
  solvers.push_back(MakeBisection(norm));
  return solvers;
}

}  // namespace krot
