#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "krot/minimax/residual_set.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/synthetic/scene.h"

namespace krot::internal {

// A problem (1) of [Zhang18] with a start of positive depths. The unit of
// length is the mean depth of the start, so that thresholds in units of x mean
// the same for all problems.
struct Subproblem {
  std::vector<Residual> residuals;
  Eigen::Vector3d start = Eigen::Vector3d::Zero();

  // max_i r_i(x), pixels; infinity unless all depths are positive.
  double Cost(const Eigen::Vector3d& x, Norm norm) const;
};

// The mid-point of the shortest line between the rays (v = 0) of two residuals
// [Hartley, Schaffalitzky 2004]. None if the rays are parallel to within half a
// degree, as noise then determines where they meet.
std::optional<Eigen::Vector3d> MidPoint(const Residual& a, const Residual& b);

// The triangulation of `residuals`. It starts, as in [Zhang18, Sec. 4.1], at
// the mid-point of a random pair; pairs are drawn until all depths there are
// positive. None if fifty pairs fail.
std::optional<Subproblem> MakeTriangulation(std::vector<Residual> residuals,
                                            Random* random);

// The residuals of point k of a problem with the frames fixed: (Int_k).
std::vector<Residual> IntersectionResiduals(const KnownRotationProblem& problem,
                                            const Estimate& estimate,
                                            int32_t point);

// The residuals of frame f of a problem with the points fixed: (Res_f).
std::vector<Residual> ResectionResiduals(const KnownRotationProblem& problem,
                                         const Estimate& estimate,
                                         int32_t frame);

// A block of a sweep, a point or a frame, that starts from its present
// position. None if a depth is not positive there, or if all rays are within
// half a degree of the first: then the optimum is not determined.
std::optional<Subproblem> MakeBlock(std::vector<Residual> residuals,
                                    const Eigen::Vector3d& start);

// An instance of [Zhang18, Fig. 4]: `num_cameras` random cameras that look
// roughly at a random point among them and observe it with Gaussian noise of
// `sigma` pixels per axis. The focal length is 1000 pixels.
std::vector<Residual> RandomTriangulation(int num_cameras, double sigma,
                                          Random* random);

}  // namespace krot::internal
