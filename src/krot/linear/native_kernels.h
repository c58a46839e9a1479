#pragma once

#include <cstdint>
#include <vector>

namespace krot::internal {

// What is compiled for the machine at hand. It has no Eigen type in its
// interface: vector flags change their alignment, and so what callers expect.

// Three columns of a matrix, `stride` numbers apart, lose G'S:
//
//   column_j[k] -= sum_r s[3 r + j] g_r[k],   k < n, j < 3,
//
// g_r being the rows of G (3 x n) and s those of S (3 x 3). The innermost loop
// of the Schur complement. The columns overlap neither each other nor G.
void SubtractFromColumns(const double* const g[3], const double s[9], int64_t n,
                         double* first_column, int64_t stride);

// The Cholesky factor of a dense symmetric positive definite matrix, by tiles
// that are shared out to threads. The same bits at any number of threads. It
// does without BLAS, as the serial OpenBLAS of Debian 12 lets two threads use
// one buffer.
//
//   SetZero; all of the lower triangle that is not 0; Factorize; Solve
class DenseCholesky {
 public:
  void SetZero(int64_t num_columns);
  double& At(int64_t row, int64_t column);  // column <= row
  // Sets `count` numbers of a column from that row on.
  void SetRun(int64_t row, int64_t column, int64_t count,
              const double* numbers);

  // False if the matrix is not positive definite up to rounding; there is
  // nothing to solve with then. O(n^3 / 3).
  bool Factorize(int num_threads);

  // x := matrix^-1 x. O(2 n^2): reads the factor twice.
  void Solve(double* x) const;

 private:
  int64_t NumTiles() const;            // along a side
  int64_t Size(int64_t i) const;       // rows, or columns, of tile i
  int64_t stride() const;              // of every tile
  double* Tile(int64_t i, int64_t j);  // j <= i
  const double* Tile(int64_t i, int64_t j) const;

  int64_t size_ = 0;
  int num_threads_ = 1;
  // Of the lower triangle, row by row. Each tile is stored by itself, its
  // columns one after another: in a matrix as a whole they would lie pages
  // apart.
  std::vector<double> tiles_;
};

}  // namespace krot::internal
