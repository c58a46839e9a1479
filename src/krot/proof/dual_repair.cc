#include "krot/proof/dual_repair.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

#include "krot/problem/known_rotation_problem.h"
#include "krot/verify/force_checker.h"

namespace krot::internal {
namespace {

template <typename Scalar>
Eigen::Matrix<Scalar, 3, 1> Stack(const Multiplier& multiplier) {
  return {multiplier.y[0], multiplier.y[1], multiplier.lambda};
}

}  // namespace

// The index of each frame in the equations. Frame 0 has no equations: it stands
// for all fixed frames or, if nothing is fixed, for the first frame. Also marks
// the fixed points in empty_.
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

namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::VectorXd;

// Coordinates that suit the dual ball |eta|_dual <= 1. For p = 2 the directions
// (rows) are along y and across it; otherwise the ball is the square of
// coordinates within [-1, 1].
struct DualFrame {
  Matrix2d directions;
  Vector2d coordinates;  // of y / lambda
};

DualFrame MakeDualFrame(const Vector2d& eta, Norm norm) {
  DualFrame frame;
  if (norm.p == 2) {
    const double length = eta.norm();
    const Vector2d along = length > 0 ? Vector2d(eta / length) : Vector2d(1, 0);
    frame.directions << along[0], along[1], -along[1], along[0];
    frame.coordinates << length, 0;
  } else if (norm.p == 1) {
    frame.directions.setIdentity();
    frame.coordinates = eta;
  } else {
    frame.directions << 0.5, 0.5, 0.5, -0.5;
    frame.coordinates << eta[0] + eta[1], eta[0] - eta[1];
  }
  return frame;
}

// Alternating projections, in the metric that Factorize fixes:
//
//   Factorize --> Balance --> IsNear --yes--> Divided, kept if the best
//                    ^           |                |
//                    |          no --> end      gains? --no--> end
//                    |                            |
//                    +---------- Shorten <-------yes
//
// After Balance (1) and (2) hold, but perhaps not |y_i|_dual <= lambda_i; after
// Shorten it is the other way round; after Divided both hold.
class Repair {
 public:
  Repair(const KnownRotationProblem& problem, Norm norm, double delta,
         const std::vector<Multiplier>& multipliers,
         const RepairOptions& options)
      : norm_(norm),
        delta_(delta),
        // A margin well above rounding, well below any gap.
        system_(problem, delta, multipliers, /*margin=*/1e-8),
        original_(multipliers),
        solver_(options.num_threads),
        now_(multipliers),
        sufficient_bound_(options.sufficient_bound) {}

  std::optional<Certificate> Run() {
    if (!Factorize()) return std::nullopt;
    std::optional<Certificate> best;
    // Each step costs two solves with the same factor.
    for (int step = 0; step < 20; ++step) {
      Balance();
      if (!IsNear()) break;
      const double ratio = LongestRatio() / (1 - 4e-13);  // for last roundings
      if (!(ratio > 0)) break;
      const double bound = delta_ / ratio;
      const double before = best ? best->lower_bound : 0;
      if (bound > before) best = Divided(ratio);
      if (bound >= sufficient_bound_) break;
      if (bound < before * (1 + 1e-9) && step > 1) break;
      Shorten();
    }
    return best;
  }

 private:
  bool Factorize() {
    for (const Multiplier& m : original_) {
      const DualFrame frame = MakeDualFrame(m.y / m.lambda, norm_);
      // Lengthening y lowers the bound in first order, turning it in second
      // order. So the unit of changes along y is the room that is left up to
      // lambda, but at least a thousandth of lambda.
      const Vector2d room = (1 - frame.coordinates.array().abs()).max(1e-3);
      axes_.push_back(room.asDiagonal() * frame.directions);
    }
    return solver_.Factorize(system_.Changes(axes_));
  }

  // Makes the least change after which (1) and (2) hold, to rounding: that of
  // the first solve is left after it, and only that of Miss() after the second.
  void Balance() {
    for (int n = 0; n < 2; ++n) {
      const VectorXd step = solver_.Solve(-system_.Miss(now_));
      for (size_t i = 0; i < now_.size(); ++i) {
        const Eigen::Vector3d change =
            step.segment<3>(3 * static_cast<int64_t>(i));
        const Multiplier& unit = original_[i];
        now_[i].lambda += unit.lambda * change[2];
        now_[i].y += unit.lambda * (axes_[i].transpose() * change.head<2>()) +
                     change[2] * unit.y;
      }
    }
  }

  // Whether no lambda has changed by more than half.
  bool IsNear() const {
    for (size_t i = 0; i < now_.size(); ++i) {
      if (!(std::abs(now_[i].lambda / original_[i].lambda - 1) < 0.5)) {
        return false;
      }
    }
    return true;
  }

  double LongestRatio() const {
    double longest = 0;
    for (const Multiplier& m : now_) {
      longest = std::max(longest, DualNorm(m.y, norm_) / m.lambda);
    }
    return longest;
  }

