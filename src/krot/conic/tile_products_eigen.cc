#include "krot/conic/tile_products.h"

namespace krot {

void DivideByTransposed(const ConstTile& L, Tile A) {
  L.triangularView<Eigen::Lower>().transpose().solveInPlace<Eigen::OnTheRight>(
      A);
}

void SubtractSquare(const ConstTile& A, Tile C) {
  C.selfadjointView<Eigen::Lower>().rankUpdate(A, -1);
}

void SubtractProduct(const ConstTile& A, const ConstTile& B, Tile C) {
  C.noalias() -= A * B.transpose();
}

}  // namespace krot
