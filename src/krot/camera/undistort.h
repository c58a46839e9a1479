#pragma once

#include <cmath>
#include <optional>

#include <Eigen/Core>
#include <Eigen/LU>

#include "krot/camera/camera_model.h"
#include "krot/camera/interval.h"

namespace krot::internal {

// Encloses det D' on the points t q of the lens plane, t in [t_begin, t_end].
template <typename Distortion>
Interval EncloseDeterminant(const double* k, const Eigen::Vector2d& q,
                            double t_begin, double t_end) {
  const Interval t = {t_begin, t_end};
  const Interval one = {1, 1};
  const Interval zero = {0, 0};
  Dual<Interval> x, y;
  Distortion::Apply(k, Dual<Interval>{t * q.x(), one, zero},
                    Dual<Interval>{t * q.y(), zero, one}, &x, &y);
  return x.du * y.dv - x.dv * y.du;
}

// Whether det D' > 0 everywhere between the centre and q: whether q lies
// before the first fold of the distortion. True is a proof (up to rounding);
// false also where 2^-16 of the segment is still too long to tell, since
// det D' comes within some 1e-4 of 0 or since the distortion is the small
// difference of huge terms.
//
// A bound on D' - I over the whole disc decides for all but strong
// distortions, in some ten operations. Otherwise the segment is bisected until
// interval arithmetic shows each part positive: a few parts, 0.1 to 0.3
// microseconds each.
template <typename Distortion>
bool IsRegularSegment(const double* k, const Eigen::Vector2d& q) {
  if (Distortion::DeviationBound(k, q.norm()) < 1) return q.allFinite();

  // Parts are dyadic: [begin, begin + length] / kWhole, length a power of 2
  // that divides begin.
  constexpr int kWhole = 1 << 16;
  int begin = 0;
  int length = kWhole;
  while (begin < kWhole) {
    const double t_begin = static_cast<double>(begin) / kWhole;
    const double t_end = static_cast<double>(begin + length) / kWhole;
    if (EncloseDeterminant<Distortion>(k, q, t_begin, t_end).lo > 0) {
      begin += length;
      while (length < kWhole && begin % (2 * length) == 0) length *= 2;
      continue;
    }
    const bool positive_at_end =
        EncloseDeterminant<Distortion>(k, q, t_end, t_end).lo > 0;
    if (!positive_at_end || length == 1) return false;
    length /= 2;
  }
  return true;
}

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

// Where the search for the lens plane's point of a pixel may start, and what it
// must end at: calls `accept` with one candidate after the other, each a root
// of the distortion, until it answers anything but kNotConverged. `start` is
// tried first, if there is one and the model has a distortion.
template <typename Model, typename Accept>
UndistortStatus SearchLensPlane(const double* params,
                                const Eigen::Vector2d& pixel,
                                const std::optional<Eigen::Vector2d>& start,
                                const Accept& accept) {
  using Distortion = typename Model::Distortion;
  const double* k = Model::DistortionParams(params);
  const Eigen::Vector2d distorted(
      (pixel.x() - Model::CenterX(params)) / Model::FocalX(params),
      (pixel.y() - Model::CenterY(params)) / Model::FocalY(params));
  if constexpr (Distortion::kNumParams == 0) {
    return accept(distorted);
  } else {
    const auto solve_from = [&](const Eigen::Vector2d& q, bool stay_regular) {
      const auto solution =
          InvertDistortion<Distortion>(k, distorted, q, stay_regular);
      if (!solution || !IsRegularSegment<Distortion>(k, *solution)) {
        return UndistortStatus::kNotConverged;
      }
      return accept(*solution);
    };
    if (start) {
      const UndistortStatus status = solve_from(*start, false);
      if (status != UndistortStatus::kNotConverged) return status;
    }
    const UndistortStatus status = solve_from(distorted, false);
    if (status != UndistortStatus::kNotConverged) return status;
    return solve_from(Eigen::Vector2d::Zero(), true);
  }
}

constexpr double kMaxUndistortionErrorPx = 1e-8;

template <typename Model>
UndistortStatus Undistort(const double* params, const Eigen::Vector2d& pixel,
                          const std::optional<Eigen::Vector2d>& u_start,
                          UndistortedObservation* result) {
  using Lens = typename Model::Lens;
  const double* lens = Model::LensParams(params);

  // From the lens plane's q to the ray; kNotConverged unless q is the answer.
  const auto accept = [&](const Eigen::Vector2d& q) {
    if (!q.allFinite()) return UndistortStatus::kNotConverged;
    Eigen::Vector2d u;
    if (!Lens::ToRay(lens, q.x(), q.y(), &u.x(), &u.y())) {
      return UndistortStatus::kOffAxis;
    }
    const PlaneMap projection = Differentiate(
        u, [params](const auto& a, const auto& b, auto* x, auto* y) {
          Model::Project(params, a, b, x, y);
        });
    if (!((projection.value - pixel).norm() <= kMaxUndistortionErrorPx) ||
        !(projection.derivative.determinant() > 0)) {
      return UndistortStatus::kNotConverged;
    }
    *result = {u, projection.derivative};
    return UndistortStatus::kOk;
  };

  std::optional<Eigen::Vector2d> q_start;
  if (u_start && u_start->allFinite()) {
    q_start.emplace();
    Lens::FromRay(lens, u_start->x(), u_start->y(), &q_start->x(),
                  &q_start->y());
  }
  return SearchLensPlane<Model>(params, pixel, q_start, accept);
}

}  // namespace krot::internal
