#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "krot/conic/tile_products.h"

namespace krot {

// The Cholesky factor of a dense symmetric positive definite matrix, by tiles:
// the products of tiles are shared out to `num_threads` threads. The same bits
// at any number of threads. Scalar: float or double.
template <typename Scalar>
class DenseCholesky {
 public:
  using Matrix = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>;
  using Vector = Eigen::Matrix<Scalar, Eigen::Dynamic, 1>;

  // Reads the lower triangle. False if the matrix is not positive definite up
  // to rounding; there is nothing to solve with then. O(n^3 / 3).
  bool Factorize(const Matrix& matrix, int num_threads);

  // The same of a matrix that is mostly zeros: SetZero, then every number of
  // the lower triangle that is none.
  void SetZero(int64_t n);
  Scalar& At(int64_t row, int64_t column);
  bool Factorize(int num_threads);

  // matrix^-1 rhs, on as many threads. O(2 n^2): reads the factor twice.
  Vector Solve(const Vector& rhs) const;

  // What the factor of an n x n matrix occupies.
  static int64_t MemoryBytes(int64_t n);

 private:
  using ConstTile = Eigen::Map<const Matrix, 0, Eigen::OuterStride<>>;

  bool FactorizeDiagonal(int64_t k);
  int64_t stride() const;                     // of every tile
  int64_t Begin(int64_t i, int64_t j) const;  // of a tile; j <= i
  Tile<Scalar> TileAt(int64_t i, int64_t j);
  ConstTile Read(int64_t i, int64_t j) const;
  void SolveLower(int num_threads, Vector* x) const;
  void SolveUpper(int num_threads, Vector* x) const;

  int64_t size_ = 0;
  int num_threads_ = 1;
  // Of the lower triangle, row by row, each tile for itself: in a matrix as a
  // whole a tile's columns would lie pages apart.
  std::vector<Scalar> tiles_;
};

}  // namespace krot
