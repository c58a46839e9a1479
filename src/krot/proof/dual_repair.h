#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "krot/conic/interior_point.h"
#include "krot/math/norm.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/proof/least_norm.h"
#include "krot/verify/certificate_check.h"

namespace krot::internal {

// The identities (1) and (2) of certificate_check.h as linear equations in the
// multipliers y_i, lambda_i, for one delta. Internal to the making of
// certificates.
//
// The rows are those of the points and frames that move, without those of the
// first frame if nothing is fixed (the problem must be connected). Where a
// frame sees points through several projection centres, or several positions
// are fixed, one more row holds the constants (b; d), counted from the centre
// of the frame's first view and from one of the positions (FixedConstants).
// Observation i fills, in the equations of
//
//   its point        P_i' (y_i; lambda_i) + ... = 0      P_i = E_i R_sr R_rw
//   its frame       -P_i' (y_i; lambda_i) - ... = 0      if that is not 0
//   the constants    k_i' (y_i; lambda_i) + ... <= 0     k_i = (b; delta d)
//
// with E_i = (J_i (I2 | -u_i); delta e3'). To be used so: Changes once, to be
// factorised; Miss of the multipliers in hand, to be solved for a change of
// them, as often as they are refined.
class DualSystem {
 public:
  // (2) is asked to stay as far below zero as it is for these multipliers, at
  // least by `margin`, relative to what it sums up.
  DualSystem(const KnownRotationProblem& problem, double delta,
             const std::vector<Multiplier>& multipliers, double margin);

  // What the equations miss for these, evaluated in extended precision.
  Eigen::VectorXd Miss(const std::vector<Multiplier>& multipliers) const;

  // The equations for changes of the multipliers of the constructor, in units
  // of lambda_i: of y_i by axes[i]' x_1,2, and of both y_i and lambda_i by x_3.
  LeastNormProblem Changes(const std::vector<Eigen::Matrix2d>& axes) const;

 private:
  using Real = long double;
  using Matrix3r = Eigen::Matrix<Real, 3, 3>;
  using Vector3r = Eigen::Matrix<Real, 3, 1>;
  using VectorXr = Eigen::Matrix<Real, Eigen::Dynamic, 1>;
  // (A; delta c) by the point and the frame's centre, both in the world, and
  // (b; delta d). Up to the rounding of R_cw the first two add up to 0.
  struct Block {
    Matrix3r point;
    Matrix3r frame;
    Vector3r constants = Vector3r::Zero();
    int32_t point_index = 0;
    int64_t point_equation = -1;  // its first; -1: fixed
    int32_t frame_index = 0;      // 0: omitted
  };

  std::vector<int32_t> OmitFrames(const KnownRotationProblem& problem);

  const std::vector<Multiplier> multipliers_;
  LeastNormProblem empty_;  // without columns
  std::vector<Block> blocks_;
  Real constants_ = 0;  // the left-hand side of (2) that is asked for
};

struct RepairOptions {
  int num_threads = 1;
  // It ends with the first multipliers that prove as much, pixels.
  double sufficient_bound = std::numeric_limits<double>::infinity();
};

// Makes multipliers that satisfy the identities (1) and (2) of
// certificate_check.h approximately for `delta` > 0, pixels, satisfy them to
// rounding. It goes to and fro between the least change, relative and in a
// metric in which lengthening y_i / lambda_i costs more than turning it, that
// restores (1) and (2), and the nearest multipliers with |y_i|_dual <=
// lambda_i. Where the two do not meet, y is divided by the largest
// |y_i|_dual / lambda_i, and what is proved is delta by as much smaller.
//
// Requires one connected problem and one multiplier per observation, all
// lambda > 0. See least_norm.h for the cost.
struct RepairedMultipliers {
  // Its observations are those of the problem; its defect is 0, nothing is
  // verified. None if the equations cannot be solved, or if there are misfits.
  std::optional<Certificate> certificate;
  // The observations whose lambda would have to change by more than half: the
  // others may balance without them. Ascending.
  std::vector<int64_t> misfits;
};

RepairedMultipliers RepairMultipliers(
    const KnownRotationProblem& problem, Norm norm, double delta,
    const std::vector<Multiplier>& multipliers,
    const RepairOptions& options = {});

}  // namespace krot::internal
