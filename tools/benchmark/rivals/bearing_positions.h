#pragma once

#include <cstdint>

#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// Positions from rotations and tracks by robust least squares from random
// positions, as GLOMAP's global positioning [Pan, Barath, Pollefeys,
// Schoenberger 2024, Sec. 3.2], written from the paper:
//
//   min sum_i rho(|b_i - d_i (s - C)|^2),   d_i >= 0,
//
// with b_i the observation's bearing in the world, d_i its scale, and rho
// Huber's loss at 0.1. Centres and points start at random in a cube. Solved by
// Levenberg-Marquardt (Ceres).
struct BearingPositionsOptions {
  uint64_t random_seed = 0;
  int max_num_iterations = 100;
  int num_threads = 1;
};

// Throws std::invalid_argument for rigs with baselines.
Estimate PositionByBearings(const KnownRotationProblem& problem,
                            const BearingPositionsOptions& options);

}  // namespace krot::internal
