// Compiled for the machine at hand. Eigen stands here under a name of its own:
// the linker keeps one of all functions of a name, and those of other files are
// not compiled so.
#define Eigen KrotNativeEigen

#include "krot/conic/tile_products.h"

#include <Eigen/Core>

namespace krot {
namespace {

using Matrix = Eigen::Map<Eigen::MatrixXd, 0, Eigen::OuterStride<>>;

Matrix MatrixOf(const Tile& tile) {
  return Matrix(tile.data, tile.rows, tile.cols,
                Eigen::OuterStride<>(tile.stride));
}

}  // namespace

void DivideByTransposed(const Tile& L, const Tile& A) {
  Matrix a = MatrixOf(A);
  MatrixOf(L)
      .triangularView<Eigen::Lower>()
      .transpose()
      .solveInPlace<Eigen::OnTheRight>(a);
}

void SubtractSquare(const Tile& A, const Tile& C) {
  MatrixOf(C).selfadjointView<Eigen::Lower>().rankUpdate(MatrixOf(A), -1);
}

void SubtractProduct(const Tile& A, const Tile& B, const Tile& C) {
  MatrixOf(C).noalias() -= MatrixOf(A) * MatrixOf(B).transpose();
}

}  // namespace krot
