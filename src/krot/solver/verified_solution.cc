#include "krot/solver/verified_solution.h"

#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/QR>

namespace krot {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kUnitRoundoff = std::numeric_limits<double>::epsilon() / 2;
// Covers the roundings of sums of products of non-negative doubles, whose
// relative error is below (number of terms + 2) * kUnitRoundoff.
constexpr double kOutward = 1 + 1e-9;
// Shorter rows may have lost digits to underflow.
constexpr double kShortestRow = 1e-150;

// Brings every row's length into [1/2, 1). False if that is impossible.
bool ScaleRows(UncertainSystem* system) {
  for (int64_t row = 0; row < system->M.rows(); ++row) {
    const double length = system->M.row(row).norm();
    if (!(length > kShortestRow) || !std::isfinite(length)) return false;
    int exponent = 0;
    std::frexp(length, &exponent);
    const double scale = std::ldexp(1.0, -exponent);
    system->M.row(row) *= scale;
    system->M_error.row(row) *= scale;
    system->g_bound[row] *= scale;
  }
  return true;
}

// Q R^-T where M' = Q R: the right inverse of least norm.
MatrixXd RightInverse(const MatrixXd& M) {
  const Eigen::HouseholderQR<MatrixXd> qr(M.transpose());
  const MatrixXd Q = qr.householderQ() * MatrixXd::Identity(M.cols(), M.rows());
  return qr.matrixQR()
      .topRows(M.rows())
      .triangularView<Eigen::Upper>()
      .solve(Q.transpose())
      .transpose();
}

}  // namespace

std::optional<VectorXd> BoundSolution(UncertainSystem system) {
  const MatrixXd& M = system.M;
  if (M.rows() > M.cols() || !ScaleRows(&system)) return std::nullopt;
  const MatrixXd X = RightInverse(M);
  if (!X.allFinite()) return std::nullopt;

  const MatrixXd E = MatrixXd::Identity(M.rows(), M.rows()) - M * X;
  const VectorXd X_sums = X.cwiseAbs().rowwise().sum();
  const double product_error =
      (static_cast<double>(M.cols()) + 3) * 2 * kUnitRoundoff;
  const VectorXd E_sums =
      E.cwiseAbs().rowwise().sum() * (1 + 2 * kUnitRoundoff) +
      M.cwiseAbs() * X_sums * product_error + system.M_error * X_sums;
  if (!E_sums.allFinite()) return std::nullopt;
  const double alpha = E_sums.maxCoeff() * kOutward;
  if (!(alpha < 0.5)) return std::nullopt;

  const VectorXd g =
      system.g_bound.array() + alpha / (1 - alpha) * system.g_bound.maxCoeff();
  VectorXd a = X.cwiseAbs() * g * (kOutward * kOutward);
  if (!a.allFinite()) return std::nullopt;
  return a;
}

}  // namespace krot
