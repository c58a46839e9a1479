#include "krot/conic/frame_system.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "krot/base/parallel_for.h"
#include "krot/conic/block_update.h"

namespace krot {
namespace {

// Relative to the diagonal. Refinement removes the error it causes.
constexpr double kRegularization = 1e-14;
constexpr double kLargestRegularization = 1e-7;
// Up to here a dense factor is the fastest way whatever the pattern.
constexpr int64_t kAlwaysDenseFrames = 500;
// Parts of the sum, and so the threads that can eliminate points; fewer where
// each may be large: of 10,000 frames that share points without order, 300 MB.
constexpr int kNumParts = 4;
constexpr int kNumLargeParts = 2;
constexpr int64_t kLargeFrames = 1500;

// Of a factor that is not filled at all; most patterns need no closer look. A
// column of c blocks takes 27 c^2, and these are least where all are alike.
double LeastSparseOperations(const BlockPattern& pattern) {
  const auto num_blocks = static_cast<double>(pattern.num_blocks());
  return 27 * num_blocks * num_blocks / pattern.num_columns();
}

// Of a column, what stands in blocks of the lower triangle: nothing else is
// written.
template <typename Matrix>
auto LowerBlocks(int64_t column, Matrix* matrix) {
  return matrix->col(column).tail(matrix->rows() - column / 3 * 3);
}

}  // namespace

FrameSystem::FrameSystem(const BlockStructure& structure, Ranks* ranks)
    : column_of_frame_(structure.num_frames(), -1) {
  int64_t num_free = 0;
  for (int64_t f = 0; f < structure.num_frames(); ++f) {
    if (structure.frame_is_fixed[f]) continue;
    column_of_frame_[f] = static_cast<int32_t>(3 * num_free++);
  }
  num_columns_ = 3 * num_free;
  num_parts_ = num_free > kLargeFrames ? kNumLargeParts : kNumParts;
  if (num_free <= kAlwaysDenseFrames) {
    dense_.resize(num_parts_);
    return;
  }
  FramePattern pattern = FindFramePattern(structure);
  UniteOverRanks(ranks, &pattern);
  TakePattern(pattern);
  values_.resize(num_parts_);
  const double cost = PreconditionedSystem::Cost(pattern_);
  if (kSparseOperation * LeastSparseOperations(pattern_) < cost) {
    const SparseFactorSize factor = FindSparseFactorSize(pattern);
    if (kSparseOperation * factor.operations < cost &&
        factor.numbers <= std::numeric_limits<int>::max()) {  // Eigen's indices
      kind_ = Kind::kSparse;
      num_factor_numbers_ = factor.numbers;
      return;
    }
  }
  kind_ = Kind::kPreconditioned;
  preconditioned_ = std::make_unique<PreconditionedSystem>(pattern_);
}

void FrameSystem::TakePattern(const FramePattern& pattern) {
  for (const std::vector<int32_t>& rows : pattern) {
    pattern_.row.insert(pattern_.row.end(), rows.begin(), rows.end());
    pattern_.begin.push_back(pattern_.num_blocks());
  }
}

FrameSystem::Block FrameSystem::BlockOf(int part, int32_t a, int32_t b) {
  const int32_t row = column(a);
  const int32_t col = column(b);
  if (is_dense()) return {&dense_[part](row, col), num_columns_};
  const int64_t begin = pattern_.begin[col / 3];
  const int64_t end = pattern_.begin[col / 3 + 1];
  // Where a column has no gaps, as in a band: no search.
  int64_t n = (row - col) / 3;
  if (n >= end - begin || pattern_.row[begin + n] != row / 3) {
    n = std::lower_bound(pattern_.row.begin() + begin,
                         pattern_.row.begin() + end, row / 3) -
        pattern_.row.begin() - begin;
  }
  return {values_[part].data() + 9 * begin + 3 * n, 3 * (end - begin)};
}

void FrameSystem::SetZero() {
  for (int part = 0; part < num_parts_; ++part) SetZero(part);
}

void FrameSystem::SetZero(int part) {
  if (!is_dense()) {
    values_[part].assign(9 * pattern_.row.size(), 0.0);
    return;
  }
  dense_[part].resize(num_columns_, num_columns_);
  for (int64_t c = 0; c < num_columns_; ++c) {
    LowerBlocks(c, &dense_[part]).setZero();
  }
}

std::vector<double> FrameSystem::Part(int part) const {
  if (!is_dense()) return values_[part];
  std::vector<double> numbers;
  for (int64_t c = 0; c < num_columns_; ++c) {
    const auto column = LowerBlocks(c, &dense_[part]);
    numbers.insert(numbers.end(), column.data(), column.data() + column.size());
  }
  return numbers;
}

void FrameSystem::SetPart(int part, const std::vector<double>& numbers) {
  if (!is_dense()) {
    values_[part] = numbers;
    return;
  }
  dense_[part].resize(num_columns_, num_columns_);
  const double* next = numbers.data();
  for (int64_t c = 0; c < num_columns_; ++c) {
    auto column = LowerBlocks(c, &dense_[part]);
    std::copy_n(next, column.size(), column.data());
    next += column.size();
  }
}

void FrameSystem::AddBlock(int part, int32_t a, int32_t b,
                           const double block[9]) {
  const Block target = BlockOf(part, a, b);
  for (int c = 0; c < 3; ++c) {
    for (int r = 0; r < 3; ++r) {
      target.first[c * target.stride + r] += block[3 * c + r];
    }
  }
}

// By runs of frames that follow each other: there the rows do, too.
void FrameSystem::SubtractSquare(int part, const std::vector<int32_t>& frames,
                                 const std::vector<char>& is_apart,
                                 const double* const G[3]) {
  const size_t n = frames.size();
  for (size_t b = 0; b < n; ++b) {
    double S[9];
    for (int r = 0; r < 3; ++r) std::copy_n(G[r] + 3 * b, 3, S + 3 * r);
    for (size_t begin = b; begin < n;) {
      if (is_apart[b] && is_apart[begin]) {
        ++begin;
        continue;
      }
      size_t end = begin + 1;
      while (end < n && column(frames[end]) == column(frames[end - 1]) + 3 &&
             !(is_apart[b] && is_apart[end])) {
        ++end;
      }
      const Block target = BlockOf(part, frames[begin], frames[b]);
      const double* const rows[3] = {G[0] + 3 * begin, G[1] + 3 * begin,
                                     G[2] + 3 * begin};
      SubtractFromColumns(rows, S, 3 * static_cast<int64_t>(end - begin),
                          target.first, target.stride);
      begin = end;
    }
  }
}

void FrameSystem::SumDense(int num_threads) {
  ParallelFor(num_columns_, 64, num_threads,
              [&](int64_t begin, int64_t end, int) {
                for (int part = 1; part < num_parts_; ++part) {
                  for (int64_t c = begin; c < end; ++c) {
                    LowerBlocks(c, &dense_[0]) += LowerBlocks(c, &dense_[part]);
                  }
                }
              });
}

void FrameSystem::SumSparse() {
  using Index = Eigen::SparseMatrix<double>::StorageIndex;
  sparse_.resize(num_columns_, num_columns_);
  sparse_.resizeNonZeros(static_cast<Index>(9 * pattern_.num_blocks()));
  Index entry = 0;
  for (int64_t column = 0; column < num_columns_; ++column) {
    sparse_.outerIndexPtr()[column] = entry;
    for (int64_t n = pattern_.begin[column / 3];
         n < pattern_.begin[column / 3 + 1]; ++n) {
      for (int r = 0; r < 3; ++r, ++entry) {
        double sum = 0;
        for (int part = 0; part < num_parts_; ++part) {
          sum += values_[part][entry];
        }
        sparse_.innerIndexPtr()[entry] =
            static_cast<Index>(3 * pattern_.row[n] + r);
        sparse_.valuePtr()[entry] = sum;
      }
    }
  }
  sparse_.outerIndexPtr()[num_columns_] = entry;
}

std::vector<Eigen::Matrix3d> FrameSystem::SumBlocks() const {
  std::vector<Eigen::Matrix3d> blocks;
  blocks.reserve(pattern_.num_blocks());
  for (int32_t j = 0; j < pattern_.num_columns(); ++j) {
    const int64_t begin = pattern_.begin[j];
    const int64_t count = pattern_.begin[j + 1] - begin;
    for (int64_t n = 0; n < count; ++n) {
      blocks.emplace_back(Eigen::Matrix3d::Zero());
      for (const std::vector<double>& values : values_) {
        blocks.back() +=
            Eigen::Map<const Eigen::Matrix3d, 0, Eigen::OuterStride<>>(
                &values[9 * begin + 3 * n], Eigen::OuterStride<>(3 * count));
      }
    }
  }
  return blocks;
}

bool FrameSystem::Factorize(int num_threads) {
  if (preconditioned_) {
    return preconditioned_->Factorize(SumBlocks(), num_threads);
  }
  if (is_dense()) {
    SumDense(num_threads);
  } else {
    SumSparse();
    if (!std::exchange(is_analyzed_, true)) {
      sparse_factor_.analyzePattern(sparse_);
    }
  }
  return FactorizeRegularized(num_threads);
}

bool FrameSystem::FactorizeRegularized(int num_threads) {
  constexpr double kTiny = std::numeric_limits<double>::min();
  for (double regularization = kRegularization;
       regularization < kLargestRegularization; regularization *= 100) {
    if (is_dense()) {
      dense_[0].diagonal() *= 1 + regularization;
      dense_[0].diagonal().array() += kTiny;
      if (dense_factor_.Factorize(dense_[0], num_threads)) return true;
    } else {
      for (int64_t column = 0; column < num_columns_; ++column) {
        double& diagonal = sparse_.coeffRef(column, column);
        diagonal = diagonal * (1 + regularization) + kTiny;
      }
      sparse_factor_.factorize(sparse_);
      if (sparse_factor_.info() == Eigen::Success) return true;
    }
  }
  return false;
}

Eigen::VectorXd FrameSystem::Solve(const Eigen::VectorXd& rhs,
                                   double tolerance) const {
  if (num_columns_ == 0) return rhs;
  if (preconditioned_) return preconditioned_->Solve(rhs, tolerance);
  return is_dense() ? dense_factor_.Solve(rhs)
                    : Eigen::VectorXd(sparse_factor_.solve(rhs));
}

int64_t FrameSystem::MemoryBytes() const {
  constexpr int64_t kDouble = sizeof(double);
  if (is_dense()) {
    return num_parts_ * num_columns_ * num_columns_ * kDouble +
           DenseCholesky<double>::MemoryBytes(num_columns_);
  }
  const int64_t num_numbers = 9 * pattern_.num_blocks();
  const int64_t in_parts = num_parts_ * num_numbers * kDouble;
  if (preconditioned_) {
    return in_parts + PreconditionedSystem::MemoryBytes(pattern_);
  }
  constexpr int64_t kSparseNumber = sizeof(double) + sizeof(int32_t);
  return in_parts + (2 * num_numbers + num_factor_numbers_) * kSparseNumber;
}

}  // namespace krot
