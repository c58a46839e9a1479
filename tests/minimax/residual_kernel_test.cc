// The kernel's derivatives against those of single residuals.

#include "krot/minimax/kernels.h"

#include <algorithm>
#include <vector>

#include <gtest/gtest.h>

#include "krot/minimax/residual_set.h"
#include "tests/testing/random_residuals.h"

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr int kCounts[] = {1, 7, 8, 9, 30};

TEST(ResidualKernel, GradientsAreThoseOfThePieces) {
  ProblemGenerator generator(21);
  ResidualSet set;
  for (const int count : kCounts) {
    const ResidualProblem problem = generator.Triangulation(count, 5);
    Fill(problem, &set);
    const Vector3d x = generator.Start(problem, 0.5);
    std::vector<GradientBlock> blocks(set.num_blocks());
    best_residual_kernels.evaluate_gradients(set.blocks(), set.num_blocks(),
                                             x.data(), blocks.data());
    for (int i = 0; i < count; ++i) {
      ResidualPiece piece;
      ResidualPieces(problem.residuals[i], x, Norm::L2(), /*share=*/1, &piece);
      const GradientBlock& block = blocks[i / kLanes];
      const int lane = i % kLanes;
      EXPECT_NEAR(block.value[lane], piece.value, 1e-12 * piece.value);
      EXPECT_NEAR(block.depth[lane], problem.residuals[i].Depth(x), 1e-12);
      for (int k = 0; k < 3; ++k) {
        EXPECT_NEAR(block.gradient[k][lane], piece.gradient[k],
                    1e-11 * piece.gradient.norm());
        EXPECT_NEAR(block.bend[k][lane], piece.bend[k],
                    1e-11 * piece.bend.norm());
      }
      EXPECT_NEAR(block.curvature[lane], piece.curvature,
                  1e-12 * piece.curvature);
    }
  }
}

TEST(ResidualKernel, AResidualThatIsZeroHasGradientZero) {
  Residual residual;
  residual.A << 1, 0, 0, 0, 1, 0;
  residual.b.setZero();
  residual.c = Vector3d::UnitZ();
  ResidualSet set;
  set.Add(residual);
  const Vector3d x(0, 0, 2);
  GradientBlock block;
  best_residual_kernels.evaluate_gradients(set.blocks(), 1, x.data(), &block);
  EXPECT_EQ(block.value[0], 0);
  for (const auto& gradient : block.gradient) EXPECT_EQ(gradient[0], 0);
}

// The whole step if no depth falls too far; else up to where the first does.
TEST(ResidualKernel, ADepthShareKeepsAllDepthsAboveTheLowest) {
  ProblemGenerator generator(23);
  ResidualSet set;
  const double lowest = 1 - kLargestFall;
  for (const int count : kCounts) {
    const ResidualProblem problem = generator.Triangulation(count, 5);
    Fill(problem, &set);
    const Vector3d x = generator.Start(problem, 0.5);
    for (const double length : {0.1, 1.0, 10.0, 1000.0}) {
      const Vector3d d = length * generator.Normal3();
      const double share = best_residual_kernels.depth_share(
          set.blocks(), set.num_blocks(), x.data(), d.data());
      double least = 1;  // depth at the end of the share, relative to its start
      for (const Residual& residual : problem.residuals) {
        least =
            std::min(least, residual.Depth(x + share * d) / residual.Depth(x));
      }
      EXPECT_GE(least, lowest - 1e-12);
      EXPECT_LE(share, 1);
      if (share < 1) {
        EXPECT_NEAR(least, lowest, 1e-12);
      }
    }
  }
}

TEST(ResidualKernel, MetricIsTheSumOverAllResiduals) {
  ProblemGenerator generator(22);
  ResidualSet set;
  for (const int count : kCounts) {
    const ResidualProblem problem = generator.Triangulation(count, 5);
    Fill(problem, &set);
    const Vector3d x = generator.Start(problem, 0.5);
    const double cost = 7;
    Matrix3d expected = Matrix3d::Zero();
    for (const Residual& residual : problem.residuals) {
      const double w = residual.Depth(x);
      expected += (residual.A.transpose() * residual.A +
                   cost * cost * residual.c * residual.c.transpose()) /
                  (w * w);
    }
    double metric[6];
    best_residual_kernels.sum_metric(set.blocks(), set.num_blocks(), x.data(),
                                     cost, metric);
    int entry = 0;
    for (int i = 0; i < 3; ++i) {
      for (int j = i; j < 3; ++j, ++entry) {
        EXPECT_NEAR(metric[entry], expected(i, j), 1e-12 * expected.norm());
      }
    }
  }
}

}  // namespace
}  // namespace krot::internal
