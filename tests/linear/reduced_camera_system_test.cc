#include "krot/linear/reduced_camera_system.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "tests/linear/random_blocks.h"

namespace krot::internal {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kSparseFrames = 560;  // more than are always dense

// Point k is seen by frames k, k + 1 and k + 2; frame `fixed` has no columns.
BlockStructure MakeChain(int num_frames, int fixed) {
  BlockStructure structure;
  structure.point_begin = {0};
  for (int k = 0; k + 2 < num_frames; ++k) {
    for (int f = k; f <= k + 2; ++f) structure.frame_of.push_back(f);
    structure.point_begin.push_back(
        static_cast<int64_t>(structure.frame_of.size()));
  }
  structure.frame_is_fixed.assign(num_frames, 0);
  structure.frame_is_fixed[fixed] = 1;
  return structure;
}

// One more point that all frames see.
BlockStructure WithPointSeenByAll(BlockStructure structure) {
  for (int f = 0; f < structure.num_frames(); ++f) {
    structure.frame_of.push_back(f);
  }
  structure.point_begin.push_back(
      static_cast<int64_t>(structure.frame_of.size()));
  return structure;
}

// Random positive semidefinite 9x9 blocks for neighbouring frames, dealt out to
// the parts, and a multiple of the identity.
void FillChain(int num_frames, ReducedCameraSystem* system) {
  std::mt19937 generator(1);
  std::normal_distribution<double> normal;
  system->SetZero();
  for (int k = 0; k + 2 < num_frames; ++k) {
    MatrixXd A(9, 9);
    for (double& entry : A.reshaped()) entry = normal(generator);
    const MatrixXd H = A.transpose() * A + 0.1 * MatrixXd::Identity(9, 9);
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b <= a; ++b) {
        if (system->column(k + a) < 0 || system->column(k + b) < 0) continue;
        const Eigen::Matrix3d block = H.block<3, 3>(3 * a, 3 * b);
        system->AddBlock(k % system->num_parts(), k + a, k + b, block.data());
      }
    }
  }
}

// The same, densely: all but the fixed frame's columns.
MatrixXd DenseChain(int num_frames, int fixed) {
  std::mt19937 generator(1);
  std::normal_distribution<double> normal;
  MatrixXd all = MatrixXd::Zero(3 * num_frames, 3 * num_frames);
  for (int k = 0; k + 2 < num_frames; ++k) {
    MatrixXd A(9, 9);
    for (double& entry : A.reshaped()) entry = normal(generator);
    all.block<9, 9>(3 * k, 3 * k) +=
        A.transpose() * A + 0.1 * MatrixXd::Identity(9, 9);
  }
  const int before = 3 * fixed;
  const int after = 3 * (num_frames - fixed - 1);
  MatrixXd free(before + after, before + after);
  free << all.topLeftCorner(before, before), all.topRightCorner(before, after),
      all.bottomLeftCorner(after, before), all.bottomRightCorner(after, after);
  return free;
}

VectorXd Solve(ReducedCameraSystem* system, const VectorXd& rhs) {
  return system->Solve(rhs, 1e-10);
}

VectorXd RandomVector(int64_t size) {
  std::mt19937 generator(2);
  std::normal_distribution<double> normal;
  VectorXd x(size);
  for (double& entry : x) entry = normal(generator);
  return x;
}

TEST(BlockPattern, HasEveryPairOfFreeFramesThatSharesAPoint) {
  constexpr int kFrames = 12;
  const BlockStructure structure = MakeRandomStructure(kFrames, 1);
  std::vector<int> free;
  for (int f = 0; f < kFrames; ++f) {
    if (structure.frame_is_fixed[f] == 0) free.push_back(f);
  }
  const auto sees = [&](int f, int64_t k) {
    const auto begin = structure.frame_of.begin();
    return std::count(begin + structure.point_begin[k],
                      begin + structure.point_begin[k + 1], f) > 0;
  };
  BlockPattern expected;
  for (size_t a = 0; a < free.size(); ++a) {
    for (size_t b = a; b < free.size(); ++b) {
      bool do_share = a == b;
      for (int64_t k = 0; k < structure.num_points(); ++k) {
        do_share |= sees(free[a], k) && sees(free[b], k);
      }
      if (!do_share) continue;
      expected.row.push_back(static_cast<int32_t>(b));
    }
    expected.begin.push_back(expected.num_blocks());
  }
  EXPECT_EQ(PairsThatSharePoints(structure), expected);
}

