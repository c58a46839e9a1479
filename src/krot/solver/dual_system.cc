#include "krot/solver/dual_system.h"

#include <Eigen/LU>

namespace krot {

using Eigen::VectorXd;

DualSystem::DualSystem(const KnownRotationProblem& problem,
                       const std::vector<double>& lambda)
    : num_points_(problem.num_points), num_frames_(problem.num_frames) {
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

LeastNormProblem DualSystem::Equations() const {
  LeastNormProblem equations{num_points_, num_frames_, has_constants_, {}};
  for (const Block& block : blocks_) {
    LeastNormProblem::Columns columns;
    columns.point = static_cast<int32_t>(block.point_row / 3);
    columns.frame = static_cast<int32_t>(
        block.frame_row < 0 ? 0 : block.frame_row / 3 - num_points_ + 1);
    columns.point_rows.topRows<2>() = block.point.topRows<2>().cast<double>();
    columns.frame_rows.topRows<2>() = block.frame.topRows<2>().cast<double>();
    columns.last_row.head<2>() = block.constants.head<2>().cast<double>();
    equations.columns.push_back(columns);
  }
  return equations;
}

LeastNormProblem DualSystem::EquationsWithScalings(const VectorXd& eta,
                                                   double delta) const {
  LeastNormProblem equations = Equations();
  for (size_t i = 0; i < blocks_.size(); ++i) {
    const Block& block = blocks_[i];
    const int64_t n = 2 * static_cast<int64_t>(i);
    const Vector3r weights(eta[n], eta[n + 1], delta);
    LeastNormProblem::Columns& columns = equations.columns[i];
    columns.point_rows.row(2) =
        (weights.transpose() * block.point).cast<double>();
    columns.frame_rows.row(2) =
        (weights.transpose() * block.frame).cast<double>();
    columns.last_row[2] = static_cast<double>(weights.dot(block.constants));
  }
  return equations;
}

}  // namespace krot
