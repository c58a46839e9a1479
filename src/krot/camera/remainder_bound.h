#pragma once

#include <memory>
#include <optional>

#include <Eigen/Core>

#include "krot/camera/interval.h"

namespace krot::internal {

// How much wider than the true error's bound the bound of its linearisation has
// to be. Let f(u) = ProjectionError at the ray u, E the row of the observation
// at x_hat (RowAtProjection), m(u) = v / w its linear error, gamma = level_px.
// Then kappa >= 0 and there is a set U of rays, a parallelogram in the chart of
// x_hat around PixelBearing(pixel), such that
//
//   1. for all u in U:  |f(u)|_p <= gamma  =>  w > 0 and
//                                              |m(u)|_p <= gamma (1 + kappa);
//   2. |f| > gamma on the boundary of U, and det f' > 0 where |f| <= gamma.
//
// By 2, f maps a part of U onto the whole ball |f| <= gamma (its degree there
// is that of the pixel's own ray, at least 1). So 1 holds as well for all rays
// of *any* set that contains U and on which the lens is one-to-one: whichever
// of its rays has |f| <= gamma shares its pixel with one in U, and so is it.
//
// nullopt: no such set was found (a fold or the lens' last ray is nearer than
// gamma, the pixel has no ray, x_hat does not project or is nearly 90 degrees
// from it). An observation without kappa cannot serve as support.
//
// A proof: interval arithmetic that rounds outwards, with E as RowAtProjection
// computes it, to the last bit. A function of its arguments alone. kappa
// exceeds its smallest value by some 10 % of itself + 1e-6, more where the
// budget of cells ends first, or is any value that is at most `sufficient`,
// which costs much less. 0 for pinholes, whose U is all rays with z > 0.
// Some hundreds of microseconds for ordinary lenses, milliseconds near
// folds; tens for a sufficient 0.1.
//
// Requires gamma > 0 and p = 1, 2 or infinity.
std::optional<double> RemainderBound(int model_id, const double* params,
                                     const Eigen::Vector2d& pixel,
                                     const Eigen::Vector3d& x_hat,
                                     double level_px, double p,
                                     double sufficient = 0);

// The least that is known to be at least -y'm(u), pixels times |y|, for all u
// in U with |f(u)|_p <= gamma: the support function, in the direction -y, of
// what the true error's ball looks like in the row. As m is tangent to f at
// x_hat, it is gamma |y| to first order, in the dual norm, if x_hat lies on the
// ball in that direction, however strong the lens: what a proof needs, which
// has one direction per observation. U, nullopt and cost as above; 1e-7 gamma
// |y| above its smallest value unless the budget of cells ends first, or any
// value that is at most `sufficient`, which may cost much less.
std::optional<double> SupportBound(int model_id, const double* params,
                                   const Eigen::Vector2d& pixel,
                                   const Eigen::Vector3d& x_hat,
                                   const Eigen::Vector2d& y, double level_px,
                                   double p, double sufficient = 0);

// What ErrorMap evaluates at a point, or encloses on a set.
template <typename T>
struct ErrorPair {
  T f[2];  // true error over the level
  T m[2];  // linear error over the level
};

// An observation's true and linear errors, over a level in pixels, as functions
// of q: the rays X(q) = X0 + G q. With P = f'(0)^-1 in G, f(q) is near q.
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

  // Enclosures on the box q1 x q2, of the values, or with the derivatives by q
  // as well.
  virtual ErrorPair<Interval> Values(const Interval& q1,
                                     const Interval& q2) const = 0;
  virtual ErrorPair<Dual<Interval>> Derivatives(const Interval& q1,
                                                const Interval& q2) const = 0;
};

std::unique_ptr<ErrorMap> MakeErrorMap(int model_id, const double* params,
                                       const ErrorMap::Geometry& geometry);

// Branch and bound over the box |q|_inf <= reach of an ErrorMap, in the norm
// p = 1, 2 or infinity: what RemainderBound is proved with.

// Whether |f| > 1 is proved on all of the box's boundary.
bool BoundaryIsOutside(const ErrorMap& map, double p, double reach);

// An upper bound of max |m| over the points of the box with |f| <= 1, near it:
// at most 10 % of (max |m| - 1), or 1e-6, too large unless the budget of cells
// ends, or any that is at most `sufficient`. nullopt if det f' > 0 cannot be
// proved at all these points.
std::optional<double> LargestLinearError(const ErrorMap& map, double p,
                                         double reach, double sufficient);

// An upper bound of max -y'm over the points of the box with |f| <= 1, near it:
// at most 1e-7 too large unless the budget of cells ends, or any that is at
// most `sufficient`. Requires a dual norm of y of 1. nullopt as above.
std::optional<double> LargestAlong(const ErrorMap& map, double p, double reach,
                                   const Eigen::Vector2d& y, double sufficient);

}  // namespace krot::internal