// Eliminated from its ends a chain is never filled, nor is a star.
TEST(BlockPattern, OfAChainOrAStarHasAFactorWithoutFill) {
  constexpr int kFrames = 50;
  BlockPattern star;
  for (int f = 0; f < kFrames; ++f) {
    star.row.push_back(f);
    if (f + 1 == kFrames) star.begin.push_back(star.num_blocks());
  }
  for (int f = 1; f < kFrames; ++f) {
    star.row.push_back(f);
    star.begin.push_back(star.num_blocks());
  }
  for (const BlockPattern& pattern :
       {star, PairsThatSharePoints(MakeChain(kFrames + 1, 0))}) {
    // Of a block on the diagonal, the lower triangle.
    EXPECT_EQ(FindSparseFactorSize(pattern).numbers,
              9 * pattern.num_blocks() - 3 * kFrames);
  }
}

TEST(BlockPattern, OfAllPairsHasADenseFactor) {
  constexpr int kFrames = 40;
  constexpr int kColumns = 3 * kFrames;
  const SparseFactorSize factor = FindSparseFactorSize(
      PairsThatSharePoints(WithPointSeenByAll(MakeChain(kFrames + 1, 0))));
  EXPECT_EQ(factor.numbers, kColumns * (kColumns + 1) / 2);
  double operations = 0;  // a pair for every number of every update
  for (int column = 0; column < kColumns; ++column) {
    operations += column * column;
  }
  EXPECT_DOUBLE_EQ(factor.operations, operations);
}

TEST(ReducedCameraSystem, NumbersTheColumnsOfFreeFrames) {
  const BlockStructure structure = MakeChain(5, 2);
  const ReducedCameraSystem system(structure);
  EXPECT_EQ(system.num_columns(), 12);
  EXPECT_EQ(system.column(0), 0);
  EXPECT_EQ(system.column(1), 3);
  EXPECT_EQ(system.column(2), -1);
  EXPECT_EQ(system.column(3), 6);
}

TEST(ReducedCameraSystem, SolvesAFewFramesDensely) {
  const int num_frames = 12;
  const BlockStructure structure = MakeChain(num_frames, 3);
  ReducedCameraSystem system(structure);
  FillChain(num_frames, &system);
  ASSERT_TRUE(system.Factorize(1));
  const VectorXd x_true = RandomVector(system.num_columns());
  const VectorXd x = Solve(&system, DenseChain(num_frames, 3) * x_true);
  EXPECT_LT((x - x_true).norm(), 1e-11 * x_true.norm());
}

TEST(ReducedCameraSystem, SolvesALongChainSparselyAsItDoesDensely) {
  const BlockStructure chain = MakeChain(kSparseFrames, 7);
  const BlockStructure full = WithPointSeenByAll(chain);
  ReducedCameraSystem sparse(chain);
  ReducedCameraSystem dense(full);
  ASSERT_LT(10 * sparse.MemoryBytes(), dense.MemoryBytes());

  const VectorXd x_true = RandomVector(sparse.num_columns());
  const VectorXd rhs = DenseChain(kSparseFrames, 7) * x_true;
  for (ReducedCameraSystem* system : {&sparse, &dense}) {
    FillChain(kSparseFrames, system);
    ASSERT_TRUE(system->Factorize(2));
    EXPECT_LT((Solve(system, rhs) - x_true).norm(), 1e-11 * x_true.norm());
  }
}

