#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "krot/math/norm.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/problem/subset.h"
#include "krot/verify/certificate_check.h"

namespace krot::internal {

// The force of one observation's multipliers on its point and its frame, in its
// camera: E'(delta lambda; y), in long double.
struct ObservationForce {
  using Real = long double;
  using Vector2 = Eigen::Matrix<Real, 2, 1>;
  using Vector3 = Eigen::Matrix<Real, 3, 1>;

  Vector3 sum;
  Vector3 terms;  // of absolute values: what it sums up before cancellation
};

ObservationForce MakeForce(const Observation& observation,
                           const ObservationForce::Vector2& y,
                           ObservationForce::Real delta_lambda);

// Of a sum of `count` terms, each of which has gone through at most 12
// roundings, relative to the sum of absolute values.
ObservationForce::Real RoundingError(size_t count);

// Of a sum of `count` forces that rotations known to kRotationError per entry
// have turned into the world: how far it is from the truth, at most, relative
// to the sum of the absolute values of all their `terms`. A length: a matrix
// of entries e makes a vector of terms that add up to 1 at most sqrt(3) e long.
ObservationForce::Real ForceError(size_t count);

// How much the multipliers may change for a unit of a force's change: what the
// rows of E^-T are long, at least.
struct Compliance {
  ObservationForce::Real y = 0;             // rows 1 and 2 together
  ObservationForce::Real delta_lambda = 0;  // row 0
};

// None if E might be singular, or has entries that are not finite.
std::optional<Compliance> MakeCompliance(const Observation& observation);

// A factor that covers the roundings of sums of non-negative bounds, in long
// double, and their cast to double.
inline constexpr long double kOutward = 1 + 1e-9L;

// The identity (1) of certificate_check.h says that forces balance. With unit
// vectors of the world, an observation pulls its point and its frame alike by
// f_i = R_cw' E_i'(y_i; delta lambda_i), and (1) is sum f_i = 0 at every point
// and at every frame that moves; what is fixed takes any force. E_i, R_cw are
// invertible: any change of f_i is one of the observation's multipliers.

// How far the forces at each point and frame are from balance, at most: the
// lengths of their sums.
struct Imbalance {
  std::vector<long double> of_point;
  std::vector<long double> of_frame;
};

// Per observation, how much its force has to change, at most, for all to
// balance: the imbalances are sent along the forest of observations that
// maximises the smallest `strength` on every way, towards what is fixed or, in
// a connected component without, the strongest. No others change. Exact but for
// roundings, for which the results are large enough. All strengths must be
// positive. O(observations log observations).
std::vector<long double> BoundCorrections(
    const KnownRotationProblem& problem,
    const std::vector<long double>& strength, const Imbalance& imbalance);

// What x_cam = R_cw s + R_sr t + t_sr has of constants where frames or points
// are fixed, with the world's origin O moved to one of these positions: the
// centre of the first view of the first fixed frame, or else the first fixed
// point. Forces that balance wherever something moves have the same sum of
// constants from every origin (docs/method/positions.md, "What is fixed"), and
// from this one they vanish where all that is fixed coincides. The frame at the
// origin counts like one that moves.
class FixedConstants {
 public:
  using Real = long double;
  using Vector3 = Eigen::Matrix<Real, 3, 1>;

  // A part of x_cam, and the sum of absolute values that its error is in
  // proportion to.
  struct Part {
    Vector3 x_cam = Vector3::Zero();
    Real size = 0;
  };

  // Keeps a reference to the problem.
  explicit FixedConstants(const KnownRotationProblem& problem);

  const Vector3& origin() const { return origin_; }  // O
  Real origin_size() const { return origin_size_; }

  // Whether OfFrame, and not the place of its views in it, is all there is.
  bool IsAwayFromOrigin(int32_t frame) const {
    return problem_.IsFixedFrame(frame) && frame != origin_frame_;
  }
  // R_sr t_f + t_sr + R_cw O; requires that the view's frame is fixed.
  Part OfFrame(const View& view) const;
  // R_cw (s_k - O); nothing if the point moves.
  Part OfPoint(const View& view, int32_t point) const;

