#pragma once

#include <cmath>

#include <Eigen/Core>

#include "krot/minimax/norm.h"

namespace krot {

// ||e||_p <= cap as kNum conditions h_j(e) >= 0 on an error e, pixels. Each cap
// offers, at e,
//
//   Slacks         h_j > 0 inside
//   Normals        n_j = -dh_j/de, as columns
//   kBend          -d^2 h_j / de^2 = kBend I
//   MaxStep        the largest t <= limit with e + t d inside
//   RelativeSlack  of slacks h_j, the product of all h_j / h_j(0)
//   Share          of multipliers: what they weigh beside an error's own
//                  weight, 1

// p = 2: h = (cap^2 - |e|^2) / 2.
struct DiscCap {
  static constexpr int kNum = 1;
  static constexpr double kBend = 1;
  using Vector = Eigen::Matrix<double, kNum, 1>;

  DiscCap(Norm, double cap_px) : cap(cap_px) {}

  Vector Slacks(const Eigen::Vector2d& e) const {
    const double norm = e.norm();
    return Vector((cap - norm) * (cap + norm) / 2);
  }
  Eigen::Matrix<double, 2, kNum> Normals(const Eigen::Vector2d& e) const {
    return e;
  }
  // Of |d|^2 t^2 + 2 e'd t = 2 h the positive root, without cancellation.
  double MaxStep(const Eigen::Vector2d& e, const Eigen::Vector2d& d,
                 double limit) const {
    const double h2 = 2 * Slacks(e)[0];
    const double b = e.dot(d);
    const double root = std::sqrt(b * b + d.squaredNorm() * h2);
    const double t = b > 0 ? h2 / (b + root) : (root - b) / d.squaredNorm();
    return t < limit ? t : limit;
  }
  double RelativeSlack(const Vector& h) const { return 2 * h[0] / (cap * cap); }
  double Share(const Vector& multiplier) const { return multiplier[0]; }

  double cap;
};

// p = 1 or infinity: h_j = cap - n_j'e.
struct PolygonCap {
  static constexpr int kNum = 4;
  static constexpr double kBend = 0;
  using Vector = Eigen::Matrix<double, kNum, 1>;

  PolygonCap(Norm norm, double cap_px) : cap(cap_px) {
    if (norm.p == 1) {
      normals << 1, 1, -1, -1, 1, -1, 1, -1;
    } else {
      normals << 1, -1, 0, 0, 0, 0, 1, -1;
    }
  }

  Vector Slacks(const Eigen::Vector2d& e) const {
    return Vector::Constant(cap) - normals.transpose() * e;
  }
  const Eigen::Matrix<double, 2, kNum>& Normals(const Eigen::Vector2d&) const {
    return normals;
  }
  double MaxStep(const Eigen::Vector2d& e, const Eigen::Vector2d& d,
                 double limit) const {
    const Vector h = Slacks(e);
    const Vector fall = normals.transpose() * d;
    for (int j = 0; j < kNum; ++j) {
      if (fall[j] * limit > h[j]) limit = h[j] / fall[j];
    }
    return limit;
  }
  double RelativeSlack(const Vector& h) const { return (h / cap).prod(); }
  double Share(const Vector& multipliers) const {
    return multipliers.maxCoeff() / cap;
  }

  double cap;
  Eigen::Matrix<double, 2, kNum> normals;
};

}  // namespace krot
