#pragma once

#include <cstdint>
#include <vector>

namespace krot::internal {

// Kernels that are compiled for other vector units than the rest of the code.
// Their interface has no Eigen types, because compiler flags for vector units
// change the alignment of these, which callers and kernels must agree on.

// Part of a matrix: columns of `rows` numbers, `stride` numbers apart.
struct MatrixTile {
  const double* numbers;
  int64_t rows;
  int64_t columns;
  int64_t stride;
};

struct LinearKernels {
  // See SubtractFromColumns below.
  void (*subtract_from_columns)(const double* const g[3], const double s[9],
                                int64_t n, double* first_column,
                                int64_t stride);
  // Replaces the lower triangle by its Cholesky factor L; false unless the tile
  // is positive definite.
  bool (*factorize)(const MatrixTile& tile);
  // tile := tile L'^-1
  void (*divide_by_transposed)(const MatrixTile& L, const MatrixTile& tile);
  // tile -= a b'; if a is b, only in the lower triangle.
  void (*subtract_product)(const MatrixTile& a, const MatrixTile& b,
                           const MatrixTile& tile);
  // x := L^-1 x, or L'^-1 x
  void (*divide)(const MatrixTile& L, bool transposed, double* x);
  // from -= tile x, or tile' x
  void (*subtract_times)(const MatrixTile& tile, bool transposed,
                         const double* x, double* from);
};

// Subtracts G'S from three columns of a matrix, which are `stride` numbers
// apart:
//
//   column_j[k] -= sum_r s[3 r + j] g_r[k],   k < n, j < 3,
//
// where g_r are the rows of G (3 x n) and s holds those of S (3 x 3). This is
// the innermost loop of the Schur complement. The columns must not overlap each
// other or G.
void SubtractFromColumns(const double* const g[3], const double s[9], int64_t n,
                         double* first_column, int64_t stride);

// The Cholesky factor of a dense symmetric positive definite matrix, computed
// by tiles that are shared out to threads. The same bits at any number of
// threads. BLAS is not used, as in the serial OpenBLAS of Debian 12 two threads
// may use the same buffer.
//
// Usage: SetZero; At or SetRun for the nonzero numbers of the lower triangle;
// Factorize; Solve.
class DenseCholesky {
 public:
  void SetZero(int64_t num_columns);
  double& At(int64_t row, int64_t column);  // column <= row
  // Sets `count` numbers of a column, beginning at `row`.
  void SetRun(int64_t row, int64_t column, int64_t count,
              const double* numbers);

  // False if the matrix is not positive definite up to rounding; then Solve
  // must not be called. O(n^3 / 3).
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
  // The tiles of the lower triangle, row by row. Each tile is contiguous and
  // column-major: in one large matrix its columns would be pages apart.
  std::vector<double> tiles_;
};

}  // namespace krot::internal
