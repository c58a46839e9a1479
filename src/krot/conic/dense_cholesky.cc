#include "krot/conic/dense_cholesky.h"

#include <algorithm>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>

#include "krot/base/parallel_for.h"
#include "krot/conic/tile_products.h"

namespace krot {
namespace {

constexpr int64_t kTile = 192;

}  // namespace

Tile DenseCholesky::TileAt(int64_t i, int64_t j) {
  return {&L_(i * kTile, j * kTile), std::min(kTile, L_.rows() - i * kTile),
          std::min(kTile, L_.cols() - j * kTile), L_.rows()};
}

// A_kk = L_kk L_kk'.
bool DenseCholesky::FactorizeDiagonal(int64_t k) {
  const int64_t size = TileAt(k, k).rows;
  auto tile = L_.block(k * kTile, k * kTile, size, size);
  const Eigen::LLT<Eigen::MatrixXd> llt(tile);
  if (llt.info() != Eigen::Success) return false;
  tile.triangularView<Eigen::Lower>() = llt.matrixLLT();
  return true;
}

bool DenseCholesky::Factorize(const Eigen::MatrixXd& matrix, int num_threads) {
  L_ = matrix;
  const int64_t num_tiles = NumChunks(L_.rows(), kTile);
  for (int64_t k = 0; k < num_tiles; ++k) {
    if (!FactorizeDiagonal(k)) return false;
    const int64_t num_below = num_tiles - k - 1;
    ParallelFor(num_below, 1, num_threads, [&](int64_t below, int64_t, int) {
      DivideByTransposed(TileAt(k, k), TileAt(k + 1 + below, k));
    });
    std::vector<std::pair<int64_t, int64_t>> tiles;
    for (int64_t i = k + 1; i < num_tiles; ++i) {
      for (int64_t j = k + 1; j <= i; ++j) tiles.emplace_back(i, j);
    }
    ParallelFor(static_cast<int64_t>(tiles.size()), 1, num_threads,
                [&](int64_t tile, int64_t, int) {
                  const auto [i, j] = tiles[tile];
                  if (i == j) {
                    SubtractSquare(TileAt(i, k), TileAt(i, i));
                  } else {
                    SubtractProduct(TileAt(i, k), TileAt(j, k), TileAt(i, j));
                  }
                });
  }
  return true;
}

Eigen::VectorXd DenseCholesky::Solve(const Eigen::VectorXd& rhs) const {
  Eigen::VectorXd x = L_.triangularView<Eigen::Lower>().solve(rhs);
  L_.triangularView<Eigen::Lower>().transpose().solveInPlace(x);
  return x;
}

}  // namespace krot
