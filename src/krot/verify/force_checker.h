#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "krot/geometry.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/problem/subset.h"
#include "krot/verify/certificate_check.h"

namespace krot::internal {

// The gradient of one observation, called force in this folder: what it adds to
// the dual residual of its point and of its frame. It is E'(delta lambda; y),
// in camera coordinates and long double (docs/method/proof.md, "That exact
// multipliers exist").
struct ObservationForce {
  using Real = long double;
  using Vector2 = Eigen::Matrix<Real, 2, 1>;
  using Vector3 = Eigen::Matrix<Real, 3, 1>;

  Vector3 sum;
  Vector3 terms;  // the sum of the absolute values of its terms
};

ObservationForce MakeForce(const Observation& observation,
                           const ObservationForce::Vector2& y,
                           ObservationForce::Real delta_lambda);

// A bound on the rounding error of a sum of `count` terms, each of which has
// gone through at most 12 roundings, relative to the sum of absolute values.
ObservationForce::Real RoundingError(size_t count);

// A bound on the length of the error of a sum of `count` forces in the world,
// whose rotations are known to kRotationError per entry, relative to the sum of
// all their `terms`. (If all entries of a matrix are at most e, it maps a
// vector whose absolute values add up to 1 to one of length at most sqrt(3) e.)
ObservationForce::Real ForceError(size_t count);

// Upper bounds on how much the multipliers change if a force changes by a
// vector of length 1: the lengths of rows of E^-T.
struct Compliance {
  ObservationForce::Real y = 0;             // rows 1 and 2 together
  ObservationForce::Real delta_lambda = 0;  // row 0
};

// None if E might be singular, or has entries that are not finite.
std::optional<Compliance> MakeCompliance(const Observation& observation);

// A factor that covers the rounding of sums of non-negative bounds in long
// double, and of their cast to double.
inline constexpr long double kOutward = 1 + 1e-9L;

// (1) of certificate_check.h says that forces balance, which means that they
// add up to zero. In world coordinates an observation has the same force at its
// point and at its frame, f_i = R_cw' E_i'(delta lambda_i; y_i), and (1) is
// sum f_i = 0 at every point and every frame that is not fixed. As E_i and R_cw
// are invertible, any change of f_i is one of the observation's multipliers.

// Upper bounds on the dual residual at each point and frame: the length of the
// sum of forces.
struct Imbalance {
  std::vector<long double> of_point;
  std::vector<long double> of_frame;
};

// Per observation, an upper bound on how much its force has to change so that
// all forces balance. Only observations of a spanning forest change: the one
// that maximises the smallest `strength` on every path. Along it the imbalances
// are passed on towards what is fixed or, in a connected component without
// anything fixed, towards its strongest observation. The results are large
// enough to cover their rounding. All strengths must be positive.
// O(observations log observations).
std::vector<long double> BoundCorrections(
    const KnownRotationProblem& problem,
    const std::vector<long double>& strength, const Imbalance& imbalance);

// The constant parts of x_cam = R_cw s + R_sr t + t_sr where frames or points
// are fixed. The world's origin O is moved to one of the fixed positions: the
// centre of the first observation's view whose frame is fixed, or else the
// first fixed point. If forces balance at all that is not fixed, the sum of
// constants is the same for every origin (docs/method/positions.md, "What is
// fixed"); for this one the constants vanish if all fixed positions coincide.
// The frame at the origin is treated like one that is not fixed.
class FixedConstants {
 public:
  using Real = long double;
  using Vector3 = Eigen::Matrix<Real, 3, 1>;

  // A part of x_cam, and the sum of absolute values to which its error is
  // proportional.
  struct Part {
    Vector3 x_cam = Vector3::Zero();
    Real size = 0;
  };

  // Keeps a reference to the problem.
  explicit FixedConstants(const KnownRotationProblem& problem);

  const Vector3& origin() const { return origin_; }  // O
  Real origin_size() const { return origin_size_; }

