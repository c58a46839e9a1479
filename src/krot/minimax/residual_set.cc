#include "krot/minimax/residual_set.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "krot/base/system.h"

namespace krot::internal {

KROT_DECLARE_KERNELS(ResidualKernels, kResidualKernels)
KROT_DECLARE_KERNELS(LaneKernels, kLaneKernels)

const ResidualKernels& best_residual_kernels =
    KROT_BEST_KERNELS(kResidualKernels);
const LaneKernels& best_lane_kernels = KROT_BEST_KERNELS(kLaneKernels);

namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// The four signed sums whose maximum is ||v||_p, p = 1 or infinity.
void PolyhedralSigns(Norm norm, Vector2d signs[4]) {
  if (norm.p == 1) {
    signs[0] = {1, 1};
    signs[1] = {1, -1};
    signs[2] = {-1, 1};
    signs[3] = {-1, -1};
  } else {
    signs[0] = {1, 0};
    signs[1] = {-1, 0};
    signs[2] = {0, 1};
    signs[3] = {0, -1};
  }
}

// The gradient of ||v||_p, v != 0, and the trace of its (rank one) Hessian.
void DifferentiateNorm(const Vector2d& v, Norm norm, double n,
                       Vector2d* gradient, double* trace) {
  if (norm.p == 2) {
    *gradient = v / n;
    *trace = 1 / n;
    return;
  }
  const double p = norm.p;
  *trace = 0;
  for (int k = 0; k < 2; ++k) {
    const double ratio = std::abs(v[k]) / n;  // in [0, 1]
    (*gradient)[k] = std::copysign(std::pow(ratio, p - 1), v[k]);
    // For p < 2 the curvature is unbounded near the axes.
    const double bent = std::pow(std::max(ratio, 1e-6), p - 2);
    *trace += (p - 1) / n * (bent - std::pow(ratio, 2 * p - 2));
  }
  *trace = std::max(*trace, 0.0);
}

}  // namespace

int ResidualPieces(const Residual& residual, const Vector3d& x, Norm norm,
                   double share, ResidualPiece pieces[kMaxPieces]) {
  const Vector2d v = residual.Numerator(x);
  const double w = residual.Depth(x);
  const double n = NormOf(v, norm);
  if (!(n > 0)) {
    pieces[0] = {};
    return 1;
  }
  if (!norm.IsPolyhedral()) {
    ResidualPiece& piece = pieces[0];
    Vector2d s;
    double trace;
    DifferentiateNorm(v, norm, n, &s, &trace);
    piece.value = n / w;
    piece.gradient =
        (residual.A.transpose() * s - piece.value * residual.c) / w;
    piece.curvature = trace / w;
    piece.bend = residual.A.transpose() * Vector2d(-v[1], v[0]) / v.norm();
    return 1;
  }
  Vector2d signs[4];
  PolyhedralSigns(norm, signs);
  int count = 0;
  for (const Vector2d& s : signs) {
    const double value = s.dot(v) / w;
    if (value < share * n / w) continue;
    ResidualPiece& piece = pieces[count++];
    piece.value = value;
    piece.gradient = (residual.A.transpose() * s - value * residual.c) / w;
    piece.curvature = 0;
    piece.bend.setZero();
  }
  return count;
}

ResidualPiece TangentPiece(const Residual& residual, const Vector3d& x,
                           const Vector3d& x_touch, Norm norm) {
  const Vector2d v_touch = residual.Numerator(x_touch);
  const double n_touch = NormOf(v_touch, norm);
  ResidualPiece piece;
  if (!(n_touch > 0)) return piece;
  Vector2d s;
  double trace;
  DifferentiateNorm(v_touch, norm, n_touch, &s, &trace);
  const double w = residual.Depth(x);
  piece.value = s.dot(residual.Numerator(x)) / w;
  piece.gradient = (residual.A.transpose() * s - piece.value * residual.c) / w;
  return piece;
}

// Adds a block whose lanes all hold r = 0 / 1.
void ResidualSet::AddBlock() {
  const size_t block = size_ / kLanes;
  if (block == blocks_.size()) {
    blocks_.emplace_back();
    values_.resize(values_.size() + kLanes);
  }
  blocks_[block] = {};
  for (double& d : blocks_[block].row[11]) d = 1;
}

void ResidualSet::AddFrom(const ResidualSet& other, int i) {
  double row[kResidualRow];
  const ResidualBlock& block = other.blocks_[i / kLanes];
  for (int k = 0; k < kResidualRow; ++k) {
    row[k] = block.row[k][i % kLanes];
  }
  Add(row);
}

double ResidualSet::Evaluate(const Eigen::Vector3d& x, Norm norm) {
  return best_residual_kernels.evaluate_residuals(
      blocks_.data(), num_blocks(), norm.p, x.data(), values_.data());
}

}  // namespace krot::internal

namespace krot {

using namespace internal;

double ResidualValue(const Residual& residual, const Vector3d& x, Norm norm) {
  const double w = residual.Depth(x);
  if (!(w > 0)) return std::numeric_limits<double>::infinity();
  return NormOf(residual.Numerator(x), norm) / w;  // (2)
}

}  // namespace krot
