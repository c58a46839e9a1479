// This file is compiled for the machine at hand. Eigen has a name of its own
// here: of functions that have one name the linker keeps a single one, and
// those of other files are compiled for any machine.
#define Eigen KrotNativeEigen

#include "krot/linear/native_kernels.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "krot/base/parallel_for.h"

namespace krot::internal {
namespace {

// Eigen's products of tiles of 192 take half as long again per number; tiles of
// 96 and 160 are between.
constexpr int64_t kTile = 128;
// With fewer columns, waking a thread takes longer than its share of a solve.
constexpr int64_t kFewColumns = 1000;

using Matrix = Eigen::MatrixXd;
using Tiled = Eigen::Map<Matrix, 0, Eigen::OuterStride<>>;
using ConstTiled = Eigen::Map<const Matrix, 0, Eigen::OuterStride<>>;

// So many numbers side by side. Runs are short, often of six: compilers that
// vectorise the loop over them by themselves are half as fast.
using Two = double __attribute__((vector_size(16)));
using Four = double __attribute__((vector_size(32)));

template <typename Numbers>
inline void SubtractNumbers(const double* const g[3], const double s[9],
                            int64_t k, double* first_column, int64_t stride) {
  Numbers g0, g1, g2;
  std::memcpy(&g0, g[0] + k, sizeof(Numbers));
  std::memcpy(&g1, g[1] + k, sizeof(Numbers));
  std::memcpy(&g2, g[2] + k, sizeof(Numbers));
  for (int j = 0; j < 3; ++j) {
    double* const to = first_column + j * stride + k;
    Numbers column;
    std::memcpy(&column, to, sizeof(Numbers));
    column -= s[j] * g0 + s[3 + j] * g1 + s[6 + j] * g2;
    std::memcpy(to, &column, sizeof(Numbers));
  }
}

}  // namespace

void SubtractFromColumns(const double* const g[3], const double s[9], int64_t n,
                         double* first_column, int64_t stride) {
  double local[9];  // which the columns do not overlap
  std::memcpy(local, s, sizeof(local));
  const double* const rows[3] = {g[0], g[1], g[2]};
  int64_t k = 0;
  for (; k + 4 <= n; k += 4) {
    SubtractNumbers<Four>(rows, local, k, first_column, stride);
  }
  if (k + 2 <= n) {
    SubtractNumbers<Two>(rows, local, k, first_column, stride);
    k += 2;
  }
  if (k < n) SubtractNumbers<double>(rows, local, k, first_column, stride);
}

int64_t DenseCholesky::NumTiles() const { return NumChunks(size_, kTile); }

int64_t DenseCholesky::Size(int64_t i) const {
  return std::min(kTile, size_ - i * kTile);
}

int64_t DenseCholesky::stride() const { return std::min(kTile, size_); }

const double* DenseCholesky::Tile(int64_t i, int64_t j) const {
  return &tiles_[(i * (i + 1) / 2 + j) * stride() * stride()];
}

double* DenseCholesky::Tile(int64_t i, int64_t j) {
  return const_cast<double*>(std::as_const(*this).Tile(i, j));
}

void DenseCholesky::SetZero(int64_t num_columns) {
  size_ = num_columns;
  tiles_.assign(NumTiles() * (NumTiles() + 1) / 2 * stride() * stride(), 0);
}

double& DenseCholesky::At(int64_t row, int64_t column) {
  return Tile(row / kTile,
              column / kTile)[column % kTile * stride() + row % kTile];
}

void DenseCholesky::SetRun(int64_t row, int64_t column, int64_t count,
                           const double* numbers) {
  for (int64_t n = 0; n < count;) {
    const int64_t in_tile = std::min(count - n, kTile - (row + n) % kTile);
    std::copy_n(numbers + n, in_tile, &At(row + n, column));
    n += in_tile;
  }
}

bool DenseCholesky::Factorize(int num_threads) {
  num_threads_ = num_threads;
  const auto tile = [&](int64_t i, int64_t j) {
    return Tiled(Tile(i, j), Size(i), Size(j), Eigen::OuterStride<>(stride()));
  };
  const int64_t num_tiles = NumTiles();
  std::vector<std::pair<int64_t, int64_t>> rest;
  for (int64_t k = 0; k < num_tiles; ++k) {
    Eigen::Ref<Matrix, 0, Eigen::OuterStride<>> diagonal = tile(k, k);
    const Eigen::LLT<decltype(diagonal)> llt(diagonal);  // in place
    if (llt.info() != Eigen::Success) return false;
    ParallelFor(
        num_tiles - k - 1, 1, num_threads, [&](int64_t below, int64_t, int) {
          llt.matrixU().solveInPlace<Eigen::OnTheRight>(tile(k + 1 + below, k));
        });
    rest.clear();
    for (int64_t i = k + 1; i < num_tiles; ++i) {
      for (int64_t j = k + 1; j <= i; ++j) rest.emplace_back(i, j);
    }
    ParallelFor(static_cast<int64_t>(rest.size()), 1, num_threads,
                [&](int64_t n, int64_t, int) {
                  const auto [i, j] = rest[n];
                  if (i == j) {
                    tile(i, i).selfadjointView<Eigen::Lower>().rankUpdate(
                        tile(i, k), -1);
                  } else {
                    tile(i, j).noalias() -= tile(i, k) * tile(j, k).transpose();
                  }
                });
  }
  return true;
}

// L^-1 x, then L'^-1 x: each tile of x that is found is taken off all others
// that need it.
void DenseCholesky::Solve(double* x) const {
  const int num_threads = size_ < kFewColumns ? 1 : num_threads_;
  const auto tile = [&](int64_t i, int64_t j) {
    return ConstTiled(Tile(i, j), Size(i), Size(j),
                      Eigen::OuterStride<>(stride()));
  };
  const auto part = [&](int64_t i) {
    return Eigen::VectorXd::Map(x + i * kTile, Size(i));
  };
  const int64_t num_tiles = NumTiles();
  for (int64_t j = 0; j < num_tiles; ++j) {
    auto own = part(j);
    tile(j, j).triangularView<Eigen::Lower>().solveInPlace(own);
    ParallelFor(num_tiles - j - 1, 1, num_threads,
                [&](int64_t below, int64_t, int) {
                  const int64_t i = j + 1 + below;
                  part(i).noalias() -= tile(i, j) * part(j);
                });
  }
  for (int64_t i = num_tiles - 1; i >= 0; --i) {
    auto own = part(i);
    tile(i, i).transpose().triangularView<Eigen::Upper>().solveInPlace(own);
    ParallelFor(i, 1, num_threads, [&](int64_t j, int64_t, int) {
      part(j).noalias() -= tile(i, j).transpose() * part(i);
    });
  }
}

}  // namespace krot::internal
