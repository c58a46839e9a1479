#include "tools/benchmark/rivals/joint_program.h"

#include <algorithm>
#include <limits>

#include "krot/problem/cost.h"

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kMaxDepthGrowth = 10;
// Regularisation, relative to the diagonal, for unknowns that no observation
// determines.
constexpr double kRegularization = 1e-14;

}  // namespace

JointProgram::JointProgram(const KnownRotationProblem& problem)
    : problem_(problem), blocks_(problem.observations.size() + 1) {
  for (size_t i = 0; i < blocks_.size(); ++i) {
    const Observation& observation =
        problem.observations[i == blocks_.size() - 1 ? 0 : i];
    blocks_[i].point = 3 * observation.point;
    blocks_[i].frame = FrameOffset(problem.views[observation.view].frame);
  }
  BuildPattern();
}

int JointProgram::FrameOffset(int32_t frame) const {
  return frame == 0 ? -1 : 3 * (problem_.num_points + frame - 1);
}

void JointProgram::Set(const Estimate& x, double gamma) {
  start_ = x;
  gamma_ = gamma;
  max_tau_ = -std::numeric_limits<double>::infinity();
  for (int i = 0; i < num_observations(); ++i) {
    const Observation& observation = problem_.observations[i];
    const View& view = problem_.views[observation.view];
    const ViewedPoint viewed = ViewPoint(problem_, observation, x);
    const double omega = viewed.depth;
    Matrix3d E;  // (gamma w; v) of x_cam, in the unit of the depth
    E << gamma * observation.E.row(0), observation.E.bottomRows<2>();
    E /= omega;
    Block& block = blocks_[i];
    block.by_point = E * view.cam_from_world_rotation;
    block.by_frame = E * view.cam_from_rig_rotation;
    block.by_tau = Vector(1, 0, 0);
    block.constant = E * view.cam_from_rig_translation;
    if (block.frame < 0) block.constant += block.by_frame * x.translations[0];
    max_tau_ = std::max(max_tau_, viewed.v.norm() / omega - gamma);
  }
  // kMaxDepthGrowth - w_0 / omega_0 >= 0.
  Block& bound = blocks_.back();
  const Matrix3d keep = Vector3d(-1 / gamma, 0, 0).asDiagonal();
  bound.by_point = keep * blocks_.front().by_point;
  bound.by_frame = keep * blocks_.front().by_frame;
  bound.by_tau.setZero();
  bound.constant =
      Vector(kMaxDepthGrowth, 0, 0) + keep * blocks_.front().constant;
}

JointProgram::Unknowns JointProgram::StartAt(double margin) const {
  Unknowns y(normal_.rows());
  for (int32_t k = 0; k < problem_.num_points; ++k) {
    y.segment<3>(3 * k) = start_.points[k];
  }
  for (int32_t f = 1; f < problem_.num_frames; ++f) {
    y.segment<3>(FrameOffset(f)) = start_.translations[f];
  }
  y[y.size() - 1] = max_tau_ + margin;
  return y;
}

Estimate JointProgram::ToEstimate(const Unknowns& y) const {
  Estimate estimate = start_;
  for (int32_t k = 0; k < problem_.num_points; ++k) {
    estimate.points[k] = y.segment<3>(3 * k);
  }
  for (int32_t f = 1; f < problem_.num_frames; ++f) {
    estimate.translations[f] = y.segment<3>(FrameOffset(f));
  }
  return estimate;
}

JointProgram::Vector JointProgram::Change(int i, const Unknowns& dy) const {
  const Block& block = blocks_[i];
  Vector change = block.by_point * dy.segment<3>(block.point) +
                  block.by_tau * dy[dy.size() - 1];
  if (block.frame >= 0) change += block.by_frame * dy.segment<3>(block.frame);
  return change;
}

JointProgram::Vector JointProgram::Slack(int i, const Unknowns& y) const {
  return Change(i, y) + blocks_[i].constant;
}

// In units of omega_i.
double JointProgram::Depth(int i, const Unknowns& y) const {
  return (Slack(i, y)[0] - y[y.size() - 1]) / gamma_;
}

void JointProgram::AddTransposed(int i, const Vector& z, Unknowns* sum) const {
  const Block& block = blocks_[i];
  sum->segment<3>(block.point) += block.by_point.transpose() * z;
  if (block.frame >= 0) {
    sum->segment<3>(block.frame) += block.by_frame.transpose() * z;
  }
  (*sum)[sum->size() - 1] += block.by_tau.dot(z);
}

void JointProgram::BuildPattern() {
  const int size = 3 * (problem_.num_points + problem_.num_frames - 1) + 1;
  std::vector<Eigen::Triplet<double>> entries;
  const auto add_block = [&entries](int row, int column) {
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) {
        if (row + r >= column + c) entries.emplace_back(row + r, column + c, 0);
      }
    }
  };
  for (const Block& block : blocks_) {
    if (block.frame >= 0) add_block(block.frame, block.point);
  }
  for (int k = 0; k + 1 < size; k += 3) {
    add_block(k, k);
    for (int c = 0; c < 3; ++c) entries.emplace_back(size - 1, k + c, 0);
  }
  entries.emplace_back(size - 1, size - 1, 0);
  normal_.resize(size, size);
  normal_.setFromTriplets(entries.begin(), entries.end());
  factor_.analyzePattern(normal_);
}

void JointProgram::ClearNormal() { normal_.coeffs().setZero(); }

void JointProgram::AddToNormal(int i, const NtScaling<Cone>& W) {
  const Block& block = blocks_[i];
  Matrix3d by_point;
  Matrix3d by_frame;
  for (int c = 0; c < 3; ++c) {
    by_point.col(c) = W.ApplyInverse(block.by_point.col(c));
    by_frame.col(c) = W.ApplyInverse(block.by_frame.col(c));
  }
  const Vector by_tau = W.ApplyInverse(block.by_tau);
  const int tau = static_cast<int>(normal_.rows()) - 1;
  const auto add = [this](int row, int column, const Matrix3d& product) {
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) {
        if (row + r >= column + c) {
          normal_.coeffRef(row + r, column + c) += product(r, c);
        }
      }
    }
  };
  add(block.point, block.point, by_point.transpose() * by_point);
  const Vector tau_point = by_point.transpose() * by_tau;
  for (int c = 0; c < 3; ++c) {
    normal_.coeffRef(tau, block.point + c) += tau_point[c];
  }
  normal_.coeffRef(tau, tau) += by_tau.squaredNorm();
  if (block.frame < 0) return;
  add(block.frame, block.frame, by_frame.transpose() * by_frame);
  add(block.frame, block.point, by_frame.transpose() * by_point);
  const Vector tau_frame = by_frame.transpose() * by_tau;
  for (int c = 0; c < 3; ++c) {
    normal_.coeffRef(tau, block.frame + c) += tau_frame[c];
  }
}

bool JointProgram::Factorize() {
  for (int k = 0; k < normal_.rows(); ++k) {
    normal_.coeffRef(k, k) *= 1 + kRegularization;
  }
  factor_.factorize(normal_);
  return factor_.info() == Eigen::Success;
}

}  // namespace krot::internal
