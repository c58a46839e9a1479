#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>

#include "krot/base/context.h"
#include "krot/linear/blocks.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// Centres closer than this, relative to the size of their coordinates and of
// the component, coincide: rounding is a thousand times smaller.
inline constexpr double kCoincident = 1e-12;

// The projection centre of a frame: that of its first view with an observation.
struct FrameGeometry {
  Eigen::Matrix3d world_from_rig = Eigen::Matrix3d::Identity();  // R_rw'
  Eigen::Vector3d centre_in_rig = Eigen::Vector3d::Zero();       // -R_sr' t_sr
  int num_views = 0;                                             // its weight
  bool is_seen_through = false;  // it has an observation
  bool has_two_centres = false;  // its observations fix the scale
};

// Describes every frame; from the observations of all ranks where ranks share
// the points. O(observations).
std::vector<FrameGeometry> DescribeFrames(const KnownRotationProblem& problem,
                                          const Context& context);

// The unknowns of the linear systems of the known rotation problem: the points
// s_k and the frames' centres in the world, C_f = -R_rw' t_f. As
//
//   x_cam = R_sr (R_rw s + t_f) + t_sr = R_cw (s - C_f) + t_sr,
//
// a row depends only on the difference between its point and its frame's
// centre.

// The structure of the linear systems. Held fixed are: everything that the
// problem fixes; in each connected component without anything fixed, the frame
// with the most observations; and frames without observations. Where ranks
// share the points, components and counts are those of the whole problem.
BlockStructure AnchoredStructure(const KnownRotationProblem& problem,
                                 const Context& context = {});

// R_rw of each frame; the identity for a frame without views.
std::vector<Eigen::Matrix3d> RigFromWorldRotations(
    const KnownRotationProblem& problem);

// The centre of each frame.
std::vector<Eigen::Vector3d> CentresOf(
    const std::vector<Eigen::Matrix3d>& rig_from_world,
    const std::vector<Eigen::Vector3d>& translations);

// Sets `to` to `from`, moved by `step` along a direction of points and centres.
// `to` may be `from`.
void MoveCentres(const std::vector<Eigen::Matrix3d>& rig_from_world,
                 const Estimate& from, double step,
                 const BlockVector& direction, Estimate* to);

// The gradient of sum_i multiplier(i)'(w_i; v_i), where w_i is the depth and
// v_i the v of observation i, with respect to all points and to the centres
// that the structure does not fix.
BlockVector GradientOf(
    const KnownRotationProblem& problem, const BlockStructure& structure,
    const std::function<Eigen::Vector3d(int64_t i)>& multiplier);

}  // namespace krot::internal
