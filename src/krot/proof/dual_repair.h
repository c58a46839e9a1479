#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/QR>

#include "krot/conic/interior_point.h"
#include "krot/linear/schur_complement.h"
#include "krot/math/norm.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/verify/certificate_check.h"

namespace krot::internal {

// QR by Householder's reflections of matrices of blocks that share columns,
//
//   A = [ P_0            F_0 ]        P_k, F_k have the same rows; P_k may
//       [      P_1       F_1 ]        have no columns, F_k is mostly zeros
//       [           .     :  ]
//
// each P_k for itself, and then what they leave of the shared columns:
//
//   Q_k' [P_k  F_k] = [ R_k  G_k ]        H_0
//                     [  0   H_k ]        H_1  = Q R
//                                          :
//
// As accurate as of the dense matrix, and with only the shared columns the cost
// grows by the square.
class BlockAngularQr {
 public:
  explicit BlockAngularQr(int64_t num_shared_columns);

  // The next block: P_k, and of F_k the columns (ascending) that are not zero.
  // P_k has as many rows as columns at least.
  void Append(const Eigen::MatrixXd& own, std::vector<int64_t> columns,
              const Eigen::MatrixXd& shared);

  // Once all blocks are there. False unless the columns of A are independent,
  // beyond rounding.
  bool Factorize();

  // The x of least norm with A'x = rhs, which is ordered like the columns of A:
  // the blocks' own, then the shared ones.
  Eigen::VectorXd SolveLeastNorm(const Eigen::VectorXd& rhs) const;

 private:
  using Qr = Eigen::HouseholderQR<Eigen::MatrixXd>;

  struct Block {
    Qr qr;  // of P_k
    std::vector<int64_t> columns;
    Eigen::MatrixXd shared;  // [G_k; H_k] of these
    int64_t num_own() const { return qr.cols(); }
    int64_t num_rest() const { return qr.rows() - qr.cols(); }
  };

  bool is_independent_ = true;
  std::vector<Block> blocks_;
  int64_t num_rest_ = 0;             // rows of H
  Eigen::VectorXd squared_lengths_;  // of the shared columns
  Qr rest_;
};

// Under-determined equations M x = rhs with the structure of the known rotation
// problem: three equations per point that is not fixed, three per frame but
// frame 0, and perhaps one more that concerns everything. An observation has
// three unknowns (those that no equation mentions stay 0), which meet the
// equations of its point and, with the opposite sign, of its frame.
struct LeastNormProblem {
  struct Columns {
    int32_t point = 0;
    int32_t frame = 0;
    // By unknown (row) and equation of the point (column).
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
  // The first equation of each point, without meaning for fixed ones; those of
  // frames 1, 2, ... follow.
  std::vector<int64_t> EquationsOfPoints() const;
};

// Their solutions of least norm, x = M' (M M')^-1 rhs. What is factorised is
// M', an observation's three unknowns per row of blocks:
//
//              points          frames but 0    last
//            0    1    2       1    2    3
//   obs 0  [ P              |                | l ]   of frame 0
//   obs 1  [ P              | -P             | l ]   P: rows, 3 x 3
//   obs 2  [      P         |      -P        | l ]   l: last_row, 3 x 1
//   obs 3  [      P         |           -P   | l ]
//   obs 4  [           P    | -P             | l ]
//
// By Householder's reflections (BlockAngularQr), where that is affordable,
// as their multipliers span many decades; beyond `max_dense_rows` by
// eliminating points, which leaves the normal equations of the frames, and of
// the last column its part outside of the span of all others.
//
// Factorize once and then, if it succeeded, Solve as often as needed.
class LeastNormSolver {
 public:
  // The cost of the dense way grows with the rows and the frames' square.
  explicit LeastNormSolver(int num_threads, int64_t max_dense_rows = 1500)
      : num_threads_(num_threads), max_dense_rows_(max_dense_rows) {}

  // False if the equations may have no solution.
  bool Factorize(LeastNormProblem problem);

  // Three unknowns per observation.
  Eigen::VectorXd Solve(const Eigen::VectorXd& rhs) const;

 private:
  bool FactorizeDense();
  void AppendPoint(size_t begin, size_t end);
  bool FactorizeByPoints();
  Eigen::VectorXd SolveByPoints(const Eigen::VectorXd& rhs) const;

  const int num_threads_;
  const int64_t max_dense_rows_;
  LeastNormProblem problem_;
  // Dense: of the transposed equations.
  std::optional<BlockAngularQr> qr_;
  // By points.
  BlockStructure structure_;
  std::unique_ptr<CentredLeastSquares<3>> by_points_;
  Eigen::VectorXd last_row_;  // without its part in the span of the others
  double last_row_norm2_ = 0;
};

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
// lambda > 0. See LeastNormSolver for the cost.
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
