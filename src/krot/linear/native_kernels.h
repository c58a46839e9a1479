#pragma once

#include <cstdint>
#include <vector>

namespace krot::internal {

// What is compiled for other vector units than the rest. It has no Eigen type
// in its interface: vector flags change their alignment, and so what callers
// expect.

// Part of a matrix: columns of `rows` numbers, `stride` numbers apart.
struct MatrixTile {
  const double* numbers;
  int64_t rows;
  int64_t columns;
  int64_t stride;
};

struct LinearKernels {
  // As the function of that name.
  void (*subtract_from_columns)(const double* const g[3], const double s[9],
                                int64_t n, double* first_column,
                                int64_t stride);
  // Replaces the lower triangle by its Cholesky factor L; false unless the tile
  // is positive definite.
  bool (*factorize)(const MatrixTile& tile);
  // tile := tile L'^-1
  void (*divide_by_transposed)(const MatrixTile& L, const MatrixTile& tile);
  // tile -= a b'; of the lower triangle alone if a is b.
  void (*subtract_product)(const MatrixTile& a, const MatrixTile& b,
                           const MatrixTile& tile);
  // x := L^-1 x, or L'^-1 x
  void (*divide)(const MatrixTile& L, bool transposed, double* x);
  // from -= tile x, or tile' x
  void (*subtract_times)(const MatrixTile& tile, bool transposed,
                         const double* x, double* from);
};

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
  int64_t NumTiles() const;                     // along a side
  int64_t Size(int64_t i) const;                // rows, or columns, of tile i
  int64_t stride() const;                       // of every tile
  MatrixTile Tile(int64_t i, int64_t j) const;  // j <= i

  int64_t size_ = 0;
  int num_threads_ = 1;
  // Of the lower triangle, row by row. Each tile is stored by itself, its
  // columns one after another: in a matrix as a whole they would lie pages
  // apart.
  std::vector<double> tiles_;
};

}  // namespace krot::internal
