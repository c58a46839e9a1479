#include "krot/linear/reduced_camera_system.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "krot/base/parallel_for.h"
#include "krot/linear/blocks.h"

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix3f;
using Eigen::Vector3d;
using Eigen::VectorXd;
using Eigen::VectorXf;

// The first shift if no factor exists without one. It is multiplied by
// kShiftGrowth up to a shift of kShiftGrowth.
constexpr float kFirstShift = 1e-5F;
constexpr float kShiftGrowth = 10;

// The number of blocks that a column of the factor keeps, with the diagonal
// block, if A's has `num_blocks`: half of those below the diagonal. More would
// cost more time than they save in iterations (docs/history/scale.md).
int64_t NumKept(int64_t num_blocks) {
  return 1 + std::llround(0.5 * static_cast<double>(num_blocks - 1));
}

}  // namespace

bool IncompleteCholesky::Factorize(const BlockPattern& pattern,
                                   const std::vector<Matrix3d>& blocks) {
  // Begins with a tenth of the last shift, or without one if it was minimal.
  float shift = shift_ > kFirstShift ? shift_ / kShiftGrowth : 0;
  while (!TryShift(pattern, blocks, shift)) {
    shift = std::max(kShiftGrowth * shift, kFirstShift);
    if (shift > kShiftGrowth) return false;
  }
  shift_ = shift;
  return true;
}

// Computes the factor column by column. From each one, the products of all
// earlier columns with a block in its row are subtracted.
bool IncompleteCholesky::TryShift(const BlockPattern& pattern,
                                  const std::vector<Matrix3d>& blocks,
                                  float shift) {
  const int32_t num_columns = pattern.num_columns();
  begin_.assign(1, 0);
  L_.clear();
  place_.assign(num_columns, -1);
  next_.resize(num_columns);
  waiting_.assign(num_columns, {});
  for (int32_t j = 0; j < num_columns; ++j) {
    const int64_t begin = pattern.begin[j];
    const int64_t end = pattern.begin[j + 1];
    column_.clear();
    for (int64_t n = begin; n < end; ++n) {
      place_[pattern.row[n]] = static_cast<int32_t>(column_.size());
      column_.push_back({pattern.row[n], blocks[n].cast<float>()});
    }
    column_[0].value.diagonal().array() += shift;
    for (const int32_t k : waiting_[j]) SubtractColumn(k);
    waiting_[j] = {};
    for (const Block& block : column_) place_[block.row] = -1;
    Matrix3f inverse;
    // Diagonals are about 1.
    if (!InvertCholesky(column_[0].value, 1e-7F, &inverse)) return false;
    column_[0].value = inverse;
    for (size_t n = 1; n < column_.size(); ++n) {
      column_[n].value = (column_[n].value * inverse.transpose()).eval();
    }
    KeepLargest(NumKept(end - begin));
    next_[j] = begin_.back() + 1;
    L_.insert(L_.end(), column_.begin(), column_.end());
    begin_.push_back(static_cast<int64_t>(L_.size()));
    if (next_[j] < begin_.back()) waiting_[L_[next_[j]].row].push_back(j);
  }
  return true;
}

void IncompleteCholesky::SubtractColumn(int32_t k) {
  const int64_t first = next_[k]++;
  const int64_t end = begin_[k + 1];
  const Matrix3f transposed = L_[first].value.transpose();
  for (int64_t n = first; n < end; ++n) {
    int32_t& place = place_[L_[n].row];
    if (place < 0) {
      place = static_cast<int32_t>(column_.size());
      column_.push_back({L_[n].row, Matrix3f::Zero()});
    }
    column_[place].value.noalias() -= L_[n].value * transposed;
  }
  if (next_[k] < end) waiting_[L_[next_[k]].row].push_back(k);
}

// Keeps `count` blocks of the present column, the diagonal one and the largest
// others, and sorts them by row.
void IncompleteCholesky::KeepLargest(int64_t count) {
  if (count < static_cast<int64_t>(column_.size())) {
    std::nth_element(column_.begin() + 1, column_.begin() + count,
                     column_.end(), [](const Block& a, const Block& b) {
                       return a.value.squaredNorm() > b.value.squaredNorm();
                     });
    column_.resize(count);
  }
  std::sort(column_.begin() + 1, column_.end(),
            [](const Block& a, const Block& b) { return a.row < b.row; });
}

VectorXf IncompleteCholesky::Solve(const VectorXf& rhs) const {
  VectorXf x = rhs;
  const auto num_columns = static_cast<int32_t>(begin_.size()) - 1;
  for (int32_t j = 0; j < num_columns; ++j) {
    const Eigen::Vector3f own = L_[begin_[j]].value * x.segment<3>(3 * j);
    x.segment<3>(3 * j) = own;
    for (int64_t n = begin_[j] + 1; n < begin_[j + 1]; ++n) {
      x.segment<3>(3 * L_[n].row).noalias() -= L_[n].value * own;
    }
  }
  for (int32_t j = num_columns - 1; j >= 0; --j) {
    Eigen::Vector3f own = x.segment<3>(3 * j);
    for (int64_t n = begin_[j] + 1; n < begin_[j + 1]; ++n) {
      own.noalias() -= L_[n].value.transpose() * x.segment<3>(3 * L_[n].row);
    }
    x.segment<3>(3 * j) = L_[begin_[j]].value.transpose() * own;
  }
  return x;
}

