#include <algorithm>
#include <utility>

#include "krot/base/parallel_for.h"
#include "krot/base/vector_units.h"
#include "krot/linear/native_kernels.h"

namespace krot::internal {

KROT_DECLARE_KERNELS(LinearKernels, kLinearKernels)

namespace {

// With tiles of 192, Eigen's products take 1.5 times as long per number; tiles
// of 96 and 160 are in between.
constexpr int64_t kTile = 128;
// With fewer columns, Solve uses one thread: waking another takes longer than
// its share of the work.
constexpr int64_t kFewColumns = 1000;

const LinearKernels& Kernels() { return KROT_BEST_KERNELS(kLinearKernels); }

}  // namespace

void SubtractFromColumns(const double* const g[3], const double s[9], int64_t n,
                         double* first_column, int64_t stride) {
  static const auto subtract = Kernels().subtract_from_columns;
  subtract(g, s, n, first_column, stride);
}

int64_t DenseCholesky::NumTiles() const { return NumChunks(size_, kTile); }

int64_t DenseCholesky::Size(int64_t i) const {
  return std::min(kTile, size_ - i * kTile);
}

int64_t DenseCholesky::stride() const { return std::min(kTile, size_); }

MatrixTile DenseCholesky::Tile(int64_t i, int64_t j) const {
  return {&tiles_[(i * (i + 1) / 2 + j) * stride() * stride()], Size(i),
          Size(j), stride()};
}

void DenseCholesky::SetZero(int64_t num_columns) {
  size_ = num_columns;
  tiles_.assign(NumTiles() * (NumTiles() + 1) / 2 * stride() * stride(), 0);
}

double& DenseCholesky::At(int64_t row, int64_t column) {
  const double* const tile = Tile(row / kTile, column / kTile).numbers;
  return tiles_[tile - tiles_.data() + column % kTile * stride() + row % kTile];
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
  const LinearKernels& kernels = Kernels();
  const int64_t num_tiles = NumTiles();
  std::vector<std::pair<int64_t, int64_t>> rest;
  for (int64_t k = 0; k < num_tiles; ++k) {
    if (!kernels.factorize(Tile(k, k))) return false;
    ParallelFor(
        num_tiles - k - 1, 1, num_threads, [&](int64_t below, int64_t, int) {
          kernels.divide_by_transposed(Tile(k, k), Tile(k + 1 + below, k));
        });
    rest.clear();
    for (int64_t i = k + 1; i < num_tiles; ++i) {
      for (int64_t j = k + 1; j <= i; ++j) rest.emplace_back(i, j);
    }
    ParallelFor(static_cast<int64_t>(rest.size()), 1, num_threads,
                [&](int64_t n, int64_t, int) {
                  const auto [i, j] = rest[n];
                  kernels.subtract_product(Tile(i, k), Tile(j, k), Tile(i, j));
                });
  }
  return true;
}

// Computes L^-1 x, then L'^-1 of that. Each tile of x, once it is final, is
// subtracted from all others that depend on it.
void DenseCholesky::Solve(double* x) const {
  const int num_threads = size_ < kFewColumns ? 1 : num_threads_;
  const LinearKernels& kernels = Kernels();
  const auto part = [&](int64_t i) { return x + i * kTile; };
  const int64_t num_tiles = NumTiles();
  for (int64_t j = 0; j < num_tiles; ++j) {
    kernels.divide(Tile(j, j), false, part(j));
    ParallelFor(num_tiles - j - 1, 1, num_threads,
                [&](int64_t below, int64_t, int) {
                  const int64_t i = j + 1 + below;
                  kernels.subtract_times(Tile(i, j), false, part(j), part(i));
                });
  }
  for (int64_t i = num_tiles - 1; i >= 0; --i) {
    kernels.divide(Tile(i, i), true, part(i));
    ParallelFor(i, 1, num_threads, [&](int64_t j, int64_t, int) {
      kernels.subtract_times(Tile(i, j), true, part(i), part(j));
    });
  }
}

}  // namespace krot::internal
