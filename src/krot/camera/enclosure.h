#pragma once

#include <cmath>

#include "krot/camera/dual.h"
#include "krot/camera/interval.h"

namespace krot::internal {

// What the camera models (models.h) need to be evaluated on intervals, with
// parameters that are intervals too: P = Interval, T = Interval or
// Dual<Interval>. What comes out encloses the exact values and derivatives.

inline Dual<Interval> operator+(const Dual<Interval>& a, const Interval& b) {
  return {a.value + b, a.du, a.dv};
}
inline Dual<Interval> operator-(const Dual<Interval>& a, const Interval& b) {
  return {a.value - b, a.du, a.dv};
}
inline Dual<Interval> operator*(const Dual<Interval>& a, const Interval& b) {
  return {a.value * b, a.du * b, a.dv * b};
}

// S(t) = atan(z) / z with z^2 = t is the integral of 1 / (1 + t y^2) over
// [0, 1]: decreasing and convex for t > -1, so that the ends of an interval
// enclose S and S' on it.
inline constexpr double kEndOfAtanSeries = 1e-3;

// Encloses S(t) for one t >= -1e-3. The series leaves out less than 1e-19.
inline Interval EncloseAtanOverRoot(double t) {
  if (!(t >= -kEndOfAtanSeries)) return {kNaN, kNaN};
  double value =
      1 -
      t * (1.0 / 3 - t * (1.0 / 5 - t * (1.0 / 7 - t * (1.0 / 9 - t / 11))));
  if (t < kEndOfAtanSeries) return RoundOutwards(value, value, 16);
  value = std::atan(std::sqrt(t)) / std::sqrt(t);
  return RoundOutwards(value, value, 4);
}

// Encloses S'(t) = (1 / (1 + t) - S) / (2 t) for one t >= -1e-3. The series
// leaves out less than 1e-18.
inline Interval EncloseAtanOverRootSlope(double t) {
  if (!(t >= -kEndOfAtanSeries)) return {kNaN, kNaN};
  if (t < kEndOfAtanSeries) {
    const double value =
        -1.0 / 3 +
        t * (2.0 / 5 -
             t * (3.0 / 7 - t * (4.0 / 9 - t * (5.0 / 11 - t * (6.0 / 13)))));
    return RoundOutwards(value, value, 16);
  }
  return (1.0 / (1.0 + Interval{t, t}) - EncloseAtanOverRoot(t)) /
         Interval{2 * t, 2 * t};
}

inline Interval AtanOverRoot(const Interval& t) {
  return {EncloseAtanOverRoot(t.hi).lo, EncloseAtanOverRoot(t.lo).hi};
}

inline Dual<Interval> AtanOverRoot(const Dual<Interval>& t) {
  const Interval slope = {EncloseAtanOverRootSlope(t.value.lo).lo,
                          EncloseAtanOverRootSlope(t.value.hi).hi};
  return {AtanOverRoot(t.value), slope * t.du, slope * t.dv};
}

}  // namespace krot::internal
