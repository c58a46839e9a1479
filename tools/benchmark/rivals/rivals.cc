#include "tools/benchmark/known_rotation_solver.h"
#include "tools/benchmark/rivals/bisection.h"
#include "tools/benchmark/rivals/dai.h"
#include "tools/benchmark/rivals/dinkelbach.h"
#include "tools/benchmark/rivals/full_rivals.h"
#include "tools/benchmark/rivals/gugat.h"
#include "tools/benchmark/rivals/polyhedron_collapse.h"
#include "tools/benchmark/rivals/proximal_splitting.h"
#include "tools/benchmark/subproblem_solver.h"

namespace krot::internal {

std::vector<std::unique_ptr<SubproblemSolver>> RivalSolvers(Norm norm) {
  std::vector<std::unique_ptr<SubproblemSolver>> solvers;
  solvers.push_back(MakeBisection(norm));
  solvers.push_back(MakeDinkelbach(norm));
  solvers.push_back(MakeGugat(norm));
  if (norm.p == 2) {
    solvers.push_back(MakeDai());
    solvers.push_back(MakeProximalSplitting());
  } else {
    solvers.push_back(MakePolyhedronCollapse());
  }
  return solvers;
}

std::vector<std::unique_ptr<KnownRotationSolver>> RivalFullSolvers(
    int num_threads) {
  std::vector<std::unique_ptr<KnownRotationSolver>> solvers;
  solvers.push_back(MakeFullGugat());
  solvers.push_back(MakeFullProximalSplitting(num_threads));
  solvers.push_back(MakeLeastSquares(num_threads));
  return solvers;
}

}  // namespace krot::internal