double IncompleteCholesky::Operations(const BlockPattern& pattern) {
  double pairs = 0;
  for (int32_t j = 0; j < pattern.num_columns(); ++j) {
    const auto kept =
        static_cast<double>(NumKept(pattern.begin[j + 1] - pattern.begin[j]));
    pairs += kept * kept / 2;
  }
  return 27 * pairs;
}

bool ConjugateGradients::Factorize(const BlockPattern& pattern,
                                   std::vector<Matrix3d> blocks,
                                   int num_threads, bool has_factor) {
  pattern_ = &pattern;
  blocks_ = std::move(blocks);
  num_threads_ = num_threads;
  has_factor_ = has_factor;
  Whiten();
  return !has_factor || incomplete_.Factorize(pattern, blocks_);
}

// Replaces the blocks by those of W A W'. For a diagonal block of zeros, as of
// a frame without observations, W is 0.
void ConjugateGradients::Whiten() {
  W_.assign(pattern_->num_columns(), Matrix3d::Zero());
  for (int32_t j = 0; j < pattern_->num_columns(); ++j) {
    const Matrix3d& diagonal = blocks_[pattern_->begin[j]];
    const double least_pivot = 1e-14 * diagonal.trace();
    if (least_pivot > 0) InvertCholesky(diagonal, least_pivot, &W_[j]);
  }
  for (int32_t j = 0; j < pattern_->num_columns(); ++j) {
    for (int64_t n = pattern_->begin[j]; n < pattern_->begin[j + 1]; ++n) {
      blocks_[n] = W_[pattern_->row[n]] * blocks_[n] * W_[j].transpose();
    }
  }
}

VectorXd ConjugateGradients::Precondition(const VectorXd& residual) const {
  if (!has_factor_) return residual;
  // Scaled, as single precision has a small range of exponents.
  const double scale = residual.cwiseAbs().maxCoeff();
  if (!(scale > 0)) return VectorXd::Zero(residual.size());
  const VectorXf scaled = (residual / scale).cast<float>();
  return scale * incomplete_.Solve(scaled).cast<double>();
}

VectorXd ConjugateGradients::MultiplyBlocks(const VectorXd& x) const {
  const int64_t columns_per_chunk = NumChunks(pattern_->num_columns(), 4);
  std::vector<VectorXd> parts(
      NumChunks(pattern_->num_columns(), columns_per_chunk),
      VectorXd::Zero(x.size()));
  ParallelFor(pattern_->num_columns(), columns_per_chunk, num_threads_,
              [&](int64_t first, int64_t end, int) {
                VectorXd& y = parts[first / columns_per_chunk];
                for (int64_t j = first; j < end; ++j) {
                  const Vector3d x_j = x.segment<3>(3 * j);
                  Vector3d y_j = blocks_[pattern_->begin[j]] * x_j;
                  for (int64_t n = pattern_->begin[j] + 1;
                       n < pattern_->begin[j + 1]; ++n) {
                    const int64_t row = 3 * int64_t{pattern_->row[n]};
                    y.segment<3>(row).noalias() += blocks_[n] * x_j;
                    y_j.noalias() += blocks_[n].transpose() * x.segment<3>(row);
                  }
                  y.segment<3>(3 * j) += y_j;
                }
              });
  for (size_t chunk = 1; chunk < parts.size(); ++chunk) {
    parts[0] += parts[chunk];
  }
  return parts[0];
}

VectorXd ConjugateGradients::Whitened(const VectorXd& x) const {
  VectorXd y(x.size());
  for (int64_t k = 0; k < x.size(); k += 3) {
    y.segment<3>(k) = W_[k / 3] * x.segment<3>(k);
  }
  return y;
}

VectorXd ConjugateGradients::Unwhitened(const VectorXd& y) const {
  VectorXd x(y.size());
  for (int64_t k = 0; k < y.size(); k += 3) {
    x.segment<3>(k) = W_[k / 3].transpose() * y.segment<3>(k);
  }
  return x;
}

// Starts at y = 0. With the preconditioner M, |error|_A^2 = r'A^-1 r is about
// r'M r.
bool ConjugateGradients::Solve(const VectorXd& rhs, double tolerance,
                               VectorXd* x, int max_iterations,
                               const Multiply& other_blocks) {
  VectorXd residual = Whitened(rhs);
  VectorXd y = VectorXd::Zero(rhs.size());
  VectorXd preconditioned = Precondition(residual);
  VectorXd direction = preconditioned;
  double error = residual.dot(preconditioned);
  const double end = tolerance * tolerance * error;
  num_iterations_ = 0;
  while (error > end && num_iterations_ < max_iterations) {
    VectorXd image = MultiplyBlocks(direction);
    if (other_blocks) image += Whitened(other_blocks(Unwhitened(direction)));
    const double curvature = direction.dot(image);
    if (!(curvature > 0)) break;  // rounding
    const double step = error / curvature;
    y += step * direction;
    const VectorXd change = -step * image;
    residual += change;
    preconditioned = Precondition(residual);
    direction = preconditioned + change.dot(preconditioned) / error * direction;
    error = residual.dot(preconditioned);
    ++num_iterations_;
  }
  *x = Unwhitened(y);
  return num_iterations_ < max_iterations;
}

}  // namespace krot::internal
