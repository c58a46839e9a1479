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
// before the first fold of the distortion. If true, that is proved (up to
// rounding). It is also false if parts of 2^-16 of the segment are too long for
// a decision, because det D' comes within about 1e-4 of 0 or because the
// distortion is the small difference of huge terms.
//
// For all but strong distortions, a bound on D' - I over the whole disc decides
// in about ten operations. Otherwise the segment is bisected until interval
// arithmetic proves each part positive. That takes a few parts, at 0.1 to 0.3
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

// UndistortPixel (camera_model.h) for a model known at compile time. The pixel
// is mapped back to the lens plane, the distortion is inverted there by
// Newton's method, and the lens in closed form.

// The value (x, y) and d (x, y) / d (a, b), from a function of dual numbers.
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
  // The last step is one below this, relative: as convergence is quadratic, the
  // error that it leaves is about the square of that.
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

// Searches the point of the lens plane that belongs to a pixel, from several
// starts: `start` first, if it is given and the model has a distortion. Calls
// `accept` with each candidate, a root of the distortion before the first fold,
// until that returns something other than kNotConverged.
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

  // Sets *result from the lens plane's q; kNotConverged if its ray does not
  // reproduce the pixel.
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
