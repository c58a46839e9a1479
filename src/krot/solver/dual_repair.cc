#include "krot/solver/dual_repair.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/LU>
#include <Eigen/QR>

#include "krot/problem/cost.h"

namespace krot {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using Real = long double;
using VectorXr = Eigen::Matrix<Real, Eigen::Dynamic, 1>;
using Matrix3r = Eigen::Matrix<Real, 3, 3>;
using Vector3r = Eigen::Matrix<Real, 3, 1>;

// By how much (2) stays below zero, relative to delta sum lambda w: what the
// checker may need, and what it costs of the bound.
constexpr double kConstantMargin = 1e-8;
// The bound that is claimed leaves this for the last roundings, relative.
constexpr double kBoundMargin = 4e-13;
// p is below this, beside multipliers of length 1, if eta is unique.
constexpr double kNoFreedom = 1e-9;
constexpr int kNumRefinements = 3;
constexpr int kSectionSteps = 90;  // 0.618^90 is below double precision

// (1) and (2) for eta_i = y_i / lambda_i, in the unknowns of one component
// without its first frame:  M eta + delta c = 0,  M = [A_i' lambda_i]_i. Where
// there are baselines, a last row holds the constants. Row scaled.
class DualSystem {
 public:
  DualSystem(const KnownRotationProblem& problem,
             const std::vector<Multiplier>& multipliers);

  // Whether every right-hand side has a solution.
  bool Factorize();

  // The eta of least norm with M eta = rhs.
  VectorXd LeastNormSolution(const VectorXr& rhs) const;

  // M eta, in long double.
  VectorXr Multiply(const VectorXd& eta) const;

  const VectorXr& c() const { return c_; }
  // Asks for a left-hand side of (2) that is -delta * margin instead of 0.
  void SetConstantMargin(double margin) {
    if (has_constants_) c_[rows_ - 1] += margin;
  }

  static int64_t NumUnknowns(const KnownRotationProblem& problem) {
    return 3 * (int64_t{problem.num_points} + problem.num_frames - 1);
  }

 private:
  // E of one observation, and where its unknowns begin.
  struct Block {
    Eigen::Matrix<Real, 3, 3> point, frame;  // rows: lambda (A; c)
    Vector3r constants;                      // lambda (b; d)
    int64_t point_row, frame_row;            // frame_row -1: omitted
  };

  template <typename Visit>
  void ForRows(const Block& block, const Visit& visit) const {
    for (int c = 0; c < 3; ++c) {
      visit(block.point_row + c, Vector3r(block.point.col(c)));
      if (block.frame_row >= 0) {
        visit(block.frame_row + c, Vector3r(block.frame.col(c)));
      }
    }
    if (has_constants_) visit(rows_ - 1, block.constants);
  }

