#pragma once

#include <cmath>
#include <optional>

#include <Eigen/LU>

#include "krot/camera/camera_model.h"
#include "krot/camera/dual.h"
#include "krot/camera/regular_segment.h"

namespace krot {

// UndistortPixel (camera_model.h) for one model known at compile time; what
// it promises is said there. The pixel is taken back to the lens plane, the
// distortion is inverted there by Newton's method, and the lens in closed form.

// d (x, y) / d (a, b) and the value, from a function of dual numbers.
struct PlaneMap {
  Eigen::Vector2d value;
  Eigen::Matrix2d derivative;
};

template <typename Function>
PlaneMap Differentiate(const Eigen::Vector2d& at, const Function& function) {
  Dual<double> x, y;
  function(Dual<double>{at.x(), 1, 0}, Dual<double>{at.y(), 0, 1}, &x, &y);
  PlaneMap map;
  map.value << x.value, y.value;
  map.derivative << x.du, x.dv, y.du, y.dv;
  return map;
}

// Solves D(q) = target by Newton's method from q, halving a step until the
// residual falls and det D' > 0; with `stay_regular`, also until the segment
// from the centre to the new q is regular. Returns the last iterate, which the
// caller checks; nullopt if det D' <= 0 already at the start.
template <typename Distortion>
std::optional<Eigen::Vector2d> InvertDistortion(const double* k,
                                                const Eigen::Vector2d& target,
                                                Eigen::Vector2d q,
                                                bool stay_regular) {
  constexpr int kMaxIterations = 100;
  constexpr double kMinStepScale = 1e-6;
  // Convergence is quadratic: a relative step below this leaves an error near
  // the square of it.
  constexpr double kLastStep = 1e-8;

  const auto distort = [k](const auto& a, const auto& b, auto* x, auto* y) {
    Distortion::Apply(k, a, b, x, y);
  };
  PlaneMap map = Differentiate(q, distort);
  if (!(map.derivative.determinant() > 0)) return std::nullopt;

  for (int i = 0; i < kMaxIterations; ++i) {
    const Eigen::Vector2d residual = target - map.value;
    const Eigen::Vector2d step = map.derivative.inverse() * residual;
    if (!(step.norm() > kLastStep * (1 + q.norm()))) return q + step;

    double scale = 1;
    for (; scale > kMinStepScale; scale /= 2) {
      const Eigen::Vector2d next = q + scale * step;
      const PlaneMap next_map = Differentiate(next, distort);
      if (next_map.derivative.determinant() > 0 &&
          (target - next_map.value).squaredNorm() < residual.squaredNorm() &&
          (!stay_regular || IsRegularSegment<Distortion>(k, next))) {
        q = next;
        map = next_map;
        break;
      }
    }
    if (!(scale > kMinStepScale)) break;
  }
  return q;
}

template <typename Model>
UndistortStatus Undistort(const double* params, const Eigen::Vector2d& pixel,
                          const std::optional<Eigen::Vector2d>& u_start,
                          UndistortedObservation* result) {
  using Lens = typename Model::Lens;
  using Distortion = typename Model::Distortion;
  constexpr double kMaxPixelError = 1e-8;
  const double* lens = Model::LensParams(params);
  const double* k = Model::DistortionParams(params);

  // From the lens plane's q to the ray; kNotConverged unless q is the answer.
  const auto accept = [&](const Eigen::Vector2d& q) {
    if (!IsRegularSegment<Distortion>(k, q)) {
      return UndistortStatus::kNotConverged;
    }
    Eigen::Vector2d u;
    if (!Lens::ToRay(lens, q.x(), q.y(), &u.x(), &u.y())) {
      return UndistortStatus::kOffAxis;
    }
    const PlaneMap projection = Differentiate(
        u, [params](const auto& a, const auto& b, auto* x, auto* y) {
          Model::Project(params, a, b, x, y);
        });
    if (!((projection.value - pixel).norm() <= kMaxPixelError) ||
        !(projection.derivative.determinant() > 0)) {
      return UndistortStatus::kNotConverged;
    }
    *result = {u, projection.derivative};
    return UndistortStatus::kOk;
  };

  const Eigen::Vector2d distorted(
      (pixel.x() - Model::CenterX(params)) / Model::FocalX(params),
      (pixel.y() - Model::CenterY(params)) / Model::FocalY(params));
  if constexpr (Distortion::kNumParams == 0) {
    return accept(distorted);
  } else {
    const auto solve_from = [&](const Eigen::Vector2d& q, bool stay_regular) {
      const auto solution =
          InvertDistortion<Distortion>(k, distorted, q, stay_regular);
      return solution ? accept(*solution) : UndistortStatus::kNotConverged;
    };
    if (u_start && u_start->allFinite()) {
      Eigen::Vector2d q;
      Lens::FromRay(lens, u_start->x(), u_start->y(), &q.x(), &q.y());
      const UndistortStatus status = solve_from(q, false);
      if (status != UndistortStatus::kNotConverged) return status;
    }
    const UndistortStatus status = solve_from(distorted, false);
    if (status != UndistortStatus::kNotConverged) return status;
    return solve_from(Eigen::Vector2d::Zero(), true);
  }
}

}  // namespace krot
