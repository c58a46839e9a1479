#include "krot/minimax/residual_set.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "krot/minimax/kernels.h"
#include "tests/testing/random_residuals.h"

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

class ResidualTest : public testing::TestWithParam<double> {
 protected:
  Norm norm() const { return {GetParam()}; }
  ProblemGenerator generator_{5};
};

TEST(NormOf, IsTheTextbookNorm) {
  const Eigen::Vector2d v(3, -4);
  EXPECT_DOUBLE_EQ(NormOf(v, Norm::L1()), 7);
  EXPECT_DOUBLE_EQ(NormOf(v, Norm::L2()), 5);
  EXPECT_DOUBLE_EQ(NormOf(v, Norm::LInf()), 4);
  EXPECT_DOUBLE_EQ(NormOf(v, {3}), std::cbrt(91.0));
  EXPECT_DOUBLE_EQ(NormOf(v, {1.5}), std::pow(std::pow(3, 1.5) + 8, 2.0 / 3.0));
}

TEST_P(ResidualTest, NormNeitherOverflowsNorVanishes) {
  for (const double scale : {1e-200, 1e200}) {
    const double n = NormOf(Eigen::Vector2d(scale, scale), norm());
    const double unit = NormOf(Eigen::Vector2d(1, 1), norm());
    if (norm().p == 2) continue;  // plain sums of squares, as in the kernel
    EXPECT_NEAR(n / scale, unit, 1e-12);
  }
  EXPECT_EQ(NormOf(Eigen::Vector2d::Zero(), norm()), 0);
}

TEST_P(ResidualTest, KernelAgreesWithTheResidualAndItsMaximum) {
  for (const int count : {1, 7, 8, 9, 30}) {
    const ResidualProblem problem = generator_.Triangulation(count, 5);
    ResidualSet set;
    Fill(problem, &set);
    for (int trial = 0; trial < 100; ++trial) {
      const Vector3d x = 5 * generator_.Normal3();  // often behind a camera
      const double cost = set.Evaluate(x, norm());
      double largest = 0;
      for (int i = 0; i < count; ++i) {
        const double expected = ResidualValue(problem.residuals[i], x, norm());
        if (std::isinf(expected)) {
          EXPECT_EQ(set.values()[i], kInfinity);
        } else {
          EXPECT_NEAR(set.values()[i], expected, 1e-10 * expected);
        }
        largest = std::max(largest, set.values()[i]);
      }
      EXPECT_EQ(cost, largest);
    }
  }
}

TEST_P(ResidualTest, NonPositiveDepthIsInfinitelyBad) {
  Residual residual = generator_.Triangulation(1, 0).residuals[0];
  ResidualSet set;
  for (const double depth : {0.0, -0.0, -1e-300, -3.0}) {
    residual.c.setZero();
    residual.d = depth;
    set.Clear();
    set.Add(residual);
    const Vector3d x = generator_.Normal3();
    EXPECT_EQ(ResidualValue(residual, x, norm()), kInfinity);
    EXPECT_EQ(set.Evaluate(x, norm()), kInfinity);
  }
}

// The lanes beyond the last residual hold 0 / 1, whatever was there before.
TEST_P(ResidualTest, RefilledSetsForgetWhatTheyHeld) {
  ResidualSet set;
  Fill(generator_.Triangulation(30, 100), &set);
  const ResidualProblem few = generator_.Triangulation(3, 1);
  Fill(few, &set);
  EXPECT_EQ(set.size(), 3);
  EXPECT_NEAR(set.Evaluate(few.x_true, norm()), few.Cost(few.x_true, norm()),
              1e-10);
  set.Clear();
  EXPECT_EQ(set.Evaluate(few.x_true, norm()), 0);
}

TEST_P(ResidualTest, SetGivesBackWhatWasAdded) {
  const ResidualProblem problem = generator_.Triangulation(11, 5);
  ResidualSet set;
  Fill(problem, &set);
  for (int i = 0; i < set.size(); ++i) {
    EXPECT_EQ(set[i].A, problem.residuals[i].A);
    EXPECT_EQ(set[i].b, problem.residuals[i].b);
    EXPECT_EQ(set[i].c, problem.residuals[i].c);
    EXPECT_EQ(set[i].d, problem.residuals[i].d);
  }
}

