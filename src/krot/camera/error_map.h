#pragma once

#include <memory>

#include <Eigen/Core>

#include "krot/camera/dual.h"
#include "krot/camera/interval.h"

namespace krot::internal {

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

}  // namespace krot::internal
