#pragma once

#include <memory>
#include <optional>

#include <Eigen/Core>

#include "krot/camera/camera_model.h"
#include "krot/camera/interval.h"

namespace krot::internal {

// Returns kappa, by which a bound on the linear error has to be wider than that
// on the true error, relative. Let f(u) = ProjectionError at the ray u, E the
// row of the observation at x_hat (RowAtProjection), m(u) = v / w its linear
// error, and gamma = level_px. Then kappa >= 0, and there is a set U of rays, a
// parallelogram in the chart of x_hat around PixelBearing(pixel), such that
//
//   1. for all u in U:  |f(u)|_p <= gamma  =>  w > 0 and
//                                              |m(u)|_p <= gamma (1 + kappa);
//   2. |f| > gamma on the boundary of U, and det f' > 0 where |f| <= gamma.
//
// By 2, f maps a part of U onto the whole ball |f| <= gamma (its degree is at
// least 1, because of the pixel's own ray). So 1 also holds for all rays of
// *any* set that contains U and on which the lens is one-to-one: a ray of that
// set with |f| <= gamma has the same pixel as a ray in U, so it is that ray.
//
// nullopt if no such set was found: a fold or the end of the lens is nearer
// than gamma, the pixel has no ray, or x_hat does not project or is nearly 90
// degrees from that ray. Such an observation cannot be in a support.
//
// It is a proof, by interval arithmetic that rounds outwards, for E exactly as
// RowAtProjection computes it. The result depends only on the arguments. kappa
// exceeds the smallest possible value by about 10 % of itself + 1e-6, or more
// if the budget of cells ends first. It may be any value that is at most
// `sufficient`, which is found much faster. It is 0 for pinholes, whose U is
// all rays with z > 0. Takes some hundreds of microseconds for ordinary lenses,
// milliseconds near folds, and tens of microseconds for a sufficient 0.1.
//
// Requires gamma > 0 and p = 1, 2 or infinity.
std::optional<double> RemainderBound(Intrinsics intrinsics,
                                     const Eigen::Vector2d& pixel,
                                     const Eigen::Vector3d& x_hat,
                                     double level_px, double p,
                                     double sufficient = 0);

// A proved upper bound on -y'm(u), pixels times |y|, for all u in U with
// |f(u)|_p <= gamma: the support function, in the direction -y, of the linear
// errors of all rays whose true error is at most gamma. As m is tangent to f at
// x_hat, the bound is gamma |y| to first order, in the dual norm, if x_hat is
// on the boundary of the ball in that direction, however strong the lens is. A
// proof needs one direction per observation only, so it loses nothing to the
// lens. U, nullopt and cost are as above. The result is at most 1e-7 gamma |y|
// above its smallest value unless the budget of cells ends first, or any value
// that is at most `sufficient`, which may be found much faster.
std::optional<double> SupportBound(Intrinsics intrinsics,
                                   const Eigen::Vector2d& pixel,
                                   const Eigen::Vector3d& x_hat,
                                   const Eigen::Vector2d& y, double level_px,
                                   double p, double sufficient = 0);

// The values of an ErrorMap at a point, or their enclosures on a set.
template <typename T>
struct ErrorPair {
  T f[2];  // true error over the level
  T m[2];  // linear error over the level
};

// An observation's true and linear errors, divided by a level in pixels, as
// functions of q with the rays X(q) = X0 + G q. With the G that is used here,
// f'(0) = I, so f(q) is near q.
class ErrorMap {
 public:
  struct Geometry {
    Eigen::Vector2d pixel;
    Eigen::Matrix3d E;  // the row: linear error v / w, (w; v) = E X
    Eigen::Vector3d X0;
    Eigen::Matrix<double, 3, 2> G;
    bool on_image_plane;  // X_3 = 1 for all q
    double level_px;
  };

  virtual ~ErrorMap() = default;

  // Enclosures on the box q1 x q2: of the values, or of the values and their
  // derivatives with respect to q.
  virtual ErrorPair<Interval> Values(const Interval& q1,
                                     const Interval& q2) const = 0;
  virtual ErrorPair<Dual<Interval>> Derivatives(const Interval& q1,
                                                const Interval& q2) const = 0;
};

std::unique_ptr<ErrorMap> MakeErrorMap(Intrinsics intrinsics,
                                       const ErrorMap::Geometry& geometry);

// Branch and bound over the box |q|_inf <= reach of an ErrorMap, in the norm
// p = 1, 2 or infinity. RemainderBound and SupportBound use it for their
// proofs.

// Whether |f| > 1 is proved on all of the box's boundary.
bool BoundaryIsOutside(const ErrorMap& map, double p, double reach);

// An upper bound on max |m| over the points of the box with |f| <= 1. It is too
// large by at most 10 % of (max |m| - 1) or 1e-6, whichever is more, unless the
// budget of cells ends; or it is any bound that is at most `sufficient`.
// nullopt if det f' > 0 cannot be proved at all these points.
std::optional<double> LargestLinearError(const ErrorMap& map, double p,
                                         double reach, double sufficient);

// An upper bound on max -y'm over the points of the box with |f| <= 1. It is
// too large by at most 1e-7 unless the budget of cells ends; or it is any bound
// that is at most `sufficient`. The dual norm of y must be 1. nullopt as above.
std::optional<double> LargestAlong(const ErrorMap& map, double p, double reach,
                                   const Eigen::Vector2d& y, double sufficient);

}  // namespace krot::internal
