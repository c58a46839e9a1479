#include <cblas.h>

#include "krot/conic/tile_products.h"

namespace krot {
namespace {

int Int(Eigen::Index size) { return static_cast<int>(size); }

}  // namespace

void DivideByTransposed(const ConstTile& L, Tile A) {
  cblas_dtrsm(CblasColMajor, CblasRight, CblasLower, CblasTrans, CblasNonUnit,
              Int(A.rows()), Int(A.cols()), 1.0, L.data(), Int(L.outerStride()),
              A.data(), Int(A.outerStride()));
}

void SubtractSquare(const ConstTile& A, Tile C) {
  cblas_dsyrk(CblasColMajor, CblasLower, CblasNoTrans, Int(A.rows()),
              Int(A.cols()), -1.0, A.data(), Int(A.outerStride()), 1.0,
              C.data(), Int(C.outerStride()));
}

void SubtractProduct(const ConstTile& A, const ConstTile& B, Tile C) {
  cblas_dgemm(CblasColMajor, CblasNoTrans, CblasTrans, Int(A.rows()),
              Int(B.rows()), Int(A.cols()), -1.0, A.data(),
              Int(A.outerStride()), B.data(), Int(B.outerStride()), 1.0,
              C.data(), Int(C.outerStride()));
}

}  // namespace krot
