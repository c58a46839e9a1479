#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "krot/base/numbers.h"

namespace krot::internal {

// The set of all numbers in [lo, hi]. A function evaluated on an interval
// returns an interval that contains all its values there; it is the tighter the
// narrower the argument is. Every operation rounds outwards, so that such an
// enclosure is a proof. A quotient by an interval that contains 0 is the whole
// line. A bound that is NaN compares false with everything, so it proves
// nothing.
struct Interval {
  double lo = 0;
  double hi = 0;
};

// [lo, hi] widened on each side by 4 `ulps` units of roundoff, relative. That
// covers an error of `ulps` units in the last place and the rounding in this
// function.
inline Interval RoundOutwards(double lo, double hi, int ulps = 1) {
  using Limits = std::numeric_limits<double>;
  const double width = ulps * (2 * Limits::epsilon());
  return {lo - (std::abs(lo) * width + Limits::min()),
          hi + (std::abs(hi) * width + Limits::min())};
}

inline Interval operator-(const Interval& a) { return {-a.hi, -a.lo}; }

inline Interval operator+(const Interval& a, const Interval& b) {
  return RoundOutwards(a.lo + b.lo, a.hi + b.hi);
}
inline Interval operator+(const Interval& a, double b) {
  return RoundOutwards(a.lo + b, a.hi + b);
}
inline Interval operator+(double a, const Interval& b) { return b + a; }

inline Interval operator-(const Interval& a, const Interval& b) {
  return RoundOutwards(a.lo - b.hi, a.hi - b.lo);
}
inline Interval operator-(const Interval& a, double b) {
  return RoundOutwards(a.lo - b, a.hi - b);
}
inline Interval operator-(double a, const Interval& b) {
  return RoundOutwards(a - b.hi, a - b.lo);
}

inline Interval operator*(const Interval& a, const Interval& b) {
  const double ll = a.lo * b.lo;
  const double lh = a.lo * b.hi;
  const double hl = a.hi * b.lo;
  const double hh = a.hi * b.hi;
  // std::min and std::max might drop a NaN.
  if (std::isnan((ll + lh) + (hl + hh))) return {kNaN, kNaN};
  return RoundOutwards(std::min(std::min(ll, lh), std::min(hl, hh)),
                       std::max(std::max(ll, lh), std::max(hl, hh)));
}
inline Interval operator*(const Interval& a, double b) {
  if (std::isnan(a.lo * b + a.hi * b)) return {kNaN, kNaN};
  return RoundOutwards(std::min(a.lo * b, a.hi * b),
                       std::max(a.lo * b, a.hi * b));
}
inline Interval operator*(double a, const Interval& b) { return b * a; }

inline Interval operator/(const Interval& a, const Interval& b) {
  if (b.lo > 0 || b.hi < 0) return a * RoundOutwards(1 / b.hi, 1 / b.lo);
  return {-kInfinity, kInfinity};
}
inline Interval operator/(const Interval& a, double b) {
  return a / Interval{b, b};
}
inline Interval operator/(double a, const Interval& b) {
  return Interval{a, a} / b;
}

// True for every number of a.
inline bool operator<(const Interval& a, double b) { return a.hi < b; }
inline bool operator<(const Interval& a, const Interval& b) {
  return a.hi < b.lo;
}

// NaN if some number of a has no square root.
inline Interval sqrt(const Interval& a) {
  if (!(a.lo >= 0)) return {kNaN, kNaN};
  const Interval root = RoundOutwards(std::sqrt(a.lo), std::sqrt(a.hi));
  return {std::max(root.lo, 0.0), root.hi};
}

// The functions below assume that the C library is accurate to 4 units in the
// last place.

inline Interval atan(const Interval& a) {
  return RoundOutwards(std::atan(a.lo), std::atan(a.hi), 4);
}

// NaN unless a lies between the two poles around 0.
inline Interval tan(const Interval& a) {
  if (!(a.lo > -1.57 && a.hi < 1.57)) return {kNaN, kNaN};
  return RoundOutwards(std::tan(a.lo), std::tan(a.hi), 4);
}

// Enclosed by the value at one end and |sin'|, |cos'| <= 1.
inline Interval sin(const Interval& a) {
  const Interval at_end = RoundOutwards(std::sin(a.lo), std::sin(a.lo), 4);
  return at_end + Interval{a.lo - a.hi, a.hi - a.lo};
}
inline Interval cos(const Interval& a) {
  const Interval at_end = RoundOutwards(std::cos(a.lo), std::cos(a.lo), 4);
  return at_end + Interval{a.lo - a.hi, a.hi - a.lo};
}

// The angle of (x, y). NaN if the box meets the half line x <= 0, y = 0, where
// the angle jumps.
inline Interval atan2(const Interval& y, const Interval& x) {
  if (x.lo > 0) return atan(y / x);
  const Interval half_pi = RoundOutwards(kPi / 2, kPi / 2);
  if (y.lo > 0) return half_pi - atan(x / y);
  if (y.hi < 0) return -half_pi - atan(x / y);
  return {kNaN, kNaN};
}

// A value with its derivatives by two variables, for forward differentiation
// of the camera models: f(Dual{u, 1, 0}, Dual{v, 0, 1}) carries df/du, df/dv.
//
// Scalar is double, or Interval to bound derivatives on a set. Only the
// operations that the camera models use are defined.
template <typename Scalar>
struct Dual {
  Scalar value{};
  Scalar du{};
  Scalar dv{};
};

template <typename S>
inline Dual<S> operator-(const Dual<S>& a) {
  return {-a.value, -a.du, -a.dv};
}

template <typename S>
inline Dual<S> operator+(const Dual<S>& a, const Dual<S>& b) {
  return {a.value + b.value, a.du + b.du, a.dv + b.dv};
}

template <typename S>
inline Dual<S> operator-(const Dual<S>& a, const Dual<S>& b) {
  return {a.value - b.value, a.du - b.du, a.dv - b.dv};
}

template <typename S>
inline Dual<S> operator*(const Dual<S>& a, const Dual<S>& b) {
  return {a.value * b.value, a.du * b.value + a.value * b.du,
          a.dv * b.value + a.value * b.dv};
}

// (a / b)' = (a' - (a / b) b') / b
template <typename S>
inline Dual<S> operator/(const Dual<S>& a, const Dual<S>& b) {
  const S ratio = a.value / b.value;
  return {ratio, (a.du - ratio * b.du) / b.value,
          (a.dv - ratio * b.dv) / b.value};
}

template <typename S>
inline Dual<S> operator+(const Dual<S>& a, double b) {
  return {a.value + b, a.du, a.dv};
}
template <typename S>
inline Dual<S> operator+(double a, const Dual<S>& b) {
  return b + a;
}

template <typename S>
inline Dual<S> operator-(const Dual<S>& a, double b) {
  return {a.value - b, a.du, a.dv};
}
template <typename S>
inline Dual<S> operator-(double a, const Dual<S>& b) {
  return -b + a;
}

template <typename S>
inline Dual<S> operator*(const Dual<S>& a, double b) {
  return {a.value * b, a.du * b, a.dv * b};
}
template <typename S>
inline Dual<S> operator*(double a, const Dual<S>& b) {
  return b * a;
}

template <typename S>
inline Dual<S> operator/(const Dual<S>& a, double b) {
  return {a.value / b, a.du / b, a.dv / b};
}
template <typename S>
inline Dual<S> operator/(double a, const Dual<S>& b) {
  const S ratio = a / b.value;
  const S slope = -ratio / b.value;
  return {ratio, slope * b.du, slope * b.dv};
}

template <typename S>
inline bool operator<(const Dual<S>& a, double b) {
  return a.value < b;
}
template <typename S>
inline bool operator<(const Dual<S>& a, const Dual<S>& b) {
  return a.value < b.value;
}

// sqrt' = 1 / (2 sqrt)
template <typename S>
inline Dual<S> sqrt(const Dual<S>& a) {
  using std::sqrt;
  const S root = sqrt(a.value);
  const S slope = 0.5 / root;
  return {root, slope * a.du, slope * a.dv};
}

// atan'(a) = 1 / (1 + a^2)
template <typename S>
inline Dual<S> atan(const Dual<S>& a) {
  using std::atan;
  const S slope = 1.0 / (1.0 + a.value * a.value);
  return {atan(a.value), slope * a.du, slope * a.dv};
}

// atan2(y, x)' = (x y' - y x') / (x^2 + y^2)
template <typename S>
inline Dual<S> atan2(const Dual<S>& y, const Dual<S>& x) {
  using std::atan2;
  const S norm2 = x.value * x.value + y.value * y.value;
  return {atan2(y.value, x.value), (x.value * y.du - y.value * x.du) / norm2,
          (x.value * y.dv - y.value * x.dv) / norm2};
}

// Operations by which the camera models (models.h) are evaluated on intervals,
// with parameters that are intervals, too: P = Interval, T = Interval or
// Dual<Interval>. The results enclose the exact values and derivatives.

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
// [0, 1]. It is decreasing and convex for t > -1, so the values at the ends of
// an interval enclose S and S' on it.
inline constexpr double kEndOfAtanSeries = 1e-3;

// Encloses S(t) for one t >= -1e-3. The omitted terms of the series are below
// 1e-19.
inline Interval EncloseAtanOverRoot(double t) {
  if (!(t >= -kEndOfAtanSeries)) return {kNaN, kNaN};
  double value =
      1 -
      t * (1.0 / 3 - t * (1.0 / 5 - t * (1.0 / 7 - t * (1.0 / 9 - t / 11))));
  if (t < kEndOfAtanSeries) return RoundOutwards(value, value, 16);
  value = std::atan(std::sqrt(t)) / std::sqrt(t);
  return RoundOutwards(value, value, 4);
}

// Encloses S'(t) = (1 / (1 + t) - S) / (2 t) for one t >= -1e-3. The omitted
// terms of the series are below 1e-18.
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
