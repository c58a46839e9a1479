#pragma once

#include <cmath>

#include "krot/base/numbers.h"

namespace krot::internal {

// A lens maps the ray (u, v, 1) to a point (a, b) of the lens plane, before
// any distortion, focal length and principal point:
//
//   FromRay(lens, u, v, &a, &b)   for any scalar, Ceres' jets included;
//   ToRay(lens, a, b, &u, &v)     its closed-form inverse; false if the ray
//                                 is 90 degrees or more off the axis.
//
// For directions (X, Y, Z) of any length, which may be beyond 90 degrees:
//
//   Sees(lens, X, Y, Z)           whether the lens has a point for it; the set
//                                 of these directions is connected;
//   FromPoint(lens, X, Y, Z, &a, &b)     that point, for any scalar; continues
//                                 FromRay(X / Z, Y / Z) to all that it sees;
//   ToPoint(lens, a, b, &X, &Y, &Z)      its inverse; false if there is none.
//
// `lens` points at kNumParams parameters. Every lens is radial, a = u h(r)
// with r^2 = u^2 + v^2, and the radial slope (r h)' changes its sign at most
// once between the axis and any ray, so that det d(a, b)/d(u, v) > 0 at a ray
// means det > 0 from the axis to that ray.

// atan(z) / z as a function of z^2, smooth at 0. The first omitted term of the
// series is below 1e-19.
template <typename T>
T AtanOverRoot(const T& z2) {
  using std::atan;
  using std::sqrt;
  if (z2 < 1e-3) {
    return 1.0 -
           z2 * (1.0 / 3 -
                 z2 * (1.0 / 5 - z2 * (1.0 / 7 - z2 * (1.0 / 9 - z2 / 11.0))));
  }
  const T z = sqrt(z2);
  return atan(z) / z;
}

// The angle of (Z, r) divided by r, as a function of r^2 and Z: atan(r / Z) / r
// where Z > 0, continued to all directions except r = 0, Z < 0. Homogeneous of
// degree -1.
template <typename T>
T AngleOverRadius(const T& r2, const T& Z) {
  using std::atan2;
  using std::sqrt;
  if (-Z < 0.0 && r2 < Z * Z) return AtanOverRoot(T(r2 / (Z * Z))) / Z;
  const T r = sqrt(r2);
  return atan2(r, Z) / r;
}

// sin(angle) / angle
inline double SineOverAngle(double angle) {
  return angle == 0 ? 1 : std::sin(angle) / angle;
}

inline double TanOverAngle(double angle) {
  return angle == 0 ? 1 : std::tan(angle) / angle;
}

// (a, b) = (u, v)
struct PerspectiveLens {
  static constexpr int kNumParams = 0;

  template <typename P, typename T>
  static void FromRay(const P*, const T& u, const T& v, T* a, T* b) {
    *a = u;
    *b = v;
  }

  static bool ToRay(const double*, double a, double b, double* u, double* v) {
    *u = a;
    *v = b;
    return true;
  }

  static bool Sees(const double*, double, double, double Z) { return Z > 0; }

  template <typename P, typename T>
  static void FromPoint(const P*, const T& X, const T& Y, const T& Z, T* a,
                        T* b) {
    *a = X / Z;
    *b = Y / Z;
  }

  static bool ToPoint(const double*, double a, double b, double* X, double* Y,
                      double* Z) {
    *X = a;
    *Y = b;
    *Z = 1;
    return true;
  }
};

// |(a, b)| = theta, the angle to the axis: the equidistant fisheye.
//   (a, b) = (u, v) atan(r) / r
struct EquidistantLens {
  static constexpr int kNumParams = 0;

  template <typename P, typename T>
  static void FromRay(const P*, const T& u, const T& v, T* a, T* b) {
    const T scale = AtanOverRoot(T(u * u + v * v));
    *a = u * scale;
    *b = v * scale;
  }

  static bool ToRay(const double*, double a, double b, double* u, double* v) {
    const double theta = std::hypot(a, b);
    if (theta >= kPi / 2) return false;
    const double scale = TanOverAngle(theta);
    *u = a * scale;
    *v = b * scale;
    return true;
  }

  static bool Sees(const double*, double X, double Y, double Z) {
    return Z > 0 || X != 0 || Y != 0;
  }

  template <typename P, typename T>
  static void FromPoint(const P*, const T& X, const T& Y, const T& Z, T* a,
                        T* b) {
    const T scale = AngleOverRadius(T(X * X + Y * Y), Z);
    *a = X * scale;
    *b = Y * scale;
  }

