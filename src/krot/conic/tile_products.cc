// Compiled for the machine at hand. Eigen stands here under a name of its own:
// the linker keeps one of all functions of a name, and those of other files are
// not compiled so.
#define Eigen KrotNativeEigen

#include "krot/conic/tile_products.h"

#include <Eigen/Core>

namespace krot {
namespace {

template <typename Scalar>
auto MatrixOf(const Tile<Scalar>& tile) {
  using Matrix = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>;
  return Eigen::Map<Matrix, 0, Eigen::OuterStride<>>(
      tile.data, tile.rows, tile.cols, Eigen::OuterStride<>(tile.stride));
}

}  // namespace

template <typename Scalar>
void DivideByTransposed(const Tile<Scalar>& L, const Tile<Scalar>& A) {
  auto a = MatrixOf(A);
  MatrixOf(L)
      .template triangularView<Eigen::Lower>()
      .transpose()
      .template solveInPlace<Eigen::OnTheRight>(a);
}

template <typename Scalar>
void SubtractSquare(const Tile<Scalar>& A, const Tile<Scalar>& C) {
  MatrixOf(C).template selfadjointView<Eigen::Lower>().rankUpdate(MatrixOf(A),
                                                                  -1);
}

template <typename Scalar>
void SubtractProduct(const Tile<Scalar>& A, const Tile<Scalar>& B,
                     const Tile<Scalar>& C) {
  MatrixOf(C).noalias() -= MatrixOf(A) * MatrixOf(B).transpose();
}

template void DivideByTransposed(const Tile<float>&, const Tile<float>&);
template void DivideByTransposed(const Tile<double>&, const Tile<double>&);
template void SubtractSquare(const Tile<float>&, const Tile<float>&);
template void SubtractSquare(const Tile<double>&, const Tile<double>&);
template void SubtractProduct(const Tile<float>&, const Tile<float>&,
                              const Tile<float>&);
template void SubtractProduct(const Tile<double>&, const Tile<double>&,
                              const Tile<double>&);

}  // namespace krot
