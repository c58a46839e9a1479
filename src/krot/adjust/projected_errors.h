#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "krot/adjust/adjustment_blocks.h"

namespace krot {

// What an observation is projected to.
struct ProjectedError {
  Eigen::Vector2d r;  // projected minus measured, pixels
  double w;           // depth, > 0
};

// By observation. None where a point is not in front of its camera or its error
// not below `max_error`. O(observations).
std::optional<std::vector<ProjectedError>> ProjectErrors(
    const AdjustmentBlocks& blocks, double max_error, int num_threads);

// Half the sum of the squared errors.
double HalfSquaredNorm(const std::vector<ProjectedError>& errors);

// The norm of the largest; 0 if there are none.
double LargestError(const std::vector<ProjectedError>& errors);

}  // namespace krot
