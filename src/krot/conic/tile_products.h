#pragma once

#include <cstdint>

namespace krot {

// A rectangle of a matrix, by columns, `stride` apart; Scalar: float, double.
template <typename Scalar>
struct Tile {
  Scalar* data;
  int64_t rows, cols;
  int64_t stride;
};

// The products of a Cholesky factorization by tiles, on the calling thread, by
// Eigen; any number of threads may call them. Not by BLAS: the serial OpenBLAS
// of Debian 12 lets two threads use one buffer.

// A := A L'^-1, of L's lower triangle.
template <typename Scalar>
void DivideByTransposed(const Tile<Scalar>& L, const Tile<Scalar>& A);

// C := C - A A', the lower triangle alone.
template <typename Scalar>
void SubtractSquare(const Tile<Scalar>& A, const Tile<Scalar>& C);

// C := C - A B'.
template <typename Scalar>
void SubtractProduct(const Tile<Scalar>& A, const Tile<Scalar>& B,
                     const Tile<Scalar>& C);

}  // namespace krot