// Random positive semidefinite blocks for the frames of every point, of weights
// that span `decades`, and a small multiple of the identity.
void FillAtRandom(const BlockStructure& structure, double decades,
                  ReducedCameraSystem* system) {
  std::mt19937 generator(5);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> exponent(-decades, 0);
  system->SetZero();
  const Eigen::Matrix3d ridge = 1e-9 * Eigen::Matrix3d::Identity();
  for (int32_t f = 0; f < structure.num_frames(); ++f) {
    if (system->column(f) >= 0) system->AddBlock(0, f, f, ridge.data());
  }
  for (int64_t k = 0; k < structure.num_points(); ++k) {
    std::vector<int32_t> frames;
    for (int64_t i = structure.point_begin[k]; i < structure.point_begin[k + 1];
         ++i) {
      const int32_t f = structure.frame_of[i];
      if (system->column(f) >= 0) frames.push_back(f);
    }
    std::sort(frames.begin(), frames.end());
    frames.erase(std::unique(frames.begin(), frames.end()), frames.end());
    MatrixXd G(2, 3 * frames.size());
    for (double& entry : G.reshaped()) entry = normal(generator);
    G *= std::pow(10, exponent(generator) / 2);
    for (size_t a = 0; a < frames.size(); ++a) {
      for (size_t b = 0; b <= a; ++b) {
        const Eigen::Matrix3d block =
            G.middleCols<3>(3 * a).transpose() * G.middleCols<3>(3 * b);
        system->AddBlock(0, frames[a], frames[b], block.data());
      }
    }
  }
}

// Few pairs of frames share a point, but eliminated in any order they fill the
// matrix.
TEST(ReducedCameraSystem, IsSolvedByIterationsWhereASparseFactorWouldFillUp) {
  constexpr int kFrames = 900;
  const BlockStructure structure = MakeRandomStructure(kFrames, 1);
  ReducedCameraSystem system(structure);
  EXPECT_EQ(system.kind(), ReducedCameraSystem::Kind::kIterative);
  EXPECT_EQ(ReducedCameraSystem(MakeChain(kFrames, 7)).kind(),
            ReducedCameraSystem::Kind::kSparse);
  FillAtRandom(structure, 0, &system);
  ASSERT_TRUE(system.Factorize(2));
  const VectorXd rhs = RandomVector(system.num_columns());
  const VectorXd x = Solve(&system, rhs);
  EXPECT_EQ(system.kind(), ReducedCameraSystem::Kind::kIterative);

  // The same with a dense factor, once weights that are far apart made
  // iterations too many.
  FillAtRandom(structure, 12, &system);
  ASSERT_TRUE(system.Factorize(2));
  Solve(&system, rhs);
  FillAtRandom(structure, 0, &system);
  ASSERT_TRUE(system.Factorize(2));
  EXPECT_EQ(system.kind(), ReducedCameraSystem::Kind::kDense);
  const VectorXd expected = Solve(&system, rhs);
  EXPECT_LT((x - expected).norm(), 1e-4 * expected.norm());
}

// Where a sparse factor would fill up; with a chain it takes the factor.
TEST(ReducedCameraSystem, IsNotFormedForRoughSolutions) {
  constexpr auto kRough = ReducedCameraSystem::Use::kRoughSolutions;
  constexpr int kFrames = 900;
  const BlockStructure chain = MakeChain(kFrames, 7);
  const BlockStructure full = MakeRandomStructure(kFrames, 1);
  EXPECT_EQ(ReducedCameraSystem(chain, nullptr, kRough).kind(),
            ReducedCameraSystem::Kind::kSparse);
  EXPECT_EQ(ReducedCameraSystem(full, nullptr, kRough).kind(),
            ReducedCameraSystem::Kind::kImplicit);
}

