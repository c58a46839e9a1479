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
#include "krot/verify/force_balance.h"
#include "krot/verify/pull.h"

namespace krot::internal {

// What is proved of multipliers, whatever they are to prove: that others exist
// beside them whose forces balance exactly, with pulls if there are any, how
// far away those are at most, and what the constants of the rows add up to.
//
// Forces (force_balance.h) balance but for g; changing those of a spanning
// forest balances them exactly. The change F_i of a force is one of
// (delta lambda_i; y_i) by E_i^-T F_i.
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
