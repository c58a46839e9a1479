#pragma once

#include <cstdint>

namespace krot {

// A rectangle of a matrix, by columns, `stride` apart.
struct Tile {
  double* data;
  int64_t rows, cols;
  int64_t stride;
};

// The products of a Cholesky factorization by tiles, on the calling thread, by
// Eigen; any number of threads may call them. Not by BLAS: the serial OpenBLAS of
// Debian 12 lets two threads use one buffer.

// A := A L'^-1, of L's lower triangle.
void DivideByTransposed(const Tile& L, const Tile& A);

// C := C - A A', the lower triangle alone.
void SubtractSquare(const Tile& A, const Tile& C);

// C := C - A B'.
void SubtractProduct(const Tile& A, const Tile& B, const Tile& C);

}  // namespace krot
