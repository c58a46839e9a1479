#pragma once

#include <vector>

#include <Eigen/Core>

#include "krot/base/context.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// Centres closer than this, relative to the size of their coordinates and of
// the component, coincide: rounding is a thousand times smaller.
inline constexpr double kCoincident = 1e-12;

// Where a frame's camera sits, once for all its views.
struct FrameGeometry {
  Eigen::Matrix3d world_from_rig = Eigen::Matrix3d::Identity();  // R_rw'
  Eigen::Vector3d centre_in_rig = Eigen::Vector3d::Zero();       // -R_sr' t_sr
  int num_views = 0;                                             // that count
  bool is_seen_through = false;  // it has an observation
  bool has_two_centres = false;  // its observations fix the scale
};

// Of every frame; of the whole where ranks share the points. O(observations).
std::vector<FrameGeometry> DescribeFrames(const KnownRotationProblem& problem,
                                          const Context& context);

}  // namespace krot::internal
