#include "krot/proof/observation_force.h"

#include <cmath>
#include <limits>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "krot/proof/force_balance.h"

namespace krot {
namespace {

using Real = ObservationForce::Real;
using Vector3 = ObservationForce::Vector3;
using Matrix3 = Eigen::Matrix<Real, 3, 3>;

}  // namespace

ObservationForce MakeForce(const Observation& observation,
                           const ObservationForce::Vector2& y,
                           Real delta_lambda) {
  const Matrix3 E = observation.E.cast<Real>();
  const Vector3 multipliers(delta_lambda, y[0], y[1]);
  return {E.transpose() * multipliers,
          E.cwiseAbs().transpose() * multipliers.cwiseAbs()};
}

// With e_k the rows of E, those of E^-T are e_1 x e_2, e_2 x e_0 and e_0 x e_1
// over det E = e_0'(e_1 x e_2).
Compliance MakeCompliance(const Observation& observation) {
  const Matrix3 E = observation.E.cast<Real>();
  constexpr Real kRoundoff = std::numeric_limits<Real>::epsilon();
  const auto length = [&](int i, int j) {
    const Vector3 a = E.row(i);
    const Vector3 b = E.row(j);
    return a.cross(b).norm() + 8 * kRoundoff * a.norm() * b.norm();
  };
  const Real det =
      std::abs(E.determinant()) -
      16 * kRoundoff * E.row(0).norm() * E.row(1).norm() * E.row(2).norm();
  if (!(det > 0)) {
    constexpr Real kInfinity = std::numeric_limits<Real>::infinity();
    return {kInfinity, kInfinity};
  }
  return {std::hypot(length(2, 0), length(0, 1)) / det * kOutward,
          length(1, 2) / det * kOutward};
}

}  // namespace krot
