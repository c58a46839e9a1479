#include "krot/conic/dense_cholesky.h"

#include <algorithm>
#include <utility>

#include <Eigen/Cholesky>

#include "krot/base/parallel_for.h"

namespace krot {
namespace {

// Eigen's products of tiles of 192 take half as long again per number, for the
// way it splits them; those of 96 and 160 are between.
constexpr int64_t kTile = 128;
// Of tiles, solved one after another before threads take what follows.
constexpr int64_t kGroup = 4;
// Waking a thread takes longer than its share of a solve with fewer.
constexpr int64_t kFewColumns = 1000;

// In numbers. Every tile has that of the largest.
int64_t Room(int64_t n) {
  const int64_t num_rows = NumChunks(n, kTile);
  const int64_t rows = std::min(kTile, n);
  return num_rows * (num_rows + 1) / 2 * rows * rows;
}

int64_t SizeOf(int64_t n, int64_t i) { return std::min(kTile, n - i * kTile); }

}  // namespace

template <typename Scalar>
int64_t DenseCholesky<Scalar>::stride() const {
  return std::min(kTile, size_);
}

template <typename Scalar>
int64_t DenseCholesky<Scalar>::Begin(int64_t i, int64_t j) const {
  return (i * (i + 1) / 2 + j) * stride() * stride();
}

template <typename Scalar>
Tile<Scalar> DenseCholesky<Scalar>::TileAt(int64_t i, int64_t j) {
  return {&tiles_[Begin(i, j)], SizeOf(size_, i), SizeOf(size_, j), stride()};
}

template <typename Scalar>
typename DenseCholesky<Scalar>::ConstTile DenseCholesky<Scalar>::Read(
    int64_t i, int64_t j) const {
  return ConstTile(&tiles_[Begin(i, j)], SizeOf(size_, i), SizeOf(size_, j),
                   Eigen::OuterStride<>(stride()));
}

// A_kk = L_kk L_kk'.
template <typename Scalar>
bool DenseCholesky<Scalar>::FactorizeDiagonal(int64_t k) {
  const Eigen::LLT<Matrix> llt(Read(k, k));
  if (llt.info() != Eigen::Success) return false;
  const Tile<Scalar> tile = TileAt(k, k);
  Eigen::Map<Matrix, 0, Eigen::OuterStride<>>(
      tile.data, tile.rows, tile.cols, Eigen::OuterStride<>(tile.stride)) =
      llt.matrixLLT();
  return true;
}

template <typename Scalar>
void DenseCholesky<Scalar>::SetZero(int64_t n) {
  size_ = n;
  tiles_.assign(Room(n), 0);
}

template <typename Scalar>
Scalar& DenseCholesky<Scalar>::At(int64_t row, int64_t column) {
  return tiles_[Begin(row / kTile, column / kTile) + column % kTile * stride() +
                row % kTile];
}

template <typename Scalar>
bool DenseCholesky<Scalar>::Factorize(const Matrix& matrix, int num_threads) {
  size_ = matrix.rows();
  tiles_.resize(Room(size_));
  ParallelFor(NumChunks(size_, kTile), 1, num_threads,
              [&](int64_t i, int64_t, int) {
                for (int64_t j = 0; j <= i; ++j) {
                  const Tile<Scalar> tile = TileAt(i, j);
                  for (int64_t c = 0; c < tile.cols; ++c) {
                    std::copy_n(&matrix(i * kTile, j * kTile + c), tile.rows,
                                tile.data + c * tile.stride);
                  }
                }
              });
  return Factorize(num_threads);
}

template <typename Scalar>
bool DenseCholesky<Scalar>::Factorize(int num_threads) {
  num_threads_ = num_threads;
  const int64_t num_tiles = NumChunks(size_, kTile);
  std::vector<std::pair<int64_t, int64_t>> rest;
  for (int64_t k = 0; k < num_tiles; ++k) {
    if (!FactorizeDiagonal(k)) return false;
    const int64_t num_below = num_tiles - k - 1;
    ParallelFor(num_below, 1, num_threads, [&](int64_t below, int64_t, int) {
      DivideByTransposed(TileAt(k, k), TileAt(k + 1 + below, k));
    });
    rest.clear();
    for (int64_t i = k + 1; i < num_tiles; ++i) {
      for (int64_t j = k + 1; j <= i; ++j) rest.emplace_back(i, j);
    }
    ParallelFor(static_cast<int64_t>(rest.size()), 1, num_threads,
                [&](int64_t tile, int64_t, int) {
                  const auto [i, j] = rest[tile];
                  if (i == j) {
                    SubtractSquare(TileAt(i, k), TileAt(i, i));
                  } else {
                    SubtractProduct(TileAt(i, k), TileAt(j, k), TileAt(i, j));
                  }
                });
  }
  return true;
}

// L^-1 x, by groups of tiles: what is solved of a group is taken off all parts
// below at once, of each in the order in which it was solved.
template <typename Scalar>
void DenseCholesky<Scalar>::SolveLower(int num_threads, Vector* x) const {
  const auto part = [&](int64_t i) {
    return x->segment(i * kTile, SizeOf(size_, i));
  };
  const auto subtract = [&](int64_t i, int64_t j) {
    part(i).noalias() -= Read(i, j) * part(j);
  };
  const int64_t num_tiles = NumChunks(size_, kTile);
  for (int64_t begin = 0; begin < num_tiles; begin += kGroup) {
    const int64_t end = std::min(begin + kGroup, num_tiles);
    for (int64_t i = begin; i < end; ++i) {
      for (int64_t j = begin; j < i; ++j) subtract(i, j);
      Read(i, i).template triangularView<Eigen::Lower>().solveInPlace(part(i));
    }
    ParallelFor(num_tiles - end, 1, num_threads,
                [&](int64_t below, int64_t, int) {
                  for (int64_t j = begin; j < end; ++j) {
                    subtract(end + below, j);
                  }
                });
  }
}

// L'^-1 x, likewise from the last group to the first.
template <typename Scalar>
void DenseCholesky<Scalar>::SolveUpper(int num_threads, Vector* x) const {
  const auto part = [&](int64_t i) {
    return x->segment(i * kTile, SizeOf(size_, i));
  };
  const auto subtract = [&](int64_t i, int64_t j) {
    part(j).noalias() -= Read(i, j).transpose() * part(i);
  };
  for (int64_t end = NumChunks(size_, kTile); end > 0;) {
    const int64_t begin = (end - 1) / kGroup * kGroup;
    for (int64_t i = end - 1; i >= begin; --i) {
      Read(i, i)
          .transpose()
          .template triangularView<Eigen::Upper>()
          .solveInPlace(part(i));
      for (int64_t j = begin; j < i; ++j) subtract(i, j);
    }
    ParallelFor(begin, 1, num_threads, [&](int64_t j, int64_t, int) {
      for (int64_t i = end - 1; i >= begin; --i) subtract(i, j);
    });
    end = begin;
  }
}

template <typename Scalar>
typename DenseCholesky<Scalar>::Vector DenseCholesky<Scalar>::Solve(
    const Vector& rhs) const {
  const int num_threads = size_ < kFewColumns ? 1 : num_threads_;
  Vector x = rhs;
  SolveLower(num_threads, &x);
  SolveUpper(num_threads, &x);
  return x;
}

template <typename Scalar>
int64_t DenseCholesky<Scalar>::MemoryBytes(int64_t n) {
  return Room(n) * static_cast<int64_t>(sizeof(Scalar));
}

template class DenseCholesky<float>;
template class DenseCholesky<double>;

}  // namespace krot
