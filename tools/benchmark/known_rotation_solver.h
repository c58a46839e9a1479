#pragma once

#include <memory>
#include <string>
#include <vector>

#include "krot/base/context.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// A way to solve the whole problem, p = 2, the one or the other of which is
// measured.
class KnownRotationSolver {
 public:
  virtual ~KnownRotationSolver() = default;

  virtual std::string Name() const = 0;
  virtual int NumThreads() const = 0;

  // Improves an estimate of positive depths. False if `cancel`, which may be
  // null, ended it before it was done.
  virtual bool Minimize(const KnownRotationProblem& problem,
                        const CancelFlag* cancel, Estimate* estimate) = 0;
};

// The schedule of method `auto`, the joint solver alone, and sweeps with `fast`
// settings to the paper's stop rule, on one thread and, if that is more, on
// `num_threads`.
std::vector<std::unique_ptr<KnownRotationSolver>> OwnFullSolvers(
    int num_threads);

// Sweeps with `paper` settings: [Zhang18, Alg. 1], on as many threads.
std::vector<std::unique_ptr<KnownRotationSolver>> PaperFullSolvers(
    int num_threads);

// Gugat and proximal splitting on the full problem, as in [Zhang18, Tab. 2],
// and least squares, which a user would otherwise run.
std::vector<std::unique_ptr<KnownRotationSolver>> RivalFullSolvers(
    int num_threads);

}  // namespace krot::internal
