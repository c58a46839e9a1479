#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "krot/problem/known_rotation_problem.h"
#include "krot/problem/subset.h"

namespace krot::internal {

// What pulls from outside at the centre of a view or at a point, world
// coordinates. Forces (force_balance.h) balance with it that add up to the pull
// at the view's frame, and to its negative at the point.
struct Pull {
  enum class Kind { kView, kPoint };
  Kind kind = Kind::kView;
  int32_t index = 0;  // of the view, or of the point
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();
};

// The position x at which it pulls, and p'x.
Eigen::Vector3d PositionOf(const KnownRotationProblem& problem,
                           const Estimate& estimate, const Pull& pull);
double Along(const KnownRotationProblem& problem, const Estimate& estimate,
             const Pull& pull);

// Whether it pulls at what does not move.
bool IsFixedPosition(const KnownRotationProblem& problem, const Pull& pull);

// The same pull in a part of the problem; none if that does not hold it.
std::optional<Pull> InPart(const ProblemSubset& part, const Pull& pull);

}  // namespace krot::internal
