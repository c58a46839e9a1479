#pragma once

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
  constexpr double kMinStepScale = 1e-6;
  const auto distort = [k](const auto& a, const auto& b, auto* x, auto* y) {
    Distortion::Apply(k, a, b, x, y);
  };
  PlaneMap map = Differentiate(q, distort);
  if (!(map.derivative.determinant() > 0)) return std::nullopt;

  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector2d residual = target - map.value;
    const Eigen::Vector2d step = map.derivative.inverse() * residual;
    // As convergence is quadratic, the error that such a step leaves is about
    // its square.
    if (!(step.norm() > 1e-8 * (1 + q.norm()))) return q + step;

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
// `ends_with` with each candidate, a root of the distortion before the first
// fold, until that returns true.
template <typename Model, typename EndsWith>
void SearchLensPlane(const double* params, const Eigen::Vector2d& pixel,
                     const std::optional<Eigen::Vector2d>& start,
                     const EndsWith& ends_with) {
  using Distortion = typename Model::Distortion;
  const double* k = Model::DistortionParams(params);
  const Eigen::Vector2d distorted(
      (pixel.x() - Model::CenterX(params)) / Model::FocalX(params),
      (pixel.y() - Model::CenterY(params)) / Model::FocalY(params));
  if constexpr (Distortion::kNumParams == 0) {
    ends_with(distorted);
  } else {
    const auto ends_from = [&](const Eigen::Vector2d& q, bool stay_regular) {
      const auto solution =
          InvertDistortion<Distortion>(k, distorted, q, stay_regular);
      return solution && IsRegularSegment<Distortion>(k, *solution) &&
             ends_with(*solution);
    };
    if (start && ends_from(*start, false)) return;
    if (ends_from(distorted, false)) return;
    ends_from(Eigen::Vector2d::Zero(), true);
  }
}

constexpr double kMaxUndistortionErrorPx = 1e-8;

template <typename Model>
std::optional<UndistortedObservation> Undistort(const double* params,
                                                const Eigen::Vector2d& pixel) {
  std::optional<UndistortedObservation> result;
  const auto ends_with = [&](const Eigen::Vector2d& q) {
    if (!q.allFinite()) return false;
    Eigen::Vector2d u;
    if (!Model::Lens::ToRay(Model::LensParams(params), q.x(), q.y(), &u.x(),
                            &u.y())) {
      return true;  // 90 degrees or more off the axis
    }
    const PlaneMap projection = Differentiate(
        u, [params](const auto& a, const auto& b, auto* x, auto* y) {
          Model::Project(params, a, b, x, y);
        });
    if (!((projection.value - pixel).norm() <= kMaxUndistortionErrorPx) ||
        !(projection.derivative.determinant() > 0)) {
      return false;
    }
    result = {u, projection.derivative};
    return true;
  };
  SearchLensPlane<Model>(params, pixel, std::nullopt, ends_with);
  return result;
}

}  // namespace krot::internal
