#include "krot/solver/dual_system.h"

#include <limits>

#include <Eigen/LU>

namespace krot {

using Eigen::MatrixXd;
using Eigen::VectorXd;

DualSystem::DualSystem(const KnownRotationProblem& problem,
                       const std::vector<double>& lambda) {
  std::vector<const View*> first_view(problem.num_frames, nullptr);
  for (size_t i = 0; i < problem.observations.size(); ++i) {
    const Observation& observation = problem.observations[i];
    const View& view = problem.views[observation.view];
    Matrix3r E;
    E << observation.J.cast<Real>(),
        -observation.J.cast<Real>() * observation.u.cast<Real>(), 0, 0, 1;
    E *= lambda[i];
    Block block;
    block.point = E * view.cam_from_world_rotation.cast<Real>();
    block.frame = E * view.cam_from_rig_rotation.cast<Real>();
    block.constants.setZero();
    const View*& first = first_view[view.frame];
    if (first == nullptr) first = &view;
    if (first != &view) {
      const Matrix3r rig_from_first =
          Matrix3r(first->cam_from_rig_rotation.cast<Real>()).inverse();
      block.constants =
          E * view.cam_from_rig_translation.cast<Real>() -
          block.frame *
              (rig_from_first * first->cam_from_rig_translation.cast<Real>());
      has_constants_ |= !block.constants.isZero(0);
    }
    block.point_row = 3 * int64_t{observation.point};
    block.frame_row = view.frame == 0
                          ? -1
                          : 3 * (int64_t{problem.num_points} + view.frame - 1);
    blocks_.push_back(block);
  }
  num_rows_ = NumRows(problem) + has_constants_;
  c_ = VectorXr::Zero(num_rows_);
  for (const Block& block : blocks_) {
    ForRows(block,
            [&](int64_t row, const Vector3r& entry) { c_[row] += entry[2]; });
  }
}

template <typename Visit>
void DualSystem::ForRows(const Block& block, const Visit& visit) const {
  for (int k = 0; k < 3; ++k) {
    visit(block.point_row + k, Vector3r(block.point.col(k)));
    if (block.frame_row >= 0) {
      visit(block.frame_row + k, Vector3r(block.frame.col(k)));
    }
  }
  if (has_constants_) visit(num_rows_ - 1, block.constants);
}

void DualSystem::SetConstantMargin(double margin) {
  if (has_constants_) c_[num_rows_ - 1] += margin;
}

DualSystem::VectorXr DualSystem::Multiply(const VectorXd& eta) const {
  VectorXr product = VectorXr::Zero(num_rows_);
  for (size_t i = 0; i < blocks_.size(); ++i) {
    const Eigen::Matrix<Real, 2, 1> eta_i =
        eta.segment<2>(2 * static_cast<int64_t>(i)).cast<Real>();
    ForRows(blocks_[i], [&](int64_t row, const Vector3r& entry) {
      product[row] += entry.head<2>().dot(eta_i);
    });
  }
  return product;
}

MatrixXd DualSystem::TransposedColumns() const {
  MatrixXd columns =
      MatrixXd::Zero(2 * static_cast<int64_t>(blocks_.size()), num_rows_);
  for (size_t i = 0; i < blocks_.size(); ++i) {
    ForRows(blocks_[i], [&](int64_t row, const Vector3r& entry) {
      columns.block<2, 1>(2 * static_cast<int64_t>(i), row) =
          entry.head<2>().cast<double>();
    });
  }
  return columns;
}

MatrixXd DualSystem::TransposedScalings(const VectorXd& eta,
                                        double delta) const {
  MatrixXd columns =
      MatrixXd::Zero(static_cast<int64_t>(blocks_.size()), num_rows_);
  for (int64_t i = 0; i < columns.rows(); ++i) {
    const Vector3r weights(eta[2 * i], eta[2 * i + 1], delta);
    ForRows(blocks_[i], [&](int64_t row, const Vector3r& entry) {
      columns(i, row) = static_cast<double>(entry.dot(weights));
    });
  }
  return columns;
}

bool LeastNormSolver::Factorize(MatrixXd transposed) {
  if (transposed.cols() > transposed.rows()) return false;
  scale_ = transposed.colwise().norm().cwiseInverse();
  if (!scale_.allFinite()) return false;
  transposed *= scale_.asDiagonal();
  qr_.compute(transposed);
  const VectorXd diagonal = qr_.matrixQR().diagonal().cwiseAbs();
  return diagonal.minCoeff() >
         std::numeric_limits<double>::epsilon() * diagonal.maxCoeff();
}

VectorXd LeastNormSolver::Solve(const DualSystem::VectorXr& rhs) const {
  const int64_t rows = scale_.size();
  VectorXd padded = VectorXd::Zero(qr_.rows());
  padded.head(rows) =
      qr_.matrixQR()
          .topRows(rows)
          .triangularView<Eigen::Upper>()
          .transpose()
          .solve(VectorXd(rhs.cast<double>().cwiseProduct(scale_)));
  return qr_.householderQ() * padded;
}

}  // namespace krot