  // Whether the constant of the frame's views is OfFrame. Otherwise it is only
  // their offset within the frame.
  bool IsAwayFromOrigin(int32_t frame) const {
    return problem_.IsFixedFrame(frame) && frame != origin_frame_;
  }
  // R_sr t_f + t_sr + R_cw O; requires that the view's frame is fixed.
  Part OfFrame(const View& view) const;
  // R_cw (s_k - O); zero if the point is not fixed.
  Part OfPoint(const View& view, int32_t point) const;

 private:
  const KnownRotationProblem& problem_;
  int32_t origin_frame_ = -1;
  Vector3 origin_ = Vector3::Zero();
  Real origin_size_ = 0;
};

// The position x of a pull, and its objective p'x.
Eigen::Vector3d PositionOf(const KnownRotationProblem& problem,
                           const Estimate& estimate, const Pull& pull);
double Along(const KnownRotationProblem& problem, const Estimate& estimate,
             const Pull& pull);

// Whether the position of a pull is fixed.
bool IsFixedPosition(const KnownRotationProblem& problem, const Pull& pull);

// The same pull in a part of the problem; none if its view or point is not in
// that.
std::optional<Pull> InPart(const ProblemSubset& part, const Pull& pull);

// The common part of checking certificates. It proves that multipliers exist
// near the given ones whose forces balance exactly, with pulls if there are
// any; how far away they are at most; and what the constants of the rows add up
// to.
//
// Given forces balance except for a small residual. Changing those of a
// spanning forest balances them exactly. A change F_i of a force means that
// (delta lambda_i; y_i) change by E_i^-T F_i.
//
// Usage: RefuseNumbers must have accepted the input. Call Balance first and,
// unless it refuses, the others.
class ForceChecker {
 public:
  using Real = ObservationForce::Real;
  using Vector2 = ObservationForce::Vector2;
  using Vector3 = ObservationForce::Vector3;

  // Keeps references.
  ForceChecker(const KnownRotationProblem& problem, Norm norm,
               const Certificate& certificate, std::vector<Pull> pulls = {});

  // Bounds the changes that balance all forces. Returns the reason of a
  // refusal, or none.
  std::optional<std::string> Balance();

  // sum_i f_i'o_i, where o_i is the constant part of x_cam; `error` bounds what
  // rounding and the change to exact multipliers may add. The origin of the
  // world is that of FixedConstants. The origin of every other frame is the
  // projection centre of its first view that the support sees: the unknown is
  // t_f + R_sr^-1 t_sr of that view instead of t_f. So constants vanish where a
  // frame has one centre; otherwise they are force times offset of the centre.
  // A pull at another view than its frame's first adds the pull times its
  // offset.
  struct Constants {
    Real value = 0;
    Real error = 0;
    Vector3 origin = Vector3::Zero();
    Real origin_error = 0;
  };
  Constants SumConstants() const;

  // rho, an upper bound on |y_i|_dual / lambda_i of the exact multipliers.
  // None, with the reason, if a lambda might have to change by half.
  std::optional<double> BoundRho(std::string* refusal) const;

  // One per observation of the certificate.
  std::vector<MultiplierChange> Changes() const;

 private:
  std::optional<std::string> ScaleMultipliers();
  std::optional<std::string> PlacePulls();
  Imbalance BoundImbalance() const;
  void FindCorrections();
  Real ErrorOfSums() const;
  // The offset of a view's centre from that of its frame's first view, in its
  // camera's coordinates.
  FixedConstants::Part FromFirstView(int32_t view, int32_t first) const;
  // Per frame, its first view in the support.
  std::vector<std::optional<int32_t>> FirstViews() const;

  const KnownRotationProblem& whole_;
  const Norm norm_;
  const Certificate& certificate_;
  std::vector<Pull> pulls_;  // with indices of part_ after PlacePulls

  const ProblemSubset part_;  // the support
  int exponent_ = 0;          // multipliers are scaled by 2^-exponent_
  std::vector<Real> lambda_;  // of part_, scaled to a maximum in [1/2, 1)
  std::vector<Vector2> y_;
  std::vector<ObservationForce> forces_;
  std::vector<Compliance> compliances_;
  std::vector<Real> corrections_;  // bound |F_i|
};

}  // namespace krot::internal
