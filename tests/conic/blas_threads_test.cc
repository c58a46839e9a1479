#include "krot/conic/blas_threads.h"

#include <gtest/gtest.h>
#include <Eigen/Core>

#include "krot/conic/dense_cholesky.h"

namespace {

int openblas_threads = 8;
int mkl_threads = 8;

}  // namespace

// In the place of those of a BLAS with threads.
extern "C" {
int openblas_get_num_threads(void) { return openblas_threads; }
void openblas_set_num_threads(int num_threads) {
  openblas_threads = num_threads;
}
int MKL_Get_Max_Threads(void) { return mkl_threads; }
void MKL_Set_Num_Threads(int num_threads) { mkl_threads = num_threads; }
}

namespace krot {
namespace {

TEST(UseOneBlasThread, TellsEveryBlasThatHasThreads) {
  openblas_threads = mkl_threads = 8;
  UseOneBlasThread();
  EXPECT_EQ(openblas_threads, 1);
  EXPECT_EQ(mkl_threads, 1);
}

TEST(UseOneBlasThread, IsDoneBeforeAFactorization) {
  openblas_threads = 8;
  ASSERT_TRUE(
      DenseCholesky().Factorize(Eigen::MatrixXd::Identity(300, 300), 2));
  EXPECT_EQ(openblas_threads, 1);
}

}  // namespace
}  // namespace krot
