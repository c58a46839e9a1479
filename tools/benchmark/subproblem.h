#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "krot/minimax/residual_set.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/synthetic/scene_steps.h"

namespace krot::internal {

// A problem (1) of [Zhang18] with a start of positive depths, in a unit of
// length in which the start's mean depth is 1: thresholds in units of x then
// mean the same for all.
struct Subproblem {
  std::vector<Residual> residuals;
  Eigen::Vector3d start = Eigen::Vector3d::Zero();

  // max_i r_i(x), pixels; infinity unless all depths are positive.
  double Cost(const Eigen::Vector3d& x, Norm norm) const;
};

// The point in the middle of the shortest line between the rays of two
// residuals, v = 0 [Hartley, Schaffalitzky 2004]; none if they are parallel to
// half a degree: where they meet then is chance.
std::optional<Eigen::Vector3d> MidPoint(const Residual& a, const Residual& b);

// The triangulation of `residuals`, which starts, as in [Zhang18, Sec. 4.1], at
// the mid-point of two that are drawn at random; pairs are drawn until all
// depths there are positive. None after fifty.
std::optional<Subproblem> MakeTriangulation(std::vector<Residual> residuals,
                                            Random* random);

// Point k of a problem as its frames stand: (Int_k).
std::vector<Residual> IntersectionResiduals(const KnownRotationProblem& problem,
                                            const Estimate& estimate,
                                            int32_t point);

// Frame f of a problem as its points stand: (Res_f).
std::vector<Residual> ResectionResiduals(const KnownRotationProblem& problem,
                                         const Estimate& estimate,
                                         int32_t frame);

// A block of a sweep, point or frame, which starts where it stands. None where
// a depth is not positive there, or where no ray makes half a degree with the
// first: the optimum would be anywhere.
std::optional<Subproblem> MakeBlock(std::vector<Residual> residuals,
                                    const Eigen::Vector3d& start);

// `num_cameras` at random, looking roughly at a random point among them, which
// they observe with Gaussian noise of `sigma` pixels per axis, focal length
// 1000 pixels: an instance of [Zhang18, Fig. 4].
std::vector<Residual> RandomTriangulation(int num_cameras, double sigma,
                                          Random* random);

}  // namespace krot::internal
