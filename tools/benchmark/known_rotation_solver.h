#pragma once

#include <memory>
#include <string>
#include <vector>

#include "krot/problem/known_rotation_problem.h"

namespace krot {

// A way to solve the whole problem, p = 2, the one or the other of which is
// measured.
class KnownRotationSolver {
 public:
  virtual ~KnownRotationSolver() = default;

  virtual std::string Name() const = 0;
  virtual int NumThreads() const = 0;

  // Improves an estimate of positive depths. False if it gave up after
  // `time_limit` seconds.
  virtual bool Minimize(const KnownRotationProblem& problem, double time_limit,
                        Estimate* estimate) = 0;
};

// The schedule of method `auto`, the joint solver alone, and sweeps with `fast`
// and with `paper` settings to the paper's stop rule, each on one thread and,
// if that is more, on `num_threads`. The time limit does not apply.
std::vector<std::unique_ptr<KnownRotationSolver>> OwnFullSolvers(
    int num_threads);

// Gugat and proximal splitting on the full problem, as in [Zhang18, Tab. 2],
// and least squares, which a user would otherwise run.
std::vector<std::unique_ptr<KnownRotationSolver>> RivalFullSolvers(
    int num_threads);

}  // namespace krot
