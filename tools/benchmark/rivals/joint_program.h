#pragma once

#include <vector>

#include <Eigen/Sparse>
#include <Eigen/SparseCholesky>

#include "krot/conic/cones.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// The programme of parametric_program.h for the whole problem, p = 2, with
// omega_i the depths at the start. y has all points, all translations except
// the first, which is fixed, and tau. The last cone bounds the first
// observation's depth, and so the free scale. The normal equations are
// factorised by a sparse Cholesky method with its own ordering, as in general
// cone solvers. A Program of cone_program_solver.h.
class JointProgram {
 public:
  using Cone = SecondOrderCone;
  using Vector = Cone::Vector;
  using Unknowns = Eigen::VectorXd;

  explicit JointProgram(const KnownRotationProblem& problem);

  // Sets the programme for gamma around x, where all depths must be positive.
  void Set(const Estimate& x, double gamma);

  // A start inside all cones: x, with tau above the smallest possible one.
  // ToEstimate is the inverse.
  Unknowns StartAt(double margin) const;
  Estimate ToEstimate(const Unknowns& y) const;

  int num_cones() const { return static_cast<int>(blocks_.size()); }
  Vector Slack(int i, const Unknowns& y) const;
  Vector Change(int i, const Unknowns& dy) const;
  void AddTransposed(int i, const Vector& z, Unknowns* sum) const;
  void ClearNormal();
  void AddToNormal(int i, const NtScaling<Cone>& W);
  bool Factorize();
  void Solve(Unknowns* rhs) const { *rhs = factor_.solve(*rhs); }

  // w_i at y.
  double Depth(int i, const Unknowns& y) const;
  int num_observations() const { return num_cones() - 1; }

 private:
  // G_i, with columns for the point, the translation and tau, and h_i. The
  // translation of the fixed frame has no columns.
  struct Block {
    int point;  // first of its three unknowns
    int frame;  // likewise; -1 if it is fixed
    Eigen::Matrix3d by_point;
    Eigen::Matrix3d by_frame;
    Vector by_tau;
    Vector constant;
  };

  int FrameOffset(int32_t frame) const;
  void BuildPattern();

  const KnownRotationProblem& problem_;
  Estimate start_;
  double gamma_ = 0;
  double max_tau_ = 0;
  std::vector<Block> blocks_;
  Eigen::SparseMatrix<double> normal_;  // lower triangle
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>, Eigen::Lower> factor_;
};

}  // namespace krot::internal
