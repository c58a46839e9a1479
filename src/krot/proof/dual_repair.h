#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "krot/conic/interior_point.h"
#include "krot/geometry.h"
#include "krot/linear/schur_complement.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/verify/certificate_check.h"

namespace krot::internal {

// Under-determined equations M x = rhs with the structure of the known rotation
// problem: three equations per point that is not fixed, three per frame except
// frame 0, and perhaps a last one that involves everything. An observation has
// three unknowns (they are 0 if they are in no equation), which appear in the
// equations of its point and, with the opposite sign, in those of its frame.
struct LeastNormProblem {
  struct Columns {
    int32_t point = 0;
    int32_t frame = 0;
    // Coefficients: a row per unknown, a column per equation of the point.
    Eigen::Matrix3d rows = Eigen::Matrix3d::Zero();
    Eigen::Vector3d last_row = Eigen::Vector3d::Zero();
  };
  int32_t num_points = 0;
  int32_t num_frames = 0;
  bool has_last_row = false;
  std::vector<Columns> columns;      // in the order of their points
  std::vector<char> point_is_fixed;  // empty: none is

  bool IsFixedPoint(int32_t k) const {
    return !point_is_fixed.empty() && point_is_fixed[k] != 0;
  }
  int64_t num_free_points() const {
    return num_points -
           std::count(point_is_fixed.begin(), point_is_fixed.end(), char{1});
  }
  int64_t num_rows() const {
    return 3 * (num_free_points() + num_frames - 1) + has_last_row;
  }
  // The index of each point's first equation, meaningless for fixed points. The
  // equations of frames 1, 2, ... follow after those of points.
  std::vector<int64_t> EquationsOfPoints() const;
};

// Finds solutions of least norm of such equations, x = M' (M M')^-1 rhs. It
// factorises M'; a row of blocks has the three unknowns of an observation:
//
//              points          frames but 0    last
//            0    1    2       1    2    3
//   obs 0  [ P              |                | l ]   of frame 0
//   obs 1  [ P              | -P             | l ]   P: rows, 3 x 3
//   obs 2  [      P         |      -P        | l ]   l: last_row, 3 x 1
//   obs 3  [      P         |           -P   | l ]
//   obs 4  [           P    | -P             | l ]
//
// The points are eliminated, which leaves the normal equations of the frames;
// the last column is replaced by its part outside the span of all others.
//
// Usage: Factorize once and then, if it succeeded, Solve as often as necessary.
class LeastNormSolver {
 public:
  explicit LeastNormSolver(int num_threads) : num_threads_(num_threads) {}

  // False if the equations may have no solution.
  bool Factorize(LeastNormProblem problem);

  // Three unknowns per observation.
  Eigen::VectorXd Solve(const Eigen::VectorXd& rhs) const;

 private:
  const int num_threads_;
  LeastNormProblem problem_;
  BlockStructure structure_;
  std::unique_ptr<CentredLeastSquares<3>> equations_;  // M'
  Eigen::VectorXd last_row_;  // without its part in the span of the others
  double last_row_norm2_ = 0;
};

// The identities (1) and (2) of certificate_check.h as linear equations in the
// multipliers y_i, lambda_i, for one delta. Internal to the making of
// certificates.
//
// There are three equations for every point and frame that is not fixed,
// without those of the first frame if nothing is fixed (the problem must be
// connected). Where a frame sees points through several projection centres, or
// several positions are fixed, one more equation is for the constants (b; d).
// Their origins are the centre of the frame's first view and one of the fixed
// positions (FixedConstants). Observation i has these coefficients in the
// equations of
//
//   its point        P_i' (y_i; lambda_i) + ... = 0      P_i = E_i R_sr R_rw
//   its frame       -P_i' (y_i; lambda_i) - ... = 0      if that is not 0
//   the constants    k_i' (y_i; lambda_i) + ... <= 0     k_i = (b; delta d)
//
// where E_i has the rows v of the observation's E, then delta times its row w.
// Usage: factorise Changes once; then, as often as the multipliers are refined,
// solve for the change that removes their Miss.
class DualSystem {
 public:
  // The left-hand side of (2) is to stay as it is for these multipliers, but to
  // be below zero at least by `margin`, relative to the size of its terms.
  DualSystem(const KnownRotationProblem& problem, double delta,
             const std::vector<Multiplier>& multipliers, double margin);

  // The residual of the equations for these multipliers, evaluated in extended
  // precision.
  Eigen::VectorXd Miss(const std::vector<Multiplier>& multipliers) const;

  // The equations for relative changes of the constructor's multipliers: x_1,2
  // change y_i by lambda_i axes[i]' x_1,2, and x_3 scales both y_i and lambda_i
  // by 1 + x_3.
  LeastNormProblem Changes(const std::vector<Eigen::Matrix2d>& axes) const;

 private:
  using Real = long double;
  using Matrix3r = Eigen::Matrix<Real, 3, 3>;
  using Vector3r = Eigen::Matrix<Real, 3, 1>;
  using VectorXr = Eigen::Matrix<Real, Eigen::Dynamic, 1>;
  // (A; delta c) with respect to the point and to the frame's centre, both in
  // the world, and (b; delta d). The first two add up to 0, up to the rounding
  // of R_cw.
  struct Block {
    Matrix3r point;
    Matrix3r frame;
    Vector3r constants = Vector3r::Zero();
    int32_t point_index = 0;
    int64_t point_equation = -1;  // the first of the point; -1 if it is fixed
    int32_t frame_index = 0;      // 0: without equations
  };

  std::vector<int32_t> OmitFrames(const KnownRotationProblem& problem);

  const std::vector<Multiplier> multipliers_;
  LeastNormProblem empty_;  // without columns
  std::vector<Block> blocks_;
  Real constants_ = 0;  // the wanted left-hand side of (2)
};

struct RepairOptions {
  int num_threads = 1;
  // The repair ends with the first multipliers that prove this bound, pixels.
  double sufficient_bound = std::numeric_limits<double>::infinity();
};

// Takes multipliers that satisfy (1) and (2) of certificate_check.h
// approximately, for `delta` > 0 pixels, and makes them satisfy (1) and (2) to
// rounding. It alternates between two projections: the least relative change
// that restores (1) and (2), in a metric in which lengthening y_i / lambda_i
// costs more than turning it; and the nearest multipliers with |y_i|_dual <=
// lambda_i. If the two do not meet, y is divided by the largest
// |y_i|_dual / lambda_i, and so is delta, the bound that is proved.
//
// Requires one connected problem and one multiplier per observation, all
// lambda > 0. See LeastNormSolver for the cost.
//
// The certificate has all observations of the problem; it is not verified, and
// its defect is 0. None if the equations cannot be solved, or if a lambda would
// have to change by more than half.
std::optional<Certificate> RepairMultipliers(
    const KnownRotationProblem& problem, Norm norm, double delta,
    const std::vector<Multiplier>& multipliers,
    const RepairOptions& options = {});

}  // namespace krot::internal
