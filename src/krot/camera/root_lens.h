#pragma once

#include <cmath>

namespace krot::internal {

// The lenses whose image radius follows from a square root; lens.h says what a
// lens is.

// Division model of Fitzgibbon (2001): the ray of the lens point is
// (a, b, 1 + k (a^2 + b^2)), so that
//   (a, b) = (u, v) 2 / (1 + sqrt(1 - 4 k r^2)).
// Not a number where 4 k r^2 > 1: no lens point has that ray.
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