 private:
  const KnownRotationProblem& problem_;
  int32_t origin_frame_ = -1;
  Vector3 origin_ = Vector3::Zero();
  Real origin_size_ = 0;
};

// What pulls from outside at the centre of a view or at a point, world
// coordinates. Forces balance with it that add up to the pull at the view's
// frame, and to its negative at the point.
struct Pull {
  enum class Kind { kView, kPoint };
  Kind kind = Kind::kView;
  int32_t index = 0;  // of the view, or of the point
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();
};

// The position x at which it pulls, and p'x.
Eigen::Vector3d PositionOf(const KnownRotationProblem& problem,
                           const Estimate& estimate, const Pull& pull);
double Along(const KnownRotationProblem& problem, const Estimate& estimate,
             const Pull& pull);

// Whether it pulls at what does not move.
bool IsFixedPosition(const KnownRotationProblem& problem, const Pull& pull);

// The same pull in a part of the problem; none if that does not hold it.
std::optional<Pull> InPart(const ProblemSubset& part, const Pull& pull);

// What is proved of multipliers, whatever they are to prove: that others exist
// beside them whose forces balance exactly, with pulls if there are any, how
// far away those are at most, and what the constants of the rows add up to.
//
// Forces balance but for g; changing those of a spanning forest balances them
// exactly. The change F_i of a force is one of (delta lambda_i; y_i) by
// E_i^-T F_i.
//
// Of what RefuseNumbers lets pass: Balance first and, unless it refuses, the
// others.
class ForceChecker {
 public:
  using Real = ObservationForce::Real;
  using Vector2 = ObservationForce::Vector2;
  using Vector3 = ObservationForce::Vector3;

  // Keeps references.
  ForceChecker(const KnownRotationProblem& problem, Norm norm,
               const Certificate& certificate, std::vector<Pull> pulls = {});

  // The first thing that is wrong, or none.
  std::optional<std::string> Balance();

  // sum_i f_i'o_i, o_i being the constant part of x_cam, with `error` for what
  // rounding and the exact multipliers may add. The world's origin is what
  // FixedConstants says; that of every other frame is the projection centre of
  // the first of its views that the support sees: t_f + R_sr^-1 t_sr of that
  // view is the unknown as well as t_f is. So if each frame has one centre, the
  // constants are gone; the others are force times offset of the centre. A pull
  // at another view than its frame's first adds the pull times its offset.
  struct Constants {
    Real value = 0;
    Real error = 0;
    Vector3 origin = Vector3::Zero();
    Real origin_error = 0;
  };
  Constants SumConstants() const;

  // rho, the largest |y_i|_dual / lambda_i of the exact multipliers at most;
  // none, and why, if one might have to change by half.
  std::optional<double> BoundRho(std::string* refusal) const;

  // Of the certificate's observations.
  std::vector<MultiplierChange> Changes() const;

 private:
  std::optional<std::string> ScaleMultipliers();
  std::optional<std::string> PlacePulls();
  Imbalance BoundImbalance() const;
  void FindCorrections();
  Real ErrorOfSums() const;
  // Of a view's centre from that of the first view of its frame, in its camera.
  struct Offset {
    Vector3 x_cam = Vector3::Zero();
    Real size = 0;
  };
  Offset FromFirstView(int32_t view, int32_t first) const;
  // Of the support, per frame.
  std::vector<std::optional<int32_t>> FirstViews() const;

  const KnownRotationProblem& whole_;
  const Norm norm_;
  const Certificate& certificate_;
  std::vector<Pull> pulls_;  // of part_, once placed

  const ProblemSubset part_;  // the support
  int exponent_ = 0;          // of the scale
  std::vector<Real> lambda_;  // of part_, scaled to a maximum in [1/2, 1)
  std::vector<Vector2> y_;
  std::vector<ObservationForce> forces_;
  std::vector<Compliance> compliances_;
  std::vector<Real> corrections_;  // bound |F_i|
};

}  // namespace krot::internal
