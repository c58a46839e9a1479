// This file is compiled for other vector units than the rest, perhaps several
// times, each in its own namespace. CMake also renames Eigen's namespace here:
// otherwise the linker would keep only one version of each Eigen function,
// perhaps one for vector units that the machine lacks.

#include "krot/linear/native_kernels.h"

#include <cstring>

#include <Eigen/Cholesky>
#include <Eigen/Core>

namespace krot::internal::KROT_UNITS {
namespace {

using Matrix = Eigen::MatrixXd;
using Tile = Eigen::Map<Matrix, 0, Eigen::OuterStride<>>;
using ConstTile = Eigen::Map<const Matrix, 0, Eigen::OuterStride<>>;
using Vector = Eigen::Map<Eigen::VectorXd>;
using ConstVector = Eigen::Map<const Eigen::VectorXd>;

ConstTile At(const MatrixTile& tile) {
  return ConstTile(tile.numbers, tile.rows, tile.columns,
                   Eigen::OuterStride<>(tile.stride));
}

// A writable view of a tile. Callers own the numbers, which are not const.
Tile Mutable(const MatrixTile& tile) {
  return Tile(const_cast<double*>(tile.numbers), tile.rows, tile.columns,
              Eigen::OuterStride<>(tile.stride));
}

// Vectors of two and four numbers. Runs are short, often of six numbers; a loop
// over them that compilers vectorise by themselves is half as fast.
using Two = double __attribute__((vector_size(16)));
using Four = double __attribute__((vector_size(32)));

template <typename Numbers>
inline void SubtractNumbers(const double* const g[3], const double s[9],
                            int64_t k, double* first_column, int64_t stride) {
  Numbers g0, g1, g2;
  std::memcpy(&g0, g[0] + k, sizeof(Numbers));
  std::memcpy(&g1, g[1] + k, sizeof(Numbers));
  std::memcpy(&g2, g[2] + k, sizeof(Numbers));
  for (int j = 0; j < 3; ++j) {
    double* const to = first_column + j * stride + k;
    Numbers column;
    std::memcpy(&column, to, sizeof(Numbers));
    column -= s[j] * g0 + s[3 + j] * g1 + s[6 + j] * g2;
    std::memcpy(to, &column, sizeof(Numbers));
  }
}

void SubtractFromColumns(const double* const g[3], const double s[9], int64_t n,
                         double* first_column, int64_t stride) {
  double local[9];  // a copy, which no column can overlap
  std::memcpy(local, s, sizeof(local));
  const double* const rows[3] = {g[0], g[1], g[2]};
  int64_t k = 0;
  for (; k + 4 <= n; k += 4) {
    SubtractNumbers<Four>(rows, local, k, first_column, stride);
  }
  if (k + 2 <= n) {
    SubtractNumbers<Two>(rows, local, k, first_column, stride);
    k += 2;
  }
  if (k < n) SubtractNumbers<double>(rows, local, k, first_column, stride);
}

bool Factorize(const MatrixTile& tile) {
  Eigen::Ref<Matrix, 0, Eigen::OuterStride<>> in_place = Mutable(tile);
  const Eigen::LLT<decltype(in_place)> llt(in_place);
  return llt.info() == Eigen::Success;
}

void DivideByTransposed(const MatrixTile& factor, const MatrixTile& tile) {
  Tile divided = Mutable(tile);
  At(factor)
      .adjoint()
      .triangularView<Eigen::Upper>()
      .solveInPlace<Eigen::OnTheRight>(divided);
}

void SubtractProduct(const MatrixTile& a, const MatrixTile& b,
                     const MatrixTile& tile) {
  Tile from = Mutable(tile);
  if (a.numbers == b.numbers) {
    from.selfadjointView<Eigen::Lower>().rankUpdate(At(a), -1);
  } else {
    from.noalias() -= At(a) * At(b).transpose();
  }
}

void Divide(const MatrixTile& factor, bool transposed, double* x) {
  Vector divided(x, factor.rows);
  if (transposed) {
    At(factor).transpose().triangularView<Eigen::Upper>().solveInPlace(divided);
  } else {
    At(factor).triangularView<Eigen::Lower>().solveInPlace(divided);
  }
}

void SubtractTimes(const MatrixTile& tile, bool transposed, const double* x,
                   double* from) {
  if (transposed) {
    Vector(from, tile.columns).noalias() -=
        At(tile).transpose() * ConstVector(x, tile.rows);
  } else {
    Vector(from, tile.rows).noalias() -=
        At(tile) * ConstVector(x, tile.columns);
  }
}

}  // namespace

extern const LinearKernels kLinearKernels = {
    &SubtractFromColumns, &Factorize, &DivideByTransposed,
    &SubtractProduct,     &Divide,    &SubtractTimes};

}  // namespace krot::internal::KROT_UNITS
