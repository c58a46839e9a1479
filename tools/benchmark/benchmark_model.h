#pragma once

#include <string>

#include "krot/convert/build_problem.h"

namespace krot::internal {

// A model for the benchmarks: its name, which is the last part of its path, and
// its problem with the model's own start.
struct BenchmarkModel {
  std::string name;
  int64_t num_images = 0;
  BuiltProblem built;
};

// Reads and validates a model, and builds its problem. Throws ModelError, or
// CommandError (kExitNothingToSolve) if there are no observations to optimise.
BenchmarkModel ReadBenchmarkModel(const std::string& path,
                                  int min_track_length = 2);

}  // namespace krot::internal