  void Shorten() {
    for (Multiplier& m : now_) {
      const DualFrame frame = MakeDualFrame(m.y / m.lambda, norm_);
      const Vector2d shortened = frame.coordinates.cwiseMin(1.0).cwiseMax(-1.0);
      m.y = m.lambda * (frame.directions.transpose() * shortened);
    }
  }

  Certificate Divided(double ratio) const {
    Certificate certificate;
    certificate.lower_bound = delta_ / ratio;
    for (size_t i = 0; i < now_.size(); ++i) {
      certificate.observations.push_back(
          {static_cast<int64_t>(i), now_[i].lambda, now_[i].y / ratio});
    }
    return certificate;
  }

  const Norm norm_;
  const double delta_;
  const DualSystem system_;
  const std::vector<Multiplier> original_;
  std::vector<Matrix2d> axes_;  // unit changes of y / lambda
  LeastNormSolver solver_;
  std::vector<Multiplier> now_;
  const double sufficient_bound_;
};

}  // namespace

std::optional<Certificate> RepairMultipliers(
    const KnownRotationProblem& problem, Norm norm, double delta,
    const std::vector<Multiplier>& multipliers, const RepairOptions& options) {
  if (multipliers.empty()) return std::nullopt;
  return Repair(problem, norm, delta, multipliers, options).Run();
}

std::vector<int64_t> LeastNormProblem::EquationsOfPoints() const {
  std::vector<int64_t> first(num_points);
  int64_t next = 0;
  for (int32_t k = 0; k < num_points; ++k) {
    first[k] = next;
    if (!IsFixedPoint(k)) next += 3;
  }
  return first;
}

// Factorises A'A for A = M', by eliminating the columns of points, so that
// Solve can compute A (A'A)^-1 rhs.
bool LeastNormSolver::Factorize(LeastNormProblem problem) {
  problem_ = std::move(problem);
  if (problem_.num_rows() > 3 * static_cast<int64_t>(problem_.columns.size())) {
    return false;
  }
  structure_ = {};
  structure_.point_begin.assign(1, 0);
  for (const LeastNormProblem::Columns& c : problem_.columns) {
    while (static_cast<int32_t>(structure_.point_begin.size()) <= c.point) {
      structure_.point_begin.push_back(
          static_cast<int64_t>(structure_.frame_of.size()));
    }
    structure_.frame_of.push_back(c.frame);
  }
  structure_.point_begin.resize(
      problem_.num_points + 1,
      static_cast<int64_t>(structure_.frame_of.size()));
  structure_.frame_is_fixed.assign(problem_.num_frames, 0);
  structure_.frame_is_fixed[0] = 1;
  structure_.point_is_fixed = problem_.point_is_fixed;
  equations_ = std::make_unique<CentredLeastSquares<3>>(structure_,
                                                        Context{num_threads_});
  using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  for (size_t i = 0; i < problem_.columns.size(); ++i) {
    Eigen::Map<RowMajor>(equations_->rows(static_cast<int64_t>(i))) =
        problem_.columns[i].rows;
  }
  if (!equations_->Factorize()) return false;
  if (!problem_.has_last_row) return true;
  last_row_.resize(3 * static_cast<int64_t>(problem_.columns.size()));
  for (size_t i = 0; i < problem_.columns.size(); ++i) {
    last_row_.segment<3>(3 * static_cast<int64_t>(i)) =
        problem_.columns[i].last_row;
  }
  const double norm2 = last_row_.squaredNorm();
  BlockVector x;
  Eigen::VectorXd in_span(last_row_.size());
  equations_->SolveRefined(nullptr, last_row_.data(), &x, in_span.data());
  last_row_ -= in_span;
  last_row_norm2_ = last_row_.squaredNorm();
  return last_row_norm2_ > 1e-20 * norm2;  // else it depends on the others
}

Eigen::VectorXd LeastNormSolver::Solve(const Eigen::VectorXd& rhs) const {
  BlockVector g;
  g.SetZero(problem_.num_points, problem_.num_frames);
  const std::vector<int64_t> of_point = problem_.EquationsOfPoints();
  for (int32_t k = 0; k < problem_.num_points; ++k) {
    if (!problem_.IsFixedPoint(k)) {
      g.points[k] = rhs.segment<3>(of_point[k]);
    }
  }
  const int64_t num_free_points = problem_.num_free_points();
  for (int32_t f = 1; f < problem_.num_frames; ++f) {
    g.frames[f] = rhs.segment<3>(3 * (num_free_points + f - 1));
  }
  BlockVector x;
  Eigen::VectorXd solution(3 * static_cast<int64_t>(problem_.columns.size()));
  equations_->SolveRefined(&g, nullptr, &x, solution.data());
  if (problem_.has_last_row) {
    double rest = rhs[rhs.size() - 1];
    for (size_t i = 0; i < problem_.columns.size(); ++i) {
      rest -= problem_.columns[i].last_row.dot(
          solution.segment<3>(3 * static_cast<int64_t>(i)));
    }
    solution += rest / last_row_norm2_ * last_row_;
  }
  return solution;
}

}  // namespace krot::internal