// Tracks with gaps across the fixed frame, on top of a chain that is large
// enough to stay positive definite; two of their frames stand apart.
TEST(ReducedCameraSystem, LosesSquaresAsTheDenseMatrixDoes) {
  const int fixed = 3;
  for (const int num_frames : {12, kSparseFrames}) {
    const std::vector<int32_t> frames = {0, 1, 2, 4, 5, 7, 8, 9, 11};
    const std::vector<char> is_apart = {0, 1, 0, 0, 1, 0, 1, 0, 0};
    BlockStructure structure = MakeChain(num_frames, fixed);
    structure.frame_of.insert(structure.frame_of.end(), frames.begin(),
                              frames.end());
    structure.point_begin.push_back(
        static_cast<int64_t>(structure.frame_of.size()));
    ReducedCameraSystem system(structure);
    FillChain(num_frames, &system);
    MatrixXd expected = DenseChain(num_frames, fixed);

    std::mt19937 generator(3);
    std::normal_distribution<double> normal;
    using Rows = Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::RowMajor>;
    Rows G(3, 3 * frames.size());
    for (double& entry : G.reshaped()) entry = 0.05 * normal(generator);
    const double* const rows[3] = {&G(0, 0), &G(1, 0), &G(2, 0)};
    system.SubtractSquare(system.num_parts() - 1, frames, is_apart, rows);
    for (size_t a = 0; a < frames.size(); ++a) {
      for (size_t b = 0; b < frames.size(); ++b) {
        if (is_apart[a] && is_apart[b]) continue;
        expected.block<3, 3>(system.column(frames[a]),
                             system.column(frames[b])) -=
            G.middleCols<3>(3 * a).transpose() * G.middleCols<3>(3 * b);
      }
    }
    ASSERT_TRUE(system.Factorize(1));
    const VectorXd x_true = RandomVector(system.num_columns());
    const VectorXd x = Solve(&system, expected * x_true);
    EXPECT_LT((x - x_true).norm(), 1e-11 * x_true.norm());
  }
}

TEST(ReducedCameraSystem, IsFilledAnewAfterSetZero) {
  for (const int num_frames : {12, kSparseFrames}) {
    const BlockStructure structure = MakeChain(num_frames, 0);
    ReducedCameraSystem system(structure);
    const VectorXd rhs = RandomVector(system.num_columns());
    FillChain(num_frames, &system);
    ASSERT_TRUE(system.Factorize(1));
    const VectorXd first = Solve(&system, rhs);
    FillChain(num_frames, &system);
    ASSERT_TRUE(system.Factorize(1));
    EXPECT_EQ(first, Solve(&system, rhs));
  }
}

TEST(ReducedCameraSystem, HasTheSameBitsAtAnyNumberOfThreads) {
  const BlockStructure structure = MakeChain(100, 0);
  ReducedCameraSystem system(structure);
  const VectorXd rhs = RandomVector(system.num_columns());
  FillChain(100, &system);
  ASSERT_TRUE(system.Factorize(1));
  const VectorXd one = Solve(&system, rhs);
  FillChain(100, &system);
  ASSERT_TRUE(system.Factorize(3));
  EXPECT_EQ(one, Solve(&system, rhs));
}

TEST(ReducedCameraSystem, RegularisesAFrameThatNothingHolds) {
  // Three free frames; the last one has no blocks at all.
  const BlockStructure structure = MakeChain(4, 0);
  ReducedCameraSystem system(structure);
  system.SetZero();
  const Eigen::Matrix3d identity = Eigen::Matrix3d::Identity();
  system.AddBlock(0, 1, 1, identity.data());
  system.AddBlock(0, 2, 2, identity.data());
  ASSERT_TRUE(system.Factorize(1));
  VectorXd rhs = VectorXd::Zero(9);
  rhs[0] = 2;
  EXPECT_NEAR(Solve(&system, rhs)[0], 2, 1e-12);
  EXPECT_EQ(Solve(&system, rhs).tail<3>().norm(), 0);
}

TEST(ReducedCameraSystem, RefusesAnIndefiniteMatrix) {
  for (const int num_frames : {4, kSparseFrames}) {
    const BlockStructure structure = MakeChain(num_frames, 0);
    ReducedCameraSystem system(structure);
    FillChain(num_frames, &system);
    const Eigen::Matrix3d negative = -1e6 * Eigen::Matrix3d::Identity();
    system.AddBlock(0, 1, 1, negative.data());
    EXPECT_FALSE(system.Factorize(1));
  }
}

TEST(ReducedCameraSystem, WithoutFreeFramesSolvesNothing) {
  BlockStructure structure;
  structure.point_begin = {0, 1};
  structure.frame_of = {0};
  structure.frame_is_fixed = {1};
  ReducedCameraSystem system(structure);
  system.SetZero();
  EXPECT_TRUE(system.Factorize(1));
  EXPECT_EQ(Solve(&system, VectorXd()).size(), 0);
}

}  // namespace
}  // namespace krot::internal
