#pragma once

#include <Eigen/Core>

namespace krot {

// The products of a Cholesky factorization by tiles, on the calling thread: by
// BLAS, or by Eigen where there is none (KROT_WITH_BLAS).
using Tile = Eigen::Ref<Eigen::MatrixXd>;
using ConstTile = Eigen::Ref<const Eigen::MatrixXd>;

// A := A L'^-1, of L's lower triangle.
void DivideByTransposed(const ConstTile& L, Tile A);

// C := C - A A', the lower triangle alone.
void SubtractSquare(const ConstTile& A, Tile C);

// C := C - A B'.
void SubtractProduct(const ConstTile& A, const ConstTile& B, Tile C);

}  // namespace krot
