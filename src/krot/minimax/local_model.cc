#include "krot/minimax/newton_descent.h"

#include <algorithm>
#include <cmath>

#include "krot/linear/blocks.h"
#include "krot/minimax/kernels.h"

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr int kZeroPiece = 0;

// The distance of x from the place where v and w vanish: if x is a point, its
// distance from the camera; if x is a translation, the camera's distance from
// the point. Exact up to a factor near 1.
double DistanceFromCamera(const Residual& residual, const Vector3d& x) {
  const double focal_length = residual.A.norm() / std::sqrt(2.0);
  return std::hypot(residual.Depth(x),
                    residual.Numerator(x).norm() / focal_length);
}

}  // namespace

void LocalModel::Start(const Vector3d& x_start) {
  x_start_ = x_start;
  depth_start_ = 0;
  members_.clear();
  rows_.Clear();
  num_members_of_metric_ = 0;
  solution_.size = 0;
}

void LocalModel::AddMember(const ResidualSet& residuals, int index) {
  rows_.AddFrom(residuals, index);
  members_.push_back({index, 0, 0, 0});
  depth_start_ =
      std::max(depth_start_, rows_.Depth(rows_.size() - 1, x_start_));
}

void LocalModel::Linearize(const Vector3d& x, double cost, Norm norm) {
  x_ = x;
  norm_ = norm;
  pieces_.assign(1, {});
  member_of_piece_.assign(1, -1);
  if (norm.p == 2) {
    AddSmoothPieces();
  } else {
    AddPieces();
  }
  if (!IsMetricGood(cost)) SetMetric(cost);
  // The warm start of the next step must not refer to tangents, which are gone.
  const int num_pieces = static_cast<int>(pieces_.size());
  for (int k = 0; k < solution_.size; ++k) {
    if (solution_.index[k] >= num_pieces) solution_.size = 0;
  }
}

// One piece per member, eight at a time.
void LocalModel::AddSmoothPieces() {
  gradients_.resize(rows_.num_blocks());
  best_residual_kernels.evaluate_gradients(rows_.blocks(), rows_.num_blocks(),
                                           x_.data(), gradients_.data());
  pieces_.resize(members_.size() + 1);
  member_of_piece_.resize(members_.size() + 1);
  for (size_t m = 0; m < members_.size(); ++m) {
    const GradientBlock& block = gradients_[m / kLanes];
    const size_t lane = m % kLanes;
    pieces_[m + 1].value = block.value[lane];
    for (int j = 0; j < 3; ++j) {
      pieces_[m + 1].gradient[j] = block.gradient[j][lane];
    }
    member_of_piece_[m + 1] = static_cast<int>(m);
    members_[m].depth = block.depth[lane];
  }
}

void LocalModel::AddPieces() {
  for (size_t m = 0; m < members_.size(); ++m) {
    const Residual residual = rows_[static_cast<int>(m)];
    ResidualPiece pieces[kMaxPieces];
    const int count = ResidualPieces(residual, x_, norm_, /*share=*/-1, pieces);
    for (int k = 0; k < count; ++k) {
      pieces_.push_back({pieces[k].value, pieces[k].gradient});
      member_of_piece_.push_back(static_cast<int>(m));
    }
    members_[m].depth = residual.Depth(x_);
  }
}

// Whether G was set for the same members and so near x that, as measured by G
// itself, neither residuals nor depths have changed much.
bool LocalModel::IsMetricGood(double cost) const {
  if (num_members_of_metric_ != members_.size()) return false;
  const Vector3d d = x_ - x_metric_;
  return d.dot(metric_ * d) <= kMetricReach * cost;
}

void LocalModel::SetMetric(double cost) {
  double sums[6];
  best_residual_kernels.sum_metric(rows_.blocks(), rows_.num_blocks(),
                                   x_.data(), cost, sums);
  metric_ << sums[0], sums[1], sums[2],  //
      sums[1], sums[3], sums[4],         //
      sums[2], sums[4], sums[5];
  metric_ /= cost * static_cast<double>(members_.size());
  x_metric_ = x_;
  num_members_of_metric_ = members_.size();
}

// c_i and b_i of the member m.
LocalModel::Bend LocalModel::BendOf(size_t m) const {
  if (norm_.p == 2) {
    const GradientBlock& block = gradients_[m / kLanes];
    const size_t lane = m % kLanes;
    return {block.curvature[lane],
            {block.bend[0][lane], block.bend[1][lane], block.bend[2][lane]}};
  }
  ResidualPiece piece;
  ResidualPieces(rows_[static_cast<int>(m)], x_, norm_, /*share=*/1, &piece);
  return {piece.curvature, piece.bend};
}

// The lower triangle of H = sum_i mu_i c_i b_i b_i' + kappa G.
Matrix3d LocalModel::Hessian(double kappa) const {
  Matrix3d sum = kappa * metric_;
  if (norm_.IsPolyhedral()) return sum;  // flat pieces
  for (size_t m = 0; m < members_.size(); ++m) {
    const double multiplier = members_[m].multiplier;
    if (!(multiplier > 0)) continue;
    const Bend bend = BendOf(m);
    const Vector3d& b = bend.direction;
    const Vector3d weighted = multiplier * bend.curvature * b;
    for (int j = 0; j < 3; ++j) {
      for (int i = j; i < 3; ++i) sum(i, j) += weighted[i] * b[j];
    }
  }
  return sum;
}

