#include "krot/linear/reduced_camera_system.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "krot/base/parallel_for.h"

namespace krot::internal {
namespace {

// The sum over points is taken in this many parts.
constexpr int kNumParts = 4;

// Costs that predict which kind takes the least time. The unit is the time of
// one operation of a dense factor. An operation of a sparse factor costs this
// much: 12 to 21 were measured with 800 to 3000 frames of many patterns, on one
// thread.
constexpr double kSparseOperation = 15;
// Reading a number of a matrix that is multiplied by a vector costs this.
constexpr double kNumberRead = 60;
// The number of systems solved with one factor of an interior point, including
// refinements.
constexpr double kSolves = 12;

// The cost of a sparse factor without fill, a lower bound. A column of c blocks
// takes 27 c^2 operations, and their sum is least if all columns are alike.
double LeastSparseCost(const BlockPattern& pattern) {
  const auto num_blocks = static_cast<double>(pattern.num_blocks());
  return kSparseOperation * 27 * num_blocks * num_blocks /
         pattern.num_columns();
}

BlockPattern DiagonalPattern(int32_t num_columns) {
  BlockPattern pattern;
  for (int32_t j = 0; j < num_columns; ++j) {
    pattern.row.push_back(j);
    pattern.begin.push_back(j + 1);
  }
  return pattern;
}

double Regularized(double diagonal, double regularization) {
  return diagonal * (1 + regularization) + std::numeric_limits<double>::min();
}

}  // namespace

ReducedCameraSystem::ReducedCameraSystem(const BlockStructure& structure,
                                         Ranks* ranks, Use use)
    : use_(use), column_of_frame_(structure.num_frames(), -1) {
  int32_t num_free = 0;
  for (int64_t f = 0; f < structure.num_frames(); ++f) {
    if (!structure.frame_is_fixed[f]) column_of_frame_[f] = 3 * num_free++;
  }
  num_columns_ = 3 * int64_t{num_free};
  parts_.resize(kNumParts);
  if (num_free <= 500) {  // a dense factor is fastest for all patterns
    pattern_ = FullPattern(num_free);
    return;
  }
  std::vector<double> counts(2, 0);  // whole numbers, so exact
  for (int64_t k = 0; k < structure.num_points(); ++k) {
    const auto m = static_cast<double>(structure.point_begin[k + 1] -
                                       structure.point_begin[k]);
    counts[0] += m;
    counts[1] += m * (m + 1) / 2;
  }
  if (ranks != nullptr) {
    ranks->Reduce([](double a, double b) { return a + b; }, &counts);
  }
  num_observations_ = counts[0];
  num_contributions_ = counts[1];
  pattern_ = PairsThatSharePoints(structure, ranks);
  kind_ = CheapestKind();
  if (kind_ == Kind::kImplicit) {
    pairs_ = std::exchange(pattern_, DiagonalPattern(num_free));
  }
}

double ReducedCameraSystem::DenseCost() const {
  const auto n = static_cast<double>(num_columns_);
  const double solves = use_ == Use::kRoughSolutions ? 1 : kSolves;
  return n * n * n / 3 + solves * kNumberRead * n * n / 2;
}

double ReducedCameraSystem::IterativeCost(int num_iterations) const {
  const double products = num_iterations * kNumberRead * 9 *
                          static_cast<double>(pattern_.num_blocks());
  return kSparseOperation * IncompleteCholesky::Operations(pattern_) +
         kSolves * products;
}

double ReducedCameraSystem::ImplicitCost(int num_iterations) const {
  return num_iterations * kNumberRead * 9 * num_observations_;
}

double ReducedCameraSystem::CostFormed(double cost) const {
  return cost + 3000 * num_contributions_;
}

// The size of a sparse factor is determined only where it may be the cheapest.
// For rough solutions a sparse factor is preferred to conjugate gradients: it
// is small for long chains of frames, where these, without a factor, take many
// iterations.
ReducedCameraSystem::Kind ReducedCameraSystem::CheapestKind() {
  const bool is_rough = use_ == Use::kRoughSolutions;
  const double dense = DenseCost();
  // The expected numbers of iterations: of all rough solutions of a matrix
  // together, or of one solution, where it grows from 30 to 200 and more on the
  // way to an optimum.
  const double iterative = is_rough ? ImplicitCost(60) : IterativeCost(100);
  const double cost = is_rough ? dense : std::min(dense, iterative);
  if (LeastSparseCost(pattern_) < cost) {
    const SparseFactorSize factor = FindSparseFactorSize(pattern_);
    if (kSparseOperation * factor.operations < cost &&
        factor.numbers <= std::numeric_limits<int>::max()) {  // Eigen's indices
      num_sparse_numbers_ = factor.numbers;
      return Kind::kSparse;
    }
  }
  if (is_rough) {
    return iterative < CostFormed(dense) ? Kind::kImplicit : Kind::kDense;
  }
  return iterative < dense ? Kind::kIterative : Kind::kDense;
}

void ReducedCameraSystem::SetZero() {
  for (std::vector<double>& part : parts_) part.assign(num_numbers(), 0.0);
}

ReducedCameraSystem::Block ReducedCameraSystem::BlockOf(int part, int32_t a,
                                                        int32_t b) {
  const int32_t row = column(a) / 3;
  const int32_t col = column(b) / 3;
  const int64_t begin = pattern_.begin[col];
  const int64_t end = pattern_.begin[col + 1];
  // Where a column has no gaps, as in a band, no search is necessary; in one
  // without zeros, not even a look.
  int64_t n = row - col;
  const bool is_full = end - begin == pattern_.num_columns() - col;
  if (!is_full && (n >= end - begin || pattern_.row[begin + n] != row)) {
    n = std::lower_bound(pattern_.row.begin() + begin,
                         pattern_.row.begin() + end, row) -
        pattern_.row.begin() - begin;
  }
  return {parts_[part].data() + 9 * begin + 3 * n, 3 * (end - begin)};
}

void ReducedCameraSystem::AddBlock(int part, int32_t a, int32_t b,
                                   const double block[9]) {
  const Block target = BlockOf(part, a, b);
  for (int c = 0; c < 3; ++c) {
    for (int r = 0; r < 3; ++r) {
      target.first[c * target.stride + r] += block[3 * c + r];
    }
  }
}

// Works on runs of consecutive frames, whose rows are consecutive, too.
void ReducedCameraSystem::SubtractSquare(int part,
                                         const std::vector<int32_t>& frames,
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

void ReducedCameraSystem::AddUpParts() {
  ParallelFor(num_numbers(), 65536, num_threads_,
              [&](int64_t begin, int64_t end, int) {
                for (int part = 1; part < kNumParts; ++part) {
                  for (int64_t n = begin; n < end; ++n) {
                    parts_[0][n] += parts_[part][n];
                  }
                }
              });
}

// Calls visit(row, column, count, numbers) for runs of consecutive numbers of
// the sum, column by column. Diagonal blocks are visited with both triangles.
template <typename Visit>
void ReducedCameraSystem::ForEachRun(const Visit& visit) const {
  const double* numbers = parts_[0].data();
  for (int64_t column = 0; column < num_columns_; ++column) {
    const int64_t end = pattern_.begin[column / 3 + 1];
    for (int64_t n = pattern_.begin[column / 3]; n < end;) {
      const int32_t row = pattern_.row[n];
      int64_t count = 0;
      while (n < end && pattern_.row[n] == row + count) ++n, ++count;
      visit(3 * int64_t{row}, column, 3 * count, numbers);
      numbers += 3 * count;
    }
  }
}

std::vector<Eigen::Matrix3d> ReducedCameraSystem::Blocks() const {
  std::vector<Eigen::Matrix3d> blocks;
  blocks.reserve(pattern_.num_blocks());
  for (int32_t j = 0; j < pattern_.num_columns(); ++j) {
    const int64_t begin = pattern_.begin[j];
    const int64_t count = pattern_.begin[j + 1] - begin;
    for (int64_t n = 0; n < count; ++n) {
      blocks.emplace_back(
          Eigen::Map<const Eigen::Matrix3d, 0, Eigen::OuterStride<>>(
              &parts_[0][9 * begin + 3 * n], Eigen::OuterStride<>(3 * count)));
    }
  }
  return blocks;
}

bool ReducedCameraSystem::FactorizeDensely(double regularization) {
  dense_.SetZero(num_columns_);
  ForEachRun([&](int64_t row, int64_t column, int64_t count, const double* x) {
    const int64_t above = std::max<int64_t>(0, column - row);
    dense_.SetRun(row + above, column, count - above, x + above);
  });
  for (int64_t n = 0; n < num_columns_; ++n) {
    dense_.At(n, n) = Regularized(dense_.At(n, n), regularization);
  }
  return dense_.Factorize(num_threads_);
}

bool ReducedCameraSystem::FactorizeSparsely(double regularization) {
  if (sparse_matrix_.size() == 0) {
    std::vector<Eigen::Triplet<double>> zeros;
    ForEachRun([&](int64_t row, int64_t column, int64_t count, const double*) {
      for (int64_t r = row; r < row + count; ++r) {
        zeros.emplace_back(static_cast<int>(r), static_cast<int>(column), 0);
      }
    });
    sparse_matrix_.resize(num_columns_, num_columns_);
    sparse_matrix_.setFromTriplets(zeros.begin(), zeros.end());
    sparse_.analyzePattern(sparse_matrix_);
  }
  std::copy(parts_[0].begin(), parts_[0].end(), sparse_matrix_.valuePtr());
  for (int64_t n = 0; n < num_columns_; ++n) {
    double& number = sparse_matrix_.coeffRef(n, n);
    number = Regularized(number, regularization);
  }
  sparse_.factorize(sparse_matrix_);
  return sparse_.info() == Eigen::Success;
}

// The regularisation is relative to the diagonal. Callers remove its error by
// iterative refinement.
bool ReducedCameraSystem::FactorizeDirectly() {
  for (double regularization = 1e-14; regularization < 1e-7;
       regularization *= 100) {
    if (kind_ == Kind::kDense ? FactorizeDensely(regularization)
                              : FactorizeSparsely(regularization)) {
      return true;
    }
  }
  return false;
}

bool ReducedCameraSystem::Factorize(int num_threads) {
  num_threads_ = num_threads;
  AddUpParts();
  if (kind_ == Kind::kImplicit) {
    return iterative_.Factorize(pattern_, Blocks(), num_threads,
                                /*has_factor=*/false);
  }
  if (kind_ == Kind::kIterative) {
    const int num_iterations = std::exchange(most_iterations_, 0);
    if (IterativeCost(num_iterations) <= DenseCost() &&
        iterative_.Factorize(pattern_, Blocks(), num_threads)) {
      return true;
    }
    GoOnDensely();
  }
  return FactorizeDirectly();
}

void ReducedCameraSystem::GoOnDensely() {
  if (kind_ == Kind::kImplicit) pattern_ = std::move(pairs_);
  kind_ = Kind::kDense;
  iterative_ = {};
}

Eigen::VectorXd ReducedCameraSystem::Solve(
    const Eigen::VectorXd& rhs, double tolerance,
    const ConjugateGradients::Multiply& other_blocks) {
  Eigen::VectorXd x = rhs;
  if (num_columns_ == 0) return x;
  if (kind_ == Kind::kImplicit) {
    const int limit =
        static_cast<int>(CostFormed(DenseCost()) / ImplicitCost(1));
    if (!iterative_.Solve(rhs, tolerance, &x, limit, other_blocks)) {
      GoOnDensely();
    }
    return x;
  }
  if (kind_ == Kind::kIterative) {
    const bool has_ended = iterative_.Solve(rhs, tolerance, &x);
    most_iterations_ = std::max(most_iterations_, iterative_.num_iterations());
    if (has_ended) return x;
    GoOnDensely();
    if (!FactorizeDirectly()) return x;
    x = rhs;
  }
  if (kind_ == Kind::kSparse) return sparse_.solve(rhs);
  dense_.Solve(x.data());
  return x;
}

int64_t ReducedCameraSystem::MemoryBytes() const {
  const auto n = static_cast<double>(num_columns_);
  const auto block_numbers = static_cast<double>(num_numbers());
  double numbers = kNumParts * block_numbers;
  switch (kind_) {
    case Kind::kDense:
      numbers += n * n / 2;
      break;
    case Kind::kSparse:  // half as much again for the indices
      numbers +=
          1.5 * (2 * block_numbers + static_cast<double>(num_sparse_numbers_));
      break;
    case Kind::kIterative:  // the incomplete factor in single precision
      numbers += 1.3 * block_numbers;
      break;
    case Kind::kImplicit:  // with what it is multiplied by
      numbers += 9 * num_observations_;
      break;
  }
  return static_cast<int64_t>(8 * numbers);
}

}  // namespace krot::internal
