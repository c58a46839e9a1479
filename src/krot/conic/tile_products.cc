// Compiled for the machine at hand. Eigen stands here under a name of its own:
// the linker keeps one of all functions of a name, and those of other files are
// not compiled so.
#define Eigen KrotNativeEigen

#include "krot/conic/tile_products.h"

#include <type_traits>

#include <Eigen/Core>

namespace krot {
namespace {

template <typename Scalar>
auto MatrixOf(const Tile<Scalar>& tile) {
  using Matrix = Eigen::Matrix<std::remove_const_t<Scalar>, Eigen::Dynamic,
                               Eigen::Dynamic>;
  using MaybeConst =
      std::conditional_t<std::is_const_v<Scalar>, const Matrix, Matrix>;
  return Eigen::Map<MaybeConst, 0, Eigen::OuterStride<>>(
      tile.data, tile.rows, tile.cols, Eigen::OuterStride<>(tile.stride));
}

template <typename Scalar>
auto VectorOf(Scalar* data, int64_t size) {
  using Vector = Eigen::Matrix<std::remove_const_t<Scalar>, Eigen::Dynamic, 1>;
  using MaybeConst =
      std::conditional_t<std::is_const_v<Scalar>, const Vector, Vector>;
  return Eigen::Map<MaybeConst>(data, size);
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

template <typename Scalar>
void SubtractTimesVector(const Tile<const Scalar>& A, const Scalar* x,
                         Scalar* y) {
  VectorOf(y, A.rows).noalias() -= MatrixOf(A) * VectorOf(x, A.cols);
}

template <typename Scalar>
void SubtractTransposedTimesVector(const Tile<const Scalar>& A, const Scalar* x,
                                   Scalar* y) {
  VectorOf(y, A.cols).noalias() -=
      MatrixOf(A).transpose() * VectorOf(x, A.rows);
}

template void DivideByTransposed(const Tile<float>&, const Tile<float>&);
template void DivideByTransposed(const Tile<double>&, const Tile<double>&);
template void SubtractSquare(const Tile<float>&, const Tile<float>&);
template void SubtractSquare(const Tile<double>&, const Tile<double>&);
template void SubtractProduct(const Tile<float>&, const Tile<float>&,
                              const Tile<float>&);
template void SubtractProduct(const Tile<double>&, const Tile<double>&,
                              const Tile<double>&);
template void SubtractTimesVector(const Tile<const float>&, const float*,
                                  float*);
template void SubtractTimesVector(const Tile<const double>&, const double*,
                                  double*);
template void SubtractTransposedTimesVector(const Tile<const float>&,
                                            const float*, float*);
template void SubtractTransposedTimesVector(const Tile<const double>&,
                                            const double*, double*);

}  // namespace krot