  static bool ToPoint(const double*, double a, double b, double* X, double* Y,
                      double* Z) {
    const double theta = std::hypot(a, b);
    if (!(theta < kPi)) return false;
    const double scale = SineOverAngle(theta);
    *X = a * scale;
    *Y = b * scale;
    *Z = std::cos(theta);
    return true;
  }
};

// Field of view omega [Devernay, Faugeras 2001]:
//   |(a, b)| = atan(2 r tan(omega / 2)) / omega
// For omega^2 < 1e-4 COLMAP defines the model by a polynomial,
//   |(a, b)| = r (1 + omega^2 (r^2 / 3 - 1 / 12)),
// and so does KROT, as parameters mean what COLMAP computes from them. (The
// Taylor series of the first formula has the opposite sign of the omega^2 term;
// the two differ by less than 0.02 px at r = 1 and a focal length of 1000 px.)
// The polynomial ends at 90 degrees; the first formula continues as
//   |(a, b)| = angle of (Z, 2 R tan(omega / 2)) / omega,  R^2 = X^2 + Y^2.
struct FovLens {
  static constexpr int kNumParams = 1;
  static constexpr double kSmallOmega2 = 1e-4;

  template <typename P, typename T>
  static void FromRay(const P* lens, const T& u, const T& v, T* a, T* b) {
    using std::tan;
    const P& omega = lens[0];
    const P omega2 = omega * omega;
    const T r2 = u * u + v * v;
    T scale;
    if (omega2 < kSmallOmega2) {
      scale = 1.0 + (r2 / 3.0 - 1.0 / 12) * omega2;
    } else {
      const P stretch = 2.0 * tan(omega * 0.5);
      scale = AtanOverRoot(T(r2 * (stretch * stretch))) * (stretch / omega);
    }
    *a = u * scale;
    *b = v * scale;
  }

  static bool ToRay(const double* lens, double a, double b, double* u,
                    double* v) {
    const double omega = lens[0];
    const double radius = std::hypot(a, b);
    double scale = 1;
    if (omega * omega < kSmallOmega2) {
      scale = SmallOmegaScale(omega * omega, radius);
    } else {
      const double angle = radius * omega;
      if (std::abs(angle) >= kPi / 2) return false;
      scale = TanOverAngle(angle) * omega / (2 * std::tan(omega / 2));
    }
    *u = a * scale;
    *v = b * scale;
    return true;
  }

  static bool Sees(const double* lens, double X, double Y, double Z) {
    return Z > 0 || (lens[0] * lens[0] >= kSmallOmega2 && (X != 0 || Y != 0));
  }

  template <typename P, typename T>
  static void FromPoint(const P* lens, const T& X, const T& Y, const T& Z, T* a,
                        T* b) {
    using std::tan;
    const P& omega = lens[0];
    if (omega * omega < kSmallOmega2) {
      FromRay(lens, T(X / Z), T(Y / Z), a, b);
      return;
    }
    const P stretch = 2.0 * tan(omega * 0.5);
    const T scale =
        AngleOverRadius(T((X * X + Y * Y) * (stretch * stretch)), Z) *
        (stretch / omega);
    *a = X * scale;
    *b = Y * scale;
  }

  static bool ToPoint(const double* lens, double a, double b, double* X,
                      double* Y, double* Z) {
    const double omega = lens[0];
    if (omega * omega < kSmallOmega2) {
      *Z = 1;
      return ToRay(lens, a, b, X, Y);
    }
    const double angle = std::hypot(a, b) * std::abs(omega);
    if (!(angle < kPi)) return false;
    const double scale =
        SineOverAngle(angle) * omega / (2 * std::tan(omega / 2));
    *X = a * scale;
    *Y = b * scale;
    *Z = std::cos(angle);
    return true;
  }

 private:
  // r / radius for the r with r (1 - omega2 / 12) + r^3 omega2 / 3 = radius.
  // The left side is convex and increasing, so Newton's method converges to the
  // root from above.
  static double SmallOmegaScale(double omega2, double radius) {
    if (radius == 0) return 1 / (1 - omega2 / 12);
    double r = radius / (1 - omega2 / 12);
    for (int i = 0; i < 100; ++i) {
      const double excess = r * (1 + omega2 * (r * r / 3 - 1.0 / 12)) - radius;
      const double next = r - excess / (1 + omega2 * (r * r - 1.0 / 12));
      if (!(next < r)) break;
      r = next;
    }
    return r / radius;
  }
};

// The image radius of the following lenses is given by a square root.

// Division model of Fitzgibbon (2001): the ray of the lens point is
// (a, b, 1 + k (a^2 + b^2)), so that
//   (a, b) = (u, v) 2 / (1 + sqrt(1 - 4 k r^2)).
// NaN where 4 k r^2 > 1: no lens point has that ray.
struct DivisionLens {
  static constexpr int kNumParams = 1;

