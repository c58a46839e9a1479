#pragma once

#include <optional>

#include <Eigen/Core>

#include "krot/problem/known_rotation_problem.h"

namespace krot {

// What does not move: frames and points of which the problem has a position. It
// takes the place of the gauge: as soon as anything is fixed, translations are
// no longer free, and as soon as two positions are, or a baseline, scale is not
// (docs/method/positions.md, "What is fixed").

// Whether there is any.
bool HasFixed(const KnownRotationProblem& problem);

// One of the positions: the centre of the first fixed frame's first view, or
// the first fixed point. None if nothing is fixed. O(frames + views + points).
std::optional<Eigen::Vector3d> FixedOrigin(const KnownRotationProblem& problem);

// The largest distance of any of them from FixedOrigin, scene units; 0 where
// they coincide up to rounding, or nothing is fixed.
double FixedExtent(const KnownRotationProblem& problem);

// Whether all that moves may be scaled, about FixedOrigin if there is one: no
// baseline and no two positions fix the size of a connected problem.
bool IsScaleFree(const KnownRotationProblem& problem);

// What is fixed at its place, and all else, points and frames' origins, at
// FixedOrigin or, without one, at zero.
Estimate AllAtOrigin(const KnownRotationProblem& problem);

// Puts what is fixed back into its place, to the bit.
void PutFixed(const KnownRotationProblem& problem, Estimate* estimate);

}  // namespace krot
