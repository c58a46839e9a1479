#include "krot/proof/observation_force.h"

#include <cmath>
#include <limits>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "krot/proof/certificate_check.h"
#include "krot/proof/force_balance.h"

namespace krot {
namespace {

using Real = ObservationForce::Real;
using Vector3 = ObservationForce::Vector3;
using Matrix3 = Eigen::Matrix<Real, 3, 3>;

constexpr Real kRoundoff = std::numeric_limits<Real>::epsilon();

}  // namespace

ObservationForce MakeForce(const Observation& observation,
                           const ObservationForce::Vector2& y,
                           Real delta_lambda) {
  const Matrix3 E = observation.E.cast<Real>();
  const Vector3 multipliers(delta_lambda, y[0], y[1]);
  return {E.transpose() * multipliers,
          E.cwiseAbs().transpose() * multipliers.cwiseAbs()};
}

Real RoundingError(size_t count) {
  return (static_cast<Real>(count) + 12) * kRoundoff;
}

Real ForceError(size_t count) {
  return 2 * (kRotationError + RoundingError(count));
}

// With e_k the rows of E, those of E^-T are e_1 x e_2, e_2 x e_0 and e_0 x e_1
// over det E = e_0'(e_1 x e_2). Their roundings are less than 4 of kRoundoff
// each of the product of the rows' lengths; as |det E| <= |e_0||e_1 x e_2| and
// so on, what is taken from it makes up for those of a product, too.
std::optional<Compliance> MakeCompliance(const Observation& observation) {
  const Matrix3 E = observation.E.cast<Real>();
  const auto length = [&](int i, int j) {
    return Vector3(E.row(i)).cross(Vector3(E.row(j))).norm();
  };
  const Real det =
      std::abs(E.determinant()) -
      16 * kRoundoff * E.row(0).norm() * E.row(1).norm() * E.row(2).norm();
  if (!(det > 0)) return std::nullopt;
  return Compliance{std::hypot(length(2, 0), length(0, 1)) / det * kOutward,
                    length(1, 2) / det * kOutward};
}

}  // namespace krot
