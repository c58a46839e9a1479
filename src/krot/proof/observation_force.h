#pragma once

#include <optional>

#include <Eigen/Core>

#include "krot/problem/known_rotation_problem.h"

namespace krot {

// The force of one observation's multipliers on its point and its frame, in its
// camera: E'(delta lambda; y), in long double.
struct ObservationForce {
  using Real = long double;
  using Vector2 = Eigen::Matrix<Real, 2, 1>;
  using Vector3 = Eigen::Matrix<Real, 3, 1>;

  Vector3 sum;
  Vector3 terms;  // of absolute values: what it sums up before cancellation
};

ObservationForce MakeForce(const Observation& observation,
                           const ObservationForce::Vector2& y,
                           ObservationForce::Real delta_lambda);

// Of a sum of `count` terms, each of which has gone through at most 12
// roundings, relative to the sum of absolute values.
ObservationForce::Real RoundingError(size_t count);

// Of a sum of `count` forces that rotations known to kRotationError per entry
// have turned into the world: how far it is from the truth, at most, relative
// to the sum of the absolute values of all their `terms`. A length: a matrix
// of entries e makes a vector of terms that add up to 1 at most sqrt(3) e long.
ObservationForce::Real ForceError(size_t count);

// How much the multipliers may change for a unit of a force's change: what the
// rows of E^-T are long, at least.
struct Compliance {
  ObservationForce::Real y = 0;             // rows 1 and 2 together
  ObservationForce::Real delta_lambda = 0;  // row 0
};

// None if E might be singular, or has entries that are not finite.
std::optional<Compliance> MakeCompliance(const Observation& observation);

}  // namespace krot
