#include "krot/conic/incomplete_cholesky.h"

#include <algorithm>
#include <cmath>

namespace krot {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix3f;
using Eigen::VectorXf;

// Blocks kept of a column, by those that A has below the diagonal there. More
// take more time than they save in iterations (docs/history/scale.md).
constexpr double kKept = 0.5;
// Shifts: the first, its growth, and where it is given up.
constexpr float kFirstShift = 1e-5F;
constexpr float kShiftGrowth = 10;
constexpr float kLargestShift = 10;
// The least pivot, squared, of a block whose diagonal is about 1.
constexpr float kSmallestPivot = 1e-7F;

// With that of the diagonal.
int64_t NumKept(int64_t num_blocks) {
  return 1 + std::llround(kKept * static_cast<double>(num_blocks - 1));
}

// L^-1 of A = L L'; false if there is none to speak of.
bool InvertFactor(const Matrix3f& A, Matrix3f* inverse) {
  const auto is_small = [](float squared) {
    return !(squared > kSmallestPivot);
  };
  if (is_small(A(0, 0))) return false;
  const float i00 = 1 / std::sqrt(A(0, 0));
  const float l10 = A(1, 0) * i00;
  const float l20 = A(2, 0) * i00;
  const float p1 = A(1, 1) - l10 * l10;
  if (is_small(p1)) return false;
  const float i11 = 1 / std::sqrt(p1);
  const float l21 = (A(2, 1) - l20 * l10) * i11;
  const float p2 = A(2, 2) - l20 * l20 - l21 * l21;
  if (is_small(p2)) return false;
  const float i22 = 1 / std::sqrt(p2);
  const float i10 = -l10 * i00 * i11;
  *inverse << i00, 0, 0,  //
      i10, i11, 0,        //
      -(l20 * i00 + l21 * i10) * i22, -l21 * i11 * i22, i22;
  return true;
}

}  // namespace

bool IncompleteCholesky::Factorize(const BlockPattern& pattern,
                                   const std::vector<Matrix3d>& blocks) {
  // What helped last time, if anything was needed, or a little less.
  float shift = shift_ > kFirstShift ? shift_ / kShiftGrowth : 0;
  while (!TryShift(pattern, blocks, shift)) {
    shift = std::max(kShiftGrowth * shift, kFirstShift);
    if (shift > kLargestShift) return false;
  }
  shift_ = shift;
  return true;
}

// Column after column takes what those before have in its row.
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
    if (!InvertFactor(column_[0].value, &inverse)) return false;
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

// Of the column at hand, the diagonal's and the largest others, by rows.
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

int64_t IncompleteCholesky::MemoryBytes(const BlockPattern& pattern) {
  constexpr int64_t kPerColumn = 2 * sizeof(Block) + 64;
  int64_t num_blocks = 0;
  for (int32_t j = 0; j < pattern.num_columns(); ++j) {
    num_blocks += NumKept(pattern.begin[j + 1] - pattern.begin[j]);
  }
  return num_blocks * static_cast<int64_t>(sizeof(Block)) +
         pattern.num_columns() * kPerColumn;
}

}  // namespace krot
