#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "krot/context.h"
#include "krot/geometry.h"

namespace krot {

// The known rotation problem without a model: arrays in, arrays out.
//
//   min over t, X   max_i  f_c || (x/z, y/z) - ray_i ||_p,
//   (x, y, z)' = R_c X_k + t_c,  z > 0,
//
// for observation i of point k by camera c [Zhang18, (KRot)].

// Camera `camera` sees point `point` along `ray`.
struct RayObservation {
  int32_t camera = 0;
  int32_t point = 0;
  // The point at which the ray meets the camera's plane z = 1: undistorted
  // pixel coordinates, less the principal point, divided by the focal length.
  Eigen::Vector2d ray = Eigen::Vector2d::Zero();
};

struct KnownRotations {
  std::vector<Eigen::Matrix3d> rotations;  // R, camera from world
  // f, pixels, for each camera; empty: 1, and errors are in units of z = 1.
  std::vector<double> focal_lengths;
  int32_t num_points = 0;
  std::vector<RayObservation> observations;  // in any order
};

struct KnownRotationsOptions {
  Norm norm;                   // p = 1, 2 or infinity
  double relative_gap = 1e-4;  // to the proved bound; > 0
  int max_iterations = 2000;   // per connected component; >= 1
  // The start must be below it; in the unit of errors; > 0.
  double init_max_error = 100;
};

enum class KnownRotationsTermination {
  kNotRun,
  kGapReached,  // proved up to relative_gap, or zero up to rounding
  kMaxIterations,
  kStalled,     // rounding ended the progress before the gap was reached
  kInfeasible,  // proved: no estimate is below init_max_error
  kNoStart,     // no estimate below init_max_error was found
  kInterrupted,
};

struct KnownRotationsResult {
  KnownRotationsTermination termination = KnownRotationsTermination::kNotRun;
  // Empty if no start was found. Each connected component has a place and a
  // scale of its own; its median depth is one.
  std::vector<Eigen::Vector3d> translations;  // t, camera from world
  std::vector<Eigen::Vector3d> points;        // X; zero without observations
  double max_error = 0;  // reached; pixels, or units of z = 1
  // No estimate is below this, proved; 0 without a proof.
  double lower_bound = 0;
};

// Finds the positions with the lowest largest error from rotations and rays
// alone. Throws std::invalid_argument for an index, a rotation, a focal length
// or an option out of range. Cancelled, it returns the best so far. Takes as
// long as Solve (krot/solve.h).
KnownRotationsResult SolveKnownRotations(
    const KnownRotations& problem, const KnownRotationsOptions& options = {},
    const Context& context = {});

}  // namespace krot