LocalModel::Step LocalModel::Minimize(double kappa) {
  // With H = L L', the step in L'd has unit curvature.
  const Matrix3d H = Hessian(kappa);
  Matrix3d L_inverse;
  InvertCholesky(H, kPivotRounding * H.trace(), &L_inverse);
  scaled_pieces_.resize(pieces_.size());
  for (size_t k = 0; k < pieces_.size(); ++k) {
    scaled_pieces_[k].value = pieces_[k].value;
    scaled_pieces_[k].gradient = L_inverse * pieces_[k].gradient;
  }
  SolveSimplexQp(scaled_pieces_.data(), static_cast<int>(scaled_pieces_.size()),
                 &solution_);
  return {L_inverse.transpose() * solution_.step, solution_.level,
          solution_.step.squaredNorm()};
}

// Sets the last multipliers of the residuals, with sum 1. The zero piece is
// left out, as it has no weight at a positive optimum. False if it has all the
// weight.
bool LocalModel::UpdateLastMultipliers() {
  double sum = 0;
  for (int k = 0; k < solution_.size; ++k) {
    if (solution_.index[k] != kZeroPiece) sum += solution_.weight[k];
  }
  if (!(sum > kSmallestWeight)) return false;
  for (Member& member : members_) member.last_multiplier = 0;
  for (int k = 0; k < solution_.size; ++k) {
    if (solution_.index[k] == kZeroPiece) continue;
    members_[member_of_piece_[solution_.index[k]]].last_multiplier +=
        solution_.weight[k] / sum;
  }
  return true;
}

void LocalModel::StartFrom(const ActiveResiduals& active) {
  double sum = 0;
  for (int k = 0; k < active.size; ++k) sum += active.multiplier[k];
  for (int k = 0; k < active.size; ++k) {
    const int m = FindMember(active.index[k]);
    members_[m].multiplier = active.multiplier[k] / sum;
    if (norm_.IsPolyhedral()) continue;  // its active piece is not known
    solution_.index[k] = m + 1;
    solution_.weight[k] = members_[m].multiplier;
    solution_.size = k + 1;
  }
}

int LocalModel::FindMember(int index) const {
  int m = 0;
  while (members_[m].index != index) ++m;
  return m;
}

ActiveResiduals LocalModel::Active() {
  ActiveResiduals active;
  if (!UpdateLastMultipliers()) return active;
  for (const Member& member : members_) {
    if (!(member.last_multiplier > 0)) continue;
    active.index[active.size] = member.index;
    active.multiplier[active.size] = static_cast<float>(member.last_multiplier);
    ++active.size;
  }
  return active;
}

void LocalModel::AdoptMultipliers() {
  if (!UpdateLastMultipliers()) return;
  for (Member& member : members_) member.multiplier = member.last_multiplier;
}

bool LocalModel::RaiseMultipliers() {
  if (!UpdateLastMultipliers()) return false;
  bool grown = false;
  for (Member& member : members_) {
    grown |=
        member.last_multiplier > kMuchGrowth * member.multiplier + kLeastGrowth;
    member.multiplier = std::max(member.multiplier, member.last_multiplier);
  }
  return grown;
}

bool LocalModel::AddTangents(const Vector3d& x_trial,
                             const double* trial_values, double level) {
  if (norm_.IsPolyhedral()) return false;  // all planes are pieces already
  bool added = false;
  for (size_t m = 0; m < members_.size(); ++m) {
    const double value = trial_values[members_[m].index];
    if (!(value > level) || !std::isfinite(value)) continue;
    const ResidualPiece tangent =
        TangentPiece(rows_[static_cast<int>(m)], x_, x_trial, norm_);
    pieces_.push_back({tangent.value, tangent.gradient});
    member_of_piece_.push_back(static_cast<int>(m));
    added = true;
  }
  return added;
}

// If all depths fall by the same share f, a residual changes by the step
// d / (1 + f) as much as its linearisation does by d.
double LocalModel::ShareOf(const Vector3d& d) const {
  const Vector3d longer = (kLargestFall / kSmallFall) * d;
  const double share = best_residual_kernels.depth_share(
      rows_.blocks(), rows_.num_blocks(), x_.data(), longer.data());
  if (share == 1) return 1;
  const double fall = kSmallFall / share;
  return std::min(1 / (1 + fall), kLargestFall / fall);
}

double LocalModel::DepthGrowth() const {
  double depth = 0;
  for (int k = 0; k < solution_.size; ++k) {
    if (solution_.index[k] == kZeroPiece) continue;
    depth =
        std::max(depth, members_[member_of_piece_[solution_.index[k]]].depth);
  }
  // Depths are at hand, and a distance is at least the depth.
  if (depth <= kNearby * depth_start_) return depth / depth_start_;
  double distance = 0;
  for (int m = 0; m < rows_.size(); ++m) {
    distance = std::max(distance, DistanceFromCamera(rows_[m], x_start_));
  }
  return depth / distance;
}

}  // namespace krot::internal
