#pragma once

#include <vector>

#include <Eigen/Dense>

#include "krot/conic/cones.h"
#include "tools/benchmark/subproblem.h"

namespace krot::internal {

// The convex programme that the methods of generalised fractional programming
// solve for one value gamma of the cost:
//
//   F(gamma) = min over x, tau  tau
//   subject to  ||A_i x + b_i||_p <= gamma (c_i'x + d_i) + omega_i tau,
//
// with omega_i = 1 or the depths at the start; F(gamma) < 0 iff an x costs less
// than gamma. As F may be unbounded below where gamma is large, the mean of
// the depths, relative to the start, is bounded by kMaxDepthGrowth; this is the
// last cone. y = (x, tau). A Program of cone_program_solver.h.
template <typename ConeT>
class ParametricProgram {
 public:
  using Cone = ConeT;
  using Vector = typename Cone::Vector;
  using Unknowns = Eigen::Vector4d;

  enum class Weights { kOne, kDepths };

  // Sets the programme for gamma around x, where all depths must be positive.

  void Set(const Subproblem& problem, const Eigen::Vector3d& x, double gamma,
           Weights weights) {
    const int count = static_cast<int>(problem.residuals.size());
    G_.resize(count + 1);
    h_.resize(count + 1);
    Eigen::Vector4d growth = Eigen::Vector4d::Zero();  // of the mean depth
    max_tau_ = -std::numeric_limits<double>::infinity();
    for (int i = 0; i < count; ++i) {
      const Residual& residual = problem.residuals[i];
      const double depth = residual.Depth(x);
      const double omega = weights == Weights::kOne ? 1 : depth;
      growth.head<3>() += residual.c / (depth * count);
      growth[3] += residual.d / (depth * count);
      SetCone(residual, gamma, omega, &G_[i], &h_[i]);
      const double v = NormOf(residual.Numerator(x), norm());
      max_tau_ = std::max(max_tau_, (v - gamma * depth) / omega);
    }
    SetBound(growth, &G_[count], &h_[count]);
  }

  // A start inside all cones: x, with tau above the smallest possible one.
  Unknowns StartAt(const Eigen::Vector3d& x, double margin) const {
    Unknowns y;
    y << x, max_tau_ + margin;
    return y;
  }

  static Norm norm();

  int num_cones() const { return static_cast<int>(G_.size()); }
  Vector Slack(int i, const Unknowns& y) const { return G_[i] * y + h_[i]; }
  Vector Change(int i, const Unknowns& dy) const { return G_[i] * dy; }
  void AddTransposed(int i, const Vector& z, Unknowns* sum) const {
    *sum += G_[i].transpose() * z;
  }
  void ClearNormal() { normal_.setZero(); }
  void AddToNormal(int i, const NtScaling<Cone>& W) {
    Gradient scaled;
    for (int k = 0; k < 4; ++k) scaled.col(k) = W.ApplyInverse(G_[i].col(k));
    normal_ += scaled.transpose() * scaled;
  }
  bool Factorize() {
    factor_.compute(normal_);
    return factor_.info() == Eigen::Success;
  }
  void Solve(Unknowns* rhs) const { *rhs = factor_.solve(*rhs); }

 private:
  using Gradient = Eigen::Matrix<double, Cone::kDim, 4>;
  static constexpr double kMaxDepthGrowth = 10;

  static void SetCone(const Residual& residual, double gamma, double omega,
                      Gradient* G, Vector* h);
  static void SetBound(const Eigen::Vector4d& growth, Gradient* G, Vector* h);

  std::vector<Gradient> G_;
  std::vector<Vector> h_;
  double max_tau_ = 0;
  Eigen::Matrix4d normal_;
  Eigen::LLT<Eigen::Matrix4d> factor_;
};

template <>
inline Norm ParametricProgram<SecondOrderCone>::norm() {
  return Norm::L2();
}

// (top, v) with top = gamma w + omega tau.
template <>
inline void ParametricProgram<SecondOrderCone>::SetCone(
    const Residual& residual, double gamma, double omega, Gradient* G,
    Vector* h) {
  *G << gamma * residual.c.transpose(), omega,  //
      residual.A, Eigen::Vector2d::Zero();
  *h << gamma * residual.d, residual.b;
}

template <>
inline void ParametricProgram<SecondOrderCone>::SetBound(
    const Eigen::Vector4d& growth, Gradient* G, Vector* h) {
  G->setZero();
  G->row(0).head<3>() = -growth.head<3>();
  *h << kMaxDepthGrowth - growth[3], 0, 0;
}

template <>
inline Norm ParametricProgram<FourHalfLines>::norm() {
  return Norm::LInf();
}

// top + v_1, top - v_1, top + v_2, top - v_2.
template <>
inline void ParametricProgram<FourHalfLines>::SetCone(const Residual& residual,
                                                      double gamma,
                                                      double omega, Gradient* G,
                                                      Vector* h) {
  for (int k = 0; k < 4; ++k) {
    const double sign = k % 2 == 0 ? 1 : -1;
    G->row(k) << gamma * residual.c.transpose() + sign * residual.A.row(k / 2),
        omega;
    (*h)[k] = gamma * residual.d + sign * residual.b[k / 2];
  }
}

template <>
inline void ParametricProgram<FourHalfLines>::SetBound(
    const Eigen::Vector4d& growth, Gradient* G, Vector* h) {
  G->setZero();
  G->leftCols<3>() = Vector::Ones() * -growth.head<3>().transpose();
  h->setConstant(kMaxDepthGrowth - growth[3]);
}

}  // namespace krot::internal
