#include "krot/solver/verified_dense.h"

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

struct DenseSystem {
  MatrixXd M;
  MatrixXd M_error;
  VectorXd g_bound;
};

// Frames' rows below the points'.
DenseSystem MakeDense(const UncertainSystem& system) {
  const int64_t rows = system.num_rows();
  const int64_t num_points = static_cast<int64_t>(system.point_bound.size());
  DenseSystem dense{MatrixXd::Zero(rows, system.num_columns()),
                    MatrixXd::Zero(rows, system.num_columns()), VectorXd(rows)};
  const auto set = [&](int64_t row, int64_t column,
                       const UncertainSystem::Block& block,
                       const UncertainSystem::BlockError& error) {
    dense.M.block<3, 2>(row, column) = block.cast<double>();
    dense.M_error.block<3, 2>(row, column) =
        error + (block.cwiseAbs() * (2 * kUnitRoundoff)).cast<double>();
  };
  int64_t column = 0;
  for (const UncertainSystem::Columns& c : system.columns) {
    set(3 * int64_t{c.point}, column, c.point_rows, c.point_error);
    if (c.frame >= 0) {
      set(3 * (num_points + c.frame), column, c.frame_rows, c.frame_error);
    }
    column += 2;
  }
  int64_t row = 0;
  for (const auto* bounds : {&system.point_bound, &system.frame_bound}) {
    for (const Eigen::Vector3d& bound : *bounds) {
      dense.g_bound.segment<3>(row) = bound;
      row += 3;
    }
  }
  return dense;
}

// Brings every row's length into [1/2, 1). False if that is impossible.
bool ScaleRows(DenseSystem* system) {
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

std::optional<double> BoundSolutionByInverse(const UncertainSystem& uncertain) {
  if (uncertain.num_rows() > kMaxDenseRows ||
      uncertain.num_rows() > uncertain.num_columns()) {
    return std::nullopt;
  }
  DenseSystem system = MakeDense(uncertain);
  const MatrixXd& M = system.M;
  if (!ScaleRows(&system)) return std::nullopt;
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
  const VectorXd a = X.cwiseAbs() * g * (kOutward * kOutward);
  if (!a.allFinite()) return std::nullopt;
  return a.maxCoeff();
}

}  // namespace krot
