#include "krot/minimax/local_model.h"

#include <algorithm>
#include <cmath>

namespace krot {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr int kZeroPiece = 0;
constexpr int kNoMember = -1;
// Weights that the residuals bear together below this are rounding.
constexpr double kSmallestWeight = 1e-9;
// See DepthShare.
constexpr double kSmallestDepthShare = 0.1;
// Keeps H invertible where rounding would not: relative to its trace.
constexpr double kRounding = 1e-14;

// The inverse of the Cholesky factor L of H = L L'.
Matrix3d InverseCholesky(const Matrix3d& H) {
  const double l00 = std::sqrt(H(0, 0));
  const double l10 = H(1, 0) / l00;
  const double l20 = H(2, 0) / l00;
  const double floor = kRounding * H.trace();
  const double l11 = std::sqrt(std::max(H(1, 1) - l10 * l10, floor));
  const double l21 = (H(2, 1) - l20 * l10) / l11;
  const double l22 =
      std::sqrt(std::max(H(2, 2) - l20 * l20 - l21 * l21, floor));
  Matrix3d inverse;
  const double i10 = -l10 / (l00 * l11);
  inverse << 1 / l00, 0, 0,  //
      i10, 1 / l11, 0,       //
      -(l20 / l00 + l21 * i10) / l22, -l21 / (l11 * l22), 1 / l22;
  return inverse;
}

}  // namespace

void LocalModel::Clear() {
  members_.clear();
  solution_.size = 0;
}

void LocalModel::AddMember(int index, const Residual& residual,
                           double start_depth) {
  members_.push_back({index, residual, start_depth, 0, 0});
}

void LocalModel::Linearize(const Vector3d& x, double cost, Norm norm) {
  pieces_.assign(1, {});
  member_of_piece_.assign(1, kNoMember);
  metric_.setZero();
  for (size_t m = 0; m < members_.size(); ++m) {
    const Residual& residual = members_[m].residual;
    ResidualPiece pieces[kMaxPieces];
    const int count = ResidualPieces(residual, x, norm, /*share=*/-1, pieces);
    for (int k = 0; k < count; ++k) {
      pieces_.push_back(pieces[k]);
      member_of_piece_.push_back(static_cast<int>(m));
    }
    const double w = residual.Depth(x);
    const Vector3d growth = cost / w * residual.c;
    metric_ += residual.A.transpose() * (residual.A / (w * w)) +
               growth * growth.transpose();
  }
  metric_ /= cost * static_cast<double>(members_.size());
  // A warm start of the next step must not name tangents that are gone.
  const int num_pieces = static_cast<int>(pieces_.size());
  for (int k = 0; k < solution_.size; ++k) {
    if (solution_.index[k] >= num_pieces) solution_.size = 0;
  }
}

LocalModel::Step LocalModel::Minimize(double kappa) {
  Matrix3d H = kappa * metric_;
  for (size_t k = 1; k < pieces_.size(); ++k) {
    const ResidualPiece& piece = pieces_[k];
    const double weight =
        members_[member_of_piece_[k]].multiplier * piece.curvature;
    if (weight > 0) H += weight * piece.bend * piece.bend.transpose();
  }
  // With H = L L', the step in L'd has unit curvature.
  const Matrix3d L_inverse = InverseCholesky(H);
  scaled_pieces_.resize(pieces_.size());
  for (size_t k = 0; k < pieces_.size(); ++k) {
    scaled_pieces_[k].value = pieces_[k].value;
    scaled_pieces_[k].gradient = L_inverse * pieces_[k].gradient;
  }
  SolveSimplexQp(scaled_pieces_.data(), static_cast<int>(scaled_pieces_.size()),
                 &solution_);
  return {L_inverse.transpose() * solution_.step, solution_.level};
}

// Over the residuals alone and with sum 1: at a positive optimum the zero
// piece bears none. False if the zero piece bears all.
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

void LocalModel::AdoptMultipliers() {
  if (!UpdateLastMultipliers()) return;
  for (Member& member : members_) member.multiplier = member.last_multiplier;
}

bool LocalModel::RaiseMultipliers() {
  if (!UpdateLastMultipliers()) return false;
  bool grown = false;
  for (Member& member : members_) {
    grown |= member.last_multiplier > 2 * member.multiplier + 1e-3;
    member.multiplier = std::max(member.multiplier, member.last_multiplier);
  }
  return grown;
}

bool LocalModel::AddTangents(const Vector3d& x, const Vector3d& x_trial,
                             const double* trial_values, double level,
                             Norm norm) {
  if (norm.IsPolyhedral()) return false;  // all its planes are pieces
  bool added = false;
  for (size_t m = 0; m < members_.size(); ++m) {
    const double value = trial_values[members_[m].index];
    if (!(value > level) || !std::isfinite(value)) continue;
    pieces_.push_back(TangentPiece(members_[m].residual, x, x_trial, norm));
    member_of_piece_.push_back(static_cast<int>(m));
    added = true;
  }
  return added;
}

double LocalModel::DepthShare(const Vector3d& x, const Vector3d& d) const {
  double share = 1;
  for (const Member& member : members_) {
    const double growth = member.residual.c.dot(d);
    const double room = (1 - kSmallestDepthShare) * member.residual.Depth(x);
    if (room < -share * growth) share = -room / growth;
  }
  return share;
}

double LocalModel::DepthGrowth(const Vector3d& x) const {
  double growth = 0;
  for (int k = 0; k < solution_.size; ++k) {
    if (solution_.index[k] == kZeroPiece) continue;
    const Member& member = members_[member_of_piece_[solution_.index[k]]];
    growth = std::max(growth, member.residual.Depth(x) / member.start_depth);
  }
  return growth;
}

}  // namespace krot
