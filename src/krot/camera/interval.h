#pragma once

#include <algorithm>
#include <limits>

namespace krot {

// All numbers in [lo, hi]: arithmetic on sets, so that a function evaluated on
// an interval encloses its values there (not tightly, but the tighter the
// narrower the interval). Encloses up to rounding: bounds are rounded to
// nearest. A quotient by an interval that holds 0 is the whole line; NaN
// bounds compare false with everything, so that they prove nothing.
struct Interval {
  double lo = 0;
  double hi = 0;
};

inline Interval operator-(const Interval& a) { return {-a.hi, -a.lo}; }

inline Interval operator+(const Interval& a, const Interval& b) {
  return {a.lo + b.lo, a.hi + b.hi};
}
inline Interval operator+(const Interval& a, double b) {
  return {a.lo + b, a.hi + b};
}

inline Interval operator-(const Interval& a, const Interval& b) {
  return {a.lo - b.hi, a.hi - b.lo};
}
inline Interval operator-(const Interval& a, double b) {
  return {a.lo - b, a.hi - b};
}

inline Interval operator*(const Interval& a, const Interval& b) {
  const double ll = a.lo * b.lo;
  const double lh = a.lo * b.hi;
  const double hl = a.hi * b.lo;
  const double hh = a.hi * b.hi;
  return {std::min(std::min(ll, lh), std::min(hl, hh)),
          std::max(std::max(ll, lh), std::max(hl, hh))};
}
inline Interval operator*(const Interval& a, double b) {
  return {std::min(a.lo * b, a.hi * b), std::max(a.lo * b, a.hi * b)};
}

inline Interval operator/(const Interval& a, const Interval& b) {
  if (b.lo > 0 || b.hi < 0) return a * Interval{1 / b.hi, 1 / b.lo};
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  return {-kInfinity, kInfinity};
}

}  // namespace krot
