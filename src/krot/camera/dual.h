#pragma once

#include <cmath>

namespace krot::internal {

// A value with its derivatives by two variables, for forward differentiation
// of the camera models: f(Dual{u, 1, 0}, Dual{v, 0, 1}) carries df/du, df/dv.
//
// Scalar is double, or Interval (interval.h) to bound derivatives on a set.
// Only what the camera models use is defined. No allocation, no branches.
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

}  // namespace krot::internal
