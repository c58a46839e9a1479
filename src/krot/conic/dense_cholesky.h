#pragma once

#include <Eigen/Core>

#include "krot/conic/tile_products.h"

namespace krot {

// The Cholesky factor of a dense symmetric positive definite matrix, by tiles:
// the products of tiles are shared out to `num_threads` threads. The same bits
// at any number of threads.
class DenseCholesky {
 public:
  // Reads the lower triangle. False if the matrix is not positive definite up
  // to rounding; there is nothing to solve with then. O(n^3 / 3).
  bool Factorize(const Eigen::MatrixXd& matrix, int num_threads);

  // matrix^-1 rhs.
  Eigen::VectorXd Solve(const Eigen::VectorXd& rhs) const;

 private:
  bool FactorizeDiagonal(int64_t k);
  Tile TileAt(int64_t i, int64_t j);

  Eigen::MatrixXd L_;  // lower triangle
};

}  // namespace krot
