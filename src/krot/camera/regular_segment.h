#pragma once

#include <cmath>

#include <Eigen/Core>

#include "krot/camera/dual.h"
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

}  // namespace krot::internal