  template <typename P, typename T>
  static void FromRay(const P* lens, const T& u, const T& v, T* a, T* b) {
    using std::sqrt;
    const T r2 = u * u + v * v;
    const T scale = 2.0 / (1.0 + sqrt(T(1.0 - r2 * (4.0 * lens[0]))));
    *a = u * scale;
    *b = v * scale;
  }

  static bool ToRay(const double* lens, double a, double b, double* u,
                    double* v) {
    const double depth = 1 + lens[0] * (a * a + b * b);
    if (depth <= 0) return false;
    *u = a / depth;
    *v = b / depth;
    return true;
  }

  static bool Sees(const double* lens, double X, double Y, double Z) {
    const double root2 = Z * Z - 4 * lens[0] * (X * X + Y * Y);
    return root2 >= 0 && Z + std::sqrt(root2) > 0;
  }

  template <typename P, typename T>
  static void FromPoint(const P* lens, const T& X, const T& Y, const T& Z, T* a,
                        T* b) {
    using std::sqrt;
    const T R2 = X * X + Y * Y;
    const T scale = 2.0 / (Z + sqrt(T(Z * Z - R2 * (4.0 * lens[0]))));
    *a = X * scale;
    *b = Y * scale;
  }

  static bool ToPoint(const double* lens, double a, double b, double* X,
                      double* Y, double* Z) {
    *X = a;
    *Y = b;
    *Z = 1 + lens[0] * (a * a + b * b);
    return Sees(lens, *X, *Y, *Z);
  }
};

// Enhanced unified camera [Khomutenko, Garcia, Martinet 2016]:
//   (a, b) = (u, v) / (alpha sqrt(1 + beta r^2) + 1 - alpha)
// Assumes 0 <= alpha <= 1 and beta > 0. alpha = 0 is the pinhole.
struct EucmLens {
  static constexpr int kNumParams = 2;

  template <typename P, typename T>
  static void FromRay(const P* lens, const T& u, const T& v, T* a, T* b) {
    using std::sqrt;
    const P& alpha = lens[0];
    const P& beta = lens[1];
    const T rho = sqrt(T((u * u + v * v) * beta + 1.0));
    const T denominator = rho * alpha + (1.0 - alpha);
    *a = u / denominator;
    *b = v / denominator;
  }

  static bool ToRay(const double* lens, double a, double b, double* u,
                    double* v) {
    const double alpha = lens[0];
    const double beta_r2 = lens[1] * (a * a + b * b);
    const double root = std::sqrt(1 - (2 * alpha - 1) * beta_r2);
    const double depth =
        (1 - alpha * alpha * beta_r2) / (alpha * root + (1 - alpha));
    if (depth <= 0) return false;
    *u = a / depth;
    *v = b / depth;
    return true;
  }

  static bool Sees(const double* lens, double X, double Y, double Z) {
    const double rho = std::sqrt(lens[1] * (X * X + Y * Y) + Z * Z);
    return lens[0] * rho + (1 - lens[0]) * Z > 0;
  }

  template <typename P, typename T>
  static void FromPoint(const P* lens, const T& X, const T& Y, const T& Z, T* a,
                        T* b) {
    using std::sqrt;
    const P& alpha = lens[0];
    const T rho = sqrt(T((X * X + Y * Y) * lens[1] + Z * Z));
    const T denominator = rho * alpha + Z * (1.0 - alpha);
    *a = X / denominator;
    *b = Y / denominator;
  }

  static bool ToPoint(const double* lens, double a, double b, double* X,
                      double* Y, double* Z) {
    const double alpha = lens[0];
    const double beta_r2 = lens[1] * (a * a + b * b);
    const double root2 = 1 - (2 * alpha - 1) * beta_r2;
    if (!(root2 > 0)) return false;
    *X = a;
    *Y = b;
    *Z = (1 - alpha * alpha * beta_r2) /
         (alpha * std::sqrt(root2) + (1 - alpha));
    return Sees(lens, *X, *Y, *Z);
  }
};

}  // namespace krot::internal