// Central differences of s'v / w for the s of the piece that is r(x).
TEST_P(ResidualTest, GradientMatchesFiniteDifferences) {
  for (int trial = 0; trial < 200; ++trial) {
    const ResidualProblem problem = generator_.Triangulation(1, 5);
    const Residual& residual = problem.residuals[0];
    const Vector3d x = generator_.Start(problem, 0.1);
    ResidualPiece pieces[kMaxPieces];
    ASSERT_EQ(ResidualPieces(residual, x, norm(), /*share=*/1, pieces), 1);
    EXPECT_NEAR(pieces[0].value, ResidualValue(residual, x, norm()), 1e-10);
    constexpr double kStep = 1e-6;
    for (int k = 0; k < 3; ++k) {
      const Vector3d h = kStep * Vector3d::Unit(k);
      const double difference = (ResidualValue(residual, x + h, norm()) -
                                 ResidualValue(residual, x - h, norm())) /
                                (2 * kStep);
      EXPECT_NEAR(pieces[0].gradient[k], difference,
                  1e-4 * pieces[0].gradient.norm());
    }
  }
}

// Second differences of ||A x + b||_p / w, w held fixed.
TEST_P(ResidualTest, CurvatureMatchesFiniteDifferences) {
  for (int trial = 0; trial < 200; ++trial) {
    const ResidualProblem problem = generator_.Triangulation(1, 5);
    const Residual& residual = problem.residuals[0];
    const Vector3d x = generator_.Start(problem, 0.1);
    const Eigen::Vector2d v = residual.Numerator(x);
    if (v.cwiseAbs().minCoeff() < 0.1 * v.norm()) continue;  // near a kink
    ResidualPiece piece[kMaxPieces];
    ResidualPieces(residual, x, norm(), /*share=*/1, piece);
    const Vector3d direction = generator_.Normal3().normalized();
    const double step = 1e-3 * v.norm() / 1000;
    const auto value = [&](double t) {
      return NormOf(residual.Numerator(x + t * direction), norm()) /
             residual.Depth(x);
    };
    const double difference =
        (value(step) - 2 * value(0) + value(-step)) / (step * step);
    const double bend = piece[0].bend.dot(direction);
    const double scale = 1e6 / value(0) / std::pow(residual.Depth(x), 2);
    EXPECT_NEAR(piece[0].curvature * bend * bend, difference, 1e-3 * scale);
  }
}

TEST_P(ResidualTest, PiecesWithinTheShareAreAllOfThem) {
  const ResidualProblem problem = generator_.Triangulation(1, 5);
  const Vector3d x = generator_.Start(problem, 0.1);
  const Residual& residual = problem.residuals[0];
  ResidualPiece pieces[kMaxPieces];
  const int all = ResidualPieces(residual, x, norm(), -1, pieces);
  EXPECT_EQ(all, norm().IsPolyhedral() ? 4 : 1);
  double largest = -kInfinity;
  for (int k = 0; k < all; ++k) largest = std::max(largest, pieces[k].value);
  EXPECT_NEAR(largest, ResidualValue(residual, x, norm()), 1e-10);
}

TEST_P(ResidualTest, VanishingResidualHasNoGradient) {
  const ResidualProblem problem = generator_.Triangulation(1, 0);
  Residual residual = problem.residuals[0];
  residual.b = -residual.A * problem.x_true;  // exactly zero
  ResidualPiece pieces[kMaxPieces];
  ASSERT_EQ(ResidualPieces(residual, problem.x_true, norm(), -1, pieces), 1);
  EXPECT_EQ(pieces[0].value, 0);
  EXPECT_EQ(pieces[0].gradient, Vector3d::Zero());
  EXPECT_EQ(pieces[0].curvature, 0);
}

using SmoothResidualTest = ResidualTest;

TEST_P(SmoothResidualTest, TangentTouchesAtItsPointAndLiesBelowElsewhere) {
  for (int trial = 0; trial < 200; ++trial) {
    const ResidualProblem problem = generator_.Triangulation(1, 5);
    const Residual& residual = problem.residuals[0];
    const Vector3d x = generator_.Start(problem, 0.2);
    const Vector3d y = generator_.Start(problem, 0.2);
    const double at_x = ResidualValue(residual, x, norm());
    EXPECT_NEAR(TangentPiece(residual, x, x, norm()).value, at_x, 1e-12 * at_x);
    EXPECT_LE(TangentPiece(residual, x, y, norm()).value, at_x * (1 + 1e-12));
  }
}

std::string NameOfNorm(const testing::TestParamInfo<double>& info) {
  if (std::isinf(info.param)) return "LInf";
  return "L" + std::to_string(static_cast<int>(10 * info.param));
}

INSTANTIATE_TEST_SUITE_P(, ResidualTest,
                         testing::Values(1, 1.5, 2, 3, kInfinity), NameOfNorm);
INSTANTIATE_TEST_SUITE_P(, SmoothResidualTest, testing::Values(1.5, 2, 3),
                         NameOfNorm);

// The kernel's derivatives against those of single residuals.

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
