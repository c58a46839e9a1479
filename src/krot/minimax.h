#pragma once

#include <vector>

#include <Eigen/Core>

#include "krot/geometry.h"

namespace krot {

// Problem (1) of Zhang, Chin and Le, "A Fast Resection-Intersection Method for
// the Known Rotation Problem" [Zhang18], and its Fast Descent Method by
// smallest enclosing balls:
//
//   min over x in R^3   max_i  ||A_i x + b_i||_p / (c_i'x + d_i)
//
// with all depths c_i'x + d_i > 0. With the cameras fixed x is a point
// (triangulation), with the points fixed it is the translation of a camera
// (resection). The problem is quasi-convex: a local minimum is the minimum.

// One residual of problem (1):  r(x) = ||A x + b||_p / (c'x + d)
// [Zhang18, (2), (3)], on the half-space of positive depth c'x + d.
struct Residual {
  Eigen::Matrix<double, 2, 3> A;
  Eigen::Vector2d b;
  Eigen::Vector3d c;
  double d = 0;

  Eigen::Vector2d Numerator(const Eigen::Vector3d& x) const {
    return A * x + b;
  }
  double Depth(const Eigen::Vector3d& x) const { return c.dot(x) + d; }
};

// r(x); infinity unless the depth is positive.
double ResidualValue(const Residual& residual, const Eigen::Vector3d& x,
                     Norm norm);

// The residual of point x, seen by a camera of this pose along `ray`, which is
// given by its point on the camera's plane z = 1. In pixels if the focal length
// is in pixels; with a focal length of 1 in units of that plane.
Residual PointResidual(const RigidTransform& cam_from_world,
                       const Eigen::Vector2d& ray, double focal_length);

// The residual of the translation x of a camera with this rotation that sees
// `point` along `ray`; units as above.
Residual CameraResidual(const Eigen::Matrix3d& cam_from_world_rotation,
                        const Eigen::Vector3d& point,
                        const Eigen::Vector2d& ray, double focal_length);

struct Ball {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  // m*
  double radius = 0;                                 // f*
};

// The smallest ball that holds `count` points in R^3, 1 <= count <= 4, by the
// paper's enumeration of cases [Zhang18, Sec. 3.1.2]. Closed form; throws
// std::invalid_argument for other counts.
//
// For points of equal norm the centre is also the point of least norm of
// their convex hull, since max_i |g_i - m|^2 = 1 + |m|^2 - 2 min_i g_i.m.
Ball MinEnclosingBall(const Eigen::Vector3d* points, int count);

// How the Fast Descent Method finds its steps; the optimum is the same.
enum class FastDescentSettings {
  kPaper,  // Algorithms 2-4 to the letter
  kFast,   // Newton steps on the active residuals, sequential quadratic
           // programming
};

struct FastDescentOptions {
  FastDescentSettings settings = FastDescentSettings::kFast;
  int max_iterations = 100;  // >= 1
  // The paper's thresholds; kFast ignores them.
  double stationarity_tolerance = 1e-8;  // eps_0 >= 0, norm of the MEB centre
  double step_tolerance = 1e-6;          // eps_1 > 0, units of x
  double slope_probe = 1e-8;             // eps_2 > 0, units of x
  double active_tolerance = 1e-2;        // in [0, 1), relative to the cost
  double max_step = 10;                  // > 0, units of x
};

enum class DescentTermination {
  kNotRun,
  kBehind,      // the start is not feasible: a depth there is not positive
  kStationary,  // no direction lowers the maximum, up to the tolerance
  kZeroCost,    // all residuals vanish
  kLowEnough,   // a level was asked for, and the start or a step has reached it
  kFarAway,     // a depth has reached its limit: the infimum lies at infinity
  kNoDecrease,  // rounding: the best step does not lower the cost
  kMaxIterations,
};

struct DescentSummary {
  DescentTermination termination = DescentTermination::kNotRun;
  double cost_initial = 0;
  double cost = 0;     // <= cost_initial
  int iterations = 0;  // the number of steps tried
};

// Lowers max_i r_i(x) from *x to its minimum [Zhang18, Alg. 2], and never
// raises it. All depths at *x must be positive: otherwise nothing is done, and
// the termination is kBehind. Throws std::invalid_argument for options or a p
// out of range. An iteration passes over the residuals once with kFast, some 70
// times with kPaper.
DescentSummary MinimizeLargestResidual(const std::vector<Residual>& residuals,
                                       const FastDescentOptions& options,
                                       Norm norm, Eigen::Vector3d* x);

}  // namespace krot
