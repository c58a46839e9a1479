#include "krot/proof/dual_system.h"

#include <algorithm>

#include <Eigen/LU>

#include "krot/problem/known_rotation_problem.h"
#include "krot/proof/fixed_constants.h"

namespace krot {
namespace {

template <typename Scalar>
Eigen::Matrix<Scalar, 3, 1> Stack(const Multiplier& multiplier) {
  return {multiplier.y[0], multiplier.y[1], multiplier.lambda};
}

}  // namespace

// What the frames are called in the equations, which begin with frame 1: what
// is fixed is frame 0 or, if nothing is, the first frame. Marks the points.
std::vector<int32_t> DualSystem::OmitFrames(
    const KnownRotationProblem& problem) {
  const bool has_fixed = HasFixed(problem);
  std::vector<int32_t> index(problem.num_frames, 0);
  int32_t next = has_fixed ? 1 : 0;
  for (int32_t f = 0; f < problem.num_frames; ++f) {
    if (!problem.IsFixedFrame(f)) index[f] = next++;
  }
  empty_.num_frames = next;
  if (problem.fixed_points.empty()) return index;
  for (int32_t k = 0; k < problem.num_points; ++k) {
    empty_.point_is_fixed.push_back(problem.IsFixedPoint(k));
  }
  return index;
}

DualSystem::DualSystem(const KnownRotationProblem& problem, double delta,
                       const std::vector<Multiplier>& multipliers,
                       double margin)
    : multipliers_(multipliers),
      empty_{problem.num_points, problem.num_frames, false, {}, {}} {
  const std::vector<int32_t> index_of_frame = OmitFrames(problem);
  const std::vector<int64_t> equations = empty_.EquationsOfPoints();
  const FixedConstants fixed(problem);
  Real sum = 0;
  Real size = 0;
  std::vector<const View*> first_view(problem.num_frames, nullptr);
  std::vector<Matrix3r> rig_from_world(problem.num_frames);
  for (size_t i = 0; i < problem.observations.size(); ++i) {
    const Observation& observation = problem.observations[i];
    const View& view = problem.views[observation.view];
    Matrix3r E;
    E << observation.E.bottomRows<2>().cast<Real>(),
        delta * observation.E.row(0).cast<Real>();
    Block block;
    block.point = E * view.cam_from_world_rotation.cast<Real>();
    block.point_index = observation.point;
    if (!problem.IsFixedPoint(observation.point)) {
      block.point_equation = equations[observation.point];
    }
    block.frame_index = index_of_frame[view.frame];
    const View*& first = first_view[view.frame];
    const Matrix3r by_rig = E * view.cam_from_rig_rotation.cast<Real>();
    if (first == nullptr) {
      first = &view;
      rig_from_world[view.frame] =
          Matrix3r(view.cam_from_rig_rotation.cast<Real>()).inverse() *
          view.cam_from_world_rotation.cast<Real>();
    }
    block.frame = -by_rig * rig_from_world[view.frame];
    if (fixed.IsAwayFromOrigin(view.frame)) {
      block.constants = E * fixed.OfFrame(view).x_cam;
    } else if (first != &view) {
      const Matrix3r rig_from_first =
          Matrix3r(first->cam_from_rig_rotation.cast<Real>()).inverse();
      block.constants = E * view.cam_from_rig_translation.cast<Real>() -
                        by_rig * (rig_from_first *
                                  first->cam_from_rig_translation.cast<Real>());
    }
    if (problem.IsFixedPoint(observation.point)) {
      block.constants += E * fixed.OfPoint(view, observation.point).x_cam;
    }
    empty_.has_last_row |= !block.constants.isZero(0);
    sum += block.constants.dot(Stack<Real>(multipliers[i]));
    size += multipliers[i].lambda * block.constants.norm();
    blocks_.push_back(block);
  }
  constants_ = std::min(sum, -margin * size);
}

Eigen::VectorXd DualSystem::Miss(
    const std::vector<Multiplier>& multipliers) const {
  VectorXr miss = VectorXr::Zero(empty_.num_rows());
  const int64_t num_free_points = empty_.num_free_points();
  if (empty_.has_last_row) miss[miss.size() - 1] = -constants_;
  for (size_t i = 0; i < blocks_.size(); ++i) {
    const Block& block = blocks_[i];
    const Vector3r z = Stack<Real>(multipliers[i]);
    if (block.point_equation >= 0) {
      miss.segment<3>(block.point_equation) += block.point.transpose() * z;
    }
    if (block.frame_index > 0) {
      miss.segment<3>(3 * (num_free_points + block.frame_index - 1)) +=
          block.frame.transpose() * z;
    }
    if (empty_.has_last_row) miss[miss.size() - 1] += block.constants.dot(z);
  }
  return miss.cast<double>();
}

LeastNormProblem DualSystem::Changes(
    const std::vector<Eigen::Matrix2d>& axes) const {
  LeastNormProblem equations = empty_;
  for (size_t i = 0; i < blocks_.size(); ++i) {
    const Block& block = blocks_[i];
    Matrix3r units = Matrix3r::Zero();
    units.topLeftCorner<2, 2>() =
        Real{multipliers_[i].lambda} * axes[i].cast<Real>();
    units.row(2) = Stack<Real>(multipliers_[i]).transpose();
    LeastNormProblem::Columns columns;
    columns.point = block.point_index;
    columns.frame = block.frame_index;
    columns.rows = (units * block.point).cast<double>();
    columns.last_row = (units * block.constants).cast<double>();
    equations.columns.push_back(columns);
  }
  return equations;
}

}  // namespace krot