  std::vector<Block> blocks_;
  bool has_constants_ = false;
  int64_t rows_ = 0;
  VectorXr c_;
  VectorXd scale_;                     // of rows
  Eigen::HouseholderQR<MatrixXd> qr_;  // of M'
};

DualSystem::DualSystem(const KnownRotationProblem& problem,
                       const std::vector<Multiplier>& multipliers) {
  std::vector<const View*> first_view(problem.num_frames, nullptr);
  for (size_t i = 0; i < problem.observations.size(); ++i) {
    const Observation& observation = problem.observations[i];
    const View& view = problem.views[observation.view];
    const View*& first = first_view[view.frame];
    if (first == nullptr) first = &view;
    Matrix3r E;
    E << observation.J.cast<Real>(),
        -observation.J.cast<Real>() * observation.u.cast<Real>(), 0, 0, 1;
    E *= multipliers[i].lambda;
    Block block;
    block.point = E * view.cam_from_world_rotation.cast<Real>();
    block.frame = E * view.cam_from_rig_rotation.cast<Real>();
    // From the projection centre of the frame's first view.
    block.constants.setZero();
    if (first != &view) {
      block.constants =
          E * view.cam_from_rig_translation.cast<Real>() -
          block.frame *
              (Matrix3r(first->cam_from_rig_rotation.cast<Real>()).inverse() *
               first->cam_from_rig_translation.cast<Real>());
      has_constants_ |= !block.constants.isZero(0);
    }
    block.point_row = 3 * int64_t{observation.point};
    block.frame_row = view.frame == 0
                          ? -1
                          : 3 * (int64_t{problem.num_points} + view.frame - 1);
    blocks_.push_back(block);
  }
  rows_ = NumUnknowns(problem) + has_constants_;
  c_ = VectorXr::Zero(rows_);
  for (const Block& block : blocks_) {
    ForRows(block,
            [&](int64_t row, const Vector3r& entry) { c_[row] += entry[2]; });
  }
}

bool DualSystem::Factorize() {
  const int64_t columns = 2 * static_cast<int64_t>(blocks_.size());
  if (rows_ > columns) return false;
  MatrixXd transposed = MatrixXd::Zero(columns, rows_);
  for (size_t i = 0; i < blocks_.size(); ++i) {
    ForRows(blocks_[i], [&](int64_t row, const Vector3r& entry) {
      transposed.block<2, 1>(2 * static_cast<int64_t>(i), row) =
          entry.head<2>().cast<double>();
    });
  }
  scale_ = transposed.colwise().norm().cwiseInverse();
  if (!scale_.allFinite()) return false;
  transposed *= scale_.asDiagonal();
  qr_.compute(transposed);
  const VectorXd diagonal = qr_.matrixQR().diagonal().cwiseAbs();
  return diagonal.minCoeff() >
         std::numeric_limits<double>::epsilon() * diagonal.maxCoeff();
}

VectorXd DualSystem::LeastNormSolution(const VectorXr& rhs) const {
  VectorXd padded = VectorXd::Zero(qr_.rows());
  padded.head(rows_) =
      qr_.matrixQR()
          .topRows(rows_)
          .triangularView<Eigen::Upper>()
          .transpose()
          .solve(VectorXd(rhs.cast<double>().cwiseProduct(scale_)));
  return qr_.householderQ() * padded;
}

VectorXr DualSystem::Multiply(const VectorXd& eta) const {
  VectorXr product = VectorXr::Zero(rows_);
  for (size_t i = 0; i < blocks_.size(); ++i) {
    const auto eta_i =
        eta.segment<2>(2 * static_cast<int64_t>(i)).cast<Real>().eval();
    ForRows(blocks_[i], [&](int64_t row, const Vector3r& entry) {
      product[row] += entry.head<2>().dot(eta_i);
    });
  }
  return product;
}

double DualNorm(const Eigen::Vector2d& y, Norm norm) {
  if (norm.p == 1) return y.cwiseAbs().maxCoeff();
  return norm.p == 2 ? y.norm() : y.cwiseAbs().sum();
}

double LargestDualNorm(const VectorXd& eta, Norm norm) {
  double largest = 0;
  for (int64_t i = 0; i < eta.size(); i += 2) {
    largest = std::max(largest, DualNorm(eta.segment<2>(i), norm));
  }
  return largest;
}

// The minimiser of the convex function in [0, high], by golden section.
template <typename Function>
double MinimizeConvex(const Function& function, double high) {
  const double ratio = (std::sqrt(5.0) - 1) / 2;
  double low = 0;
  double left = high - ratio * (high - low);
  double right = low + ratio * (high - low);
  double at_left = function(left);
  double at_right = function(right);
  for (int step = 0; step < kSectionSteps; ++step) {
    if (at_left <= at_right) {
      high = right;
      right = left;
      at_right = at_left;
      left = high - ratio * (high - low);
      at_left = function(left);
    } else {
      low = left;
      left = right;
      at_left = at_right;
      right = low + ratio * (high - low);
      at_right = function(right);
    }
  }
  return at_left <= at_right ? left : right;
}

}  // namespace

std::optional<Certificate> RepairMultipliers(
    const KnownRotationProblem& problem, Norm norm, const Estimate& estimate,
    const std::vector<Multiplier>& multipliers, int max_unknowns) {
  const int64_t count = static_cast<int64_t>(multipliers.size());
  if (count == 0 || DualSystem::NumUnknowns(problem) > max_unknowns) {
    return std::nullopt;
  }
  DualSystem system(problem, multipliers);
  double weighted_depth = 0;
  for (int64_t i = 0; i < count; ++i) {
    weighted_depth +=
        multipliers[i].lambda *
        ViewPoint(problem, problem.observations[i], estimate).depth;
  }
  system.SetConstantMargin(kConstantMargin * weighted_depth);
  if (!system.Factorize()) return std::nullopt;

  // With y0 the given multipliers, eta(theta) = theta p + q satisfies
  // M eta = -c for every theta, p being y0 / lambda without its part in the
  // row space of M. It proves the bound 1 / max |eta_i|_dual, of which the
  // inverse is convex in theta = 1 / delta.
  VectorXd y0(2 * count);
  for (int64_t i = 0; i < count; ++i) {
    y0.segment<2>(2 * i) = multipliers[i].y / multipliers[i].lambda;
  }
  const VectorXd p = y0 - system.LeastNormSolution(system.Multiply(y0));
  const VectorXd q = system.LeastNormSolution(-system.c());
  const auto inverse_bound = [&](double theta) {
    return LargestDualNorm(theta * p + q, norm);
  };
  // |theta p| > 2 max |q| cannot be better than theta = 0.
  const double longest_p = LargestDualNorm(p, norm);
  const double theta =
      longest_p > kNoFreedom
          ? MinimizeConvex(inverse_bound, 2 * inverse_bound(0) / longest_p)
          : 0;
  VectorXd eta = theta * p + q;
  const double inverse = LargestDualNorm(eta, norm);
  if (!(inverse > 0) || !std::isfinite(inverse)) return std::nullopt;
  const double delta = (1 - kBoundMargin) / inverse;
  eta *= delta;
  const VectorXr target = -Real{delta} * system.c();
  for (int n = 0; n < kNumRefinements; ++n) {
    eta += system.LeastNormSolution(target - system.Multiply(eta));
  }

  Certificate certificate;
  certificate.lower_bound = delta;
  for (int64_t i = 0; i < count; ++i) {
    const double lambda = multipliers[i].lambda;
    certificate.observations.push_back(
        {i, lambda, lambda * eta.segment<2>(2 * i)});
  }
  return certificate;
}

}  // namespace krot
