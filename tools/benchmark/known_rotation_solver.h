#pragma once

#include <memory>
#include <string>
#include <vector>

#include "krot/base/context.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// A method, to be measured, that solves the whole problem for p = 2.
class KnownRotationSolver {
 public:
  virtual ~KnownRotationSolver() = default;

  virtual std::string Name() const = 0;
  virtual int NumThreads() const = 0;

  // Improves an estimate of positive depths. Returns false if it was ended by
  // `cancel`, which may be null, before it had finished.
  virtual bool Minimize(const KnownRotationProblem& problem,
                        const CancelFlag* cancel, Estimate* estimate) = 0;
};

// The schedule of method `auto`, the joint solver alone, and sweeps with `fast`
// settings and the paper's stopping rule; each on one thread and, if that is
// more, also on `num_threads`.
std::vector<std::unique_ptr<KnownRotationSolver>> OwnFullSolvers(
    int num_threads);

// Sweeps with `paper` settings, [Zhang18, Alg. 1], on the same numbers of
// threads.
std::vector<std::unique_ptr<KnownRotationSolver>> PaperFullSolvers(
    int num_threads);

// Gugat's method and proximal splitting on the full problem, as in [Zhang18,
// Tab. 2], and least squares, the usual alternative.
std::vector<std::unique_ptr<KnownRotationSolver>> RivalFullSolvers(
    int num_threads);

}  // namespace krot::internal
