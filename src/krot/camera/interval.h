#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "krot/base/numbers.h"

namespace krot::internal {

// All numbers in [lo, hi]: arithmetic on sets, so that a function evaluated on
// an interval encloses its values there (not tightly, but the tighter the
// narrower the interval). Every operation rounds outwards, so that an
// enclosure is a proof. A quotient by an interval that holds 0 is the whole
// line; a bound that is NaN compares false with everything: it proves nothing.
struct Interval {
  double lo = 0;
  double hi = 0;
};

// [lo, hi] made wider by 4 `ulps` units of the last place on each side: more
// than what `ulps` roundings to nearest and those of this function take.
inline Interval RoundOutwards(double lo, double hi, int ulps = 1) {
  constexpr double kFourUnits = 4 * std::numeric_limits<double>::epsilon() / 2;
  constexpr double kTiny = std::numeric_limits<double>::min();
  const double width = ulps * kFourUnits;
  return {lo - (std::abs(lo) * width + kTiny),
          hi + (std::abs(hi) * width + kTiny)};
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
  // min and max would lose a NaN.
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

// Not a number if some number of a has no root.
inline Interval sqrt(const Interval& a) {
  if (!(a.lo >= 0)) return {kNaN, kNaN};
  const Interval root = RoundOutwards(std::sqrt(a.lo), std::sqrt(a.hi));
  return {std::max(root.lo, 0.0), root.hi};
}

// The functions below trust the C library to 4 units of the last place.

inline Interval atan(const Interval& a) {
  return RoundOutwards(std::atan(a.lo), std::atan(a.hi), 4);
}

// Not a number unless a lies between two poles, around 0.
inline Interval tan(const Interval& a) {
  if (!(a.lo > -1.57 && a.hi < 1.57)) return {kNaN, kNaN};
  return RoundOutwards(std::tan(a.lo), std::tan(a.hi), 4);
}

// By |sin'|, |cos'| <= 1 from one end.
inline Interval sin(const Interval& a) {
  const Interval at_end = RoundOutwards(std::sin(a.lo), std::sin(a.lo), 4);
  return at_end + Interval{a.lo - a.hi, a.hi - a.lo};
}
inline Interval cos(const Interval& a) {
  const Interval at_end = RoundOutwards(std::cos(a.lo), std::cos(a.lo), 4);
  return at_end + Interval{a.lo - a.hi, a.hi - a.lo};
}

// The angle of (x, y). Not a number if the box meets the half line x <= 0,
// y = 0, where the angle jumps.
inline Interval atan2(const Interval& y, const Interval& x) {
  constexpr double kHalf = 1.5707963267948966;
  if (x.lo > 0) return atan(y / x);
  const Interval half_pi = RoundOutwards(kHalf, kHalf);
  if (y.lo > 0) return half_pi - atan(x / y);
  if (y.hi < 0) return -half_pi - atan(x / y);
  return {kNaN, kNaN};
}

}  // namespace krot::internal
