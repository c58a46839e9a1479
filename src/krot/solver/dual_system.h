#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "krot/problem/known_rotation_problem.h"
#include "krot/solver/least_norm.h"

namespace krot {

// The identities (1) and (2) of certificate_check.h as linear equations.
// Unknown are eta_i = y_i / lambda_i and, optionally, relative changes of the
// lambda_i. Internal to the making of certificates.
//
// The rows are those of the points and of all frames but the first (the
// problem must be connected). Where a frame sees points through several
// projection centres, one more row holds the constants (b; d), counted from the
// centre of the frame's first view.
class DualSystem {
 public:
  using Real = long double;
  using VectorXr = Eigen::Matrix<Real, Eigen::Dynamic, 1>;

  DualSystem(const KnownRotationProblem& problem,
             const std::vector<double>& lambda);

  // Asks for a left-hand side of (2) that is -delta * margin instead of 0.
  void SetConstantMargin(double margin);

  // The equations' left-hand sides, without c's: M eta, M = [A_i' lambda_i].
  VectorXr Multiply(const Eigen::VectorXd& eta) const;
  // sum_i lambda_i c_i.
  const VectorXr& c() const { return c_; }

  // The equations M x = rhs, and those that also let the lambda_i change by
  // x_i lambda_i, which adds lambda_i (A_i'eta_i + delta c_i) x_i.
  LeastNormProblem Equations() const;
  LeastNormProblem EquationsWithScalings(const Eigen::VectorXd& eta,
                                         double delta) const;

  int64_t num_rows() const { return num_rows_; }
  static int64_t NumRows(const KnownRotationProblem& problem) {
    return 3 * (int64_t{problem.num_points} + problem.num_frames - 1);
  }

 private:
  using Matrix3r = Eigen::Matrix<Real, 3, 3>;
  using Vector3r = Eigen::Matrix<Real, 3, 1>;
  // lambda (A; c) by the two unknowns of an observation, and lambda (b; d).
  struct Block {
    Matrix3r point;
    Matrix3r frame;
    Vector3r constants;
    int64_t point_row;
    int64_t frame_row;  // -1: omitted
  };

  // Calls visit(row, lambda (A; c) of that row) for every row of a block.
  template <typename Visit>
  void ForRows(const Block& block, const Visit& visit) const;

  int32_t num_points_;
  int32_t num_frames_;
  std::vector<Block> blocks_;
  bool has_constants_ = false;
  int64_t num_rows_ = 0;
  VectorXr c_;
};

}  // namespace krot
