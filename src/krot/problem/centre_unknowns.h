#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>

#include "krot/base/context.h"
#include "krot/linear/blocks.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// The known rotation problem as linear systems see it: their unknowns are the
// points s_k and the frames' centres in the world, C_f = -R_rw' t_f. As
//
//   x_cam = R_sr (R_rw s + t_f) + t_sr = R_cw (s - C_f) + t_sr,
//
// a row knows a point and a frame by the difference of the two alone.

// What the linear systems hold still: what the problem fixes and, of each
// connected component in which it fixes nothing, the frame with the most
// observations; so is a frame without any. Where ranks share the points, these
// are those of the whole.
BlockStructure AnchoredStructure(const KnownRotationProblem& problem,
                                 const Context& context = {});

// R_rw of each frame; the identity for one without views.
std::vector<Eigen::Matrix3d> RigFromWorldRotations(
    const KnownRotationProblem& problem);

// The centre of each frame.
std::vector<Eigen::Vector3d> CentresOf(
    const std::vector<Eigen::Matrix3d>& rig_from_world,
    const std::vector<Eigen::Vector3d>& translations);

// Sets `to` to `from`, moved by `step` along a direction of points and centres.
// The two may be one.
void MoveCentres(const std::vector<Eigen::Matrix3d>& rig_from_world,
                 const Estimate& from, double step,
                 const BlockVector& direction, Estimate* to);

// The gradient of sum_i multiplier(i)'(w_i; v_i), with w_i the depth and v_i of
// observation i, by points and by those centres that the structure does not
// fix.
BlockVector GradientOf(
    const KnownRotationProblem& problem, const BlockStructure& structure,
    const std::function<Eigen::Vector3d(int64_t i)>& multiplier);

}  // namespace krot::internal
