#include "krot/conic/dense_cholesky.h"

#include <algorithm>
#include <utility>
#include <vector>

#include <cblas.h>
#include <Eigen/Cholesky>

#include "krot/base/parallel_for.h"
#include "krot/conic/blas_threads.h"

namespace krot {
namespace {

constexpr int64_t kTile = 192;

}  // namespace

int64_t DenseCholesky::Size(int64_t tile) const {
  return std::min(kTile, L_.rows() - tile * kTile);
}

// A_kk = L_kk L_kk'.
bool DenseCholesky::FactorizeDiagonal(int64_t k) {
  const auto tile = L_.block(k * kTile, k * kTile, Size(k), Size(k));
  const Eigen::LLT<Eigen::MatrixXd> llt(tile);
  if (llt.info() != Eigen::Success) return false;
  L_.block(k * kTile, k * kTile, Size(k), Size(k))
      .triangularView<Eigen::Lower>() = llt.matrixLLT();
  return true;
}

// L_ik = A_ik L_kk'^-1.
void DenseCholesky::DividePanel(int64_t k, int64_t i) {
  const int n = static_cast<int>(L_.rows());
  cblas_dtrsm(CblasColMajor, CblasRight, CblasLower, CblasTrans, CblasNonUnit,
              static_cast<int>(Size(i)), static_cast<int>(Size(k)), 1.0,
              &L_(k * kTile, k * kTile), n, &L_(i * kTile, k * kTile), n);
}

// A_ij -= L_ik L_jk'.
void DenseCholesky::UpdateTile(int64_t k, int64_t i, int64_t j) {
  const int n = static_cast<int>(L_.rows());
  const double* L_ik = &L_(i * kTile, k * kTile);
  double* A_ij = &L_(i * kTile, j * kTile);
  if (i == j) {
    cblas_dsyrk(CblasColMajor, CblasLower, CblasNoTrans,
                static_cast<int>(Size(i)), static_cast<int>(Size(k)), -1.0,
                L_ik, n, 1.0, A_ij, n);
  } else {
    cblas_dgemm(CblasColMajor, CblasNoTrans, CblasTrans,
                static_cast<int>(Size(i)), static_cast<int>(Size(j)),
                static_cast<int>(Size(k)), -1.0, L_ik, n,
                &L_(j * kTile, k * kTile), n, 1.0, A_ij, n);
  }
}

bool DenseCholesky::Factorize(const Eigen::MatrixXd& matrix, int num_threads) {
  UseOneBlasThread();
  L_ = matrix;
  const int64_t num_tiles = NumChunks(L_.rows(), kTile);
  for (int64_t k = 0; k < num_tiles; ++k) {
    if (!FactorizeDiagonal(k)) return false;
    const int64_t num_below = num_tiles - k - 1;
    ParallelFor(num_below, 1, num_threads, [&](int64_t below, int64_t, int) {
      DividePanel(k, k + 1 + below);
    });
    std::vector<std::pair<int64_t, int64_t>> tiles;
    for (int64_t i = k + 1; i < num_tiles; ++i) {
      for (int64_t j = k + 1; j <= i; ++j) tiles.emplace_back(i, j);
    }
    ParallelFor(static_cast<int64_t>(tiles.size()), 1, num_threads,
                [&](int64_t tile, int64_t, int) {
                  UpdateTile(k, tiles[tile].first, tiles[tile].second);
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
