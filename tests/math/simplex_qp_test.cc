#include "krot/math/simplex_qp.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <set>
#include <vector>

#include <gtest/gtest.h>

namespace krot::internal {
namespace {

using Eigen::Vector3d;

class SimplexQpTest : public testing::Test {
 protected:
  double Normal() { return normal_(generator_); }
  Vector3d Normal3() { return {Normal(), Normal(), Normal()}; }

  std::vector<LinearPiece> RandomPieces(int count) {
    std::vector<LinearPiece> pieces(count);
    for (LinearPiece& piece : pieces) piece = {Normal(), Normal3()};
    return pieces;
  }

  std::mt19937 generator_{1};
  std::normal_distribution<double> normal_;
};

// Primal-dual optimality: weights of a simplex, step = -sum of weighted
// gradients, no piece above the level, weight only on pieces at the level.
void ExpectOptimal(const std::vector<LinearPiece>& pieces,
                   const SimplexQpSolution& solution) {
  double scale = 0;
  for (const LinearPiece& piece : pieces) {
    scale =
        std::max({scale, std::abs(piece.value), piece.gradient.squaredNorm()});
  }
  const double tolerance = 1e-9 * scale;
  ASSERT_GE(solution.size, 1);
  ASSERT_LE(solution.size, 4);
  double sum = 0;
  Vector3d step = Vector3d::Zero();
  std::set<int> indices;
  for (int k = 0; k < solution.size; ++k) {
    EXPECT_GT(solution.weight[k], 0);
    indices.insert(solution.index[k]);
    sum += solution.weight[k];
    const LinearPiece& piece = pieces[solution.index[k]];
    step -= solution.weight[k] * piece.gradient;
    EXPECT_NEAR(piece.value + piece.gradient.dot(solution.step), solution.level,
                tolerance);
  }
  EXPECT_EQ(static_cast<int>(indices.size()), solution.size);
  EXPECT_NEAR(sum, 1, 1e-9);
  EXPECT_LE((step - solution.step).norm(), 1e-9 * std::sqrt(scale));
  for (const LinearPiece& piece : pieces) {
    EXPECT_LE(piece.value + piece.gradient.dot(solution.step),
              solution.level + tolerance);
  }
}

void SolveAndCheck(const std::vector<LinearPiece>& pieces) {
  SimplexQpSolution solution;
  SolveSimplexQp(pieces.data(), static_cast<int>(pieces.size()), &solution);
  ExpectOptimal(pieces, solution);
}

TEST_F(SimplexQpTest, SolvesRandomInputs) {
  for (int trial = 0; trial < 5000; ++trial) {
    SolveAndCheck(RandomPieces(1 + trial % 30));
  }
}

TEST_F(SimplexQpTest, SolvesInputsOfVeryDifferentScales) {
  for (int trial = 0; trial < 2000; ++trial) {
    std::vector<LinearPiece> pieces = RandomPieces(2 + trial % 12);
    for (LinearPiece& piece : pieces) {
      piece.gradient *= std::pow(10, 2 * Normal());
      piece.value *= std::pow(10, 2 * Normal());
    }
    SolveAndCheck(pieces);
  }
}

TEST_F(SimplexQpTest, SolvesDuplicates) {
  for (int trial = 0; trial < 1000; ++trial) {
    std::vector<LinearPiece> pieces = RandomPieces(3 + trial % 5);
    const size_t count = pieces.size();
    for (size_t i = 0; i < 2 * count; ++i) pieces.push_back(pieces[i % count]);
    SolveAndCheck(pieces);
  }
}

TEST_F(SimplexQpTest, SolvesCollinearAndCoplanarGradients) {
  for (int trial = 0; trial < 2000; ++trial) {
    const Vector3d origin = Normal3();
    const Vector3d a = Normal3();
    const Vector3d b = trial % 2 == 0 ? Vector3d::Zero() : Normal3();
    std::vector<LinearPiece> pieces = RandomPieces(2 + trial % 10);
    for (LinearPiece& piece : pieces) {
      piece.gradient = origin + Normal() * a + Normal() * b;
    }
    SolveAndCheck(pieces);
  }
}

TEST_F(SimplexQpTest, SolvesEqualGradients) {
  std::vector<LinearPiece> pieces = RandomPieces(6);
  for (LinearPiece& piece : pieces) piece.gradient = Vector3d(1, 2, 3);
  SolveAndCheck(pieces);
}

TEST_F(SimplexQpTest, FindsTheSameFromAWarmStart) {
  for (int trial = 0; trial < 2000; ++trial) {
    std::vector<LinearPiece> pieces = RandomPieces(3 + trial % 12);
    SimplexQpSolution warm;
    const int count = static_cast<int>(pieces.size());
    SolveSimplexQp(pieces.data(), count, &warm);
    for (LinearPiece& piece : pieces) {
      piece.value += 0.1 * Normal();
      piece.gradient += 0.1 * Normal3();
    }
    SolveSimplexQp(pieces.data(), count, &warm);
    ExpectOptimal(pieces, warm);
    SimplexQpSolution cold;
    SolveSimplexQp(pieces.data(), count, &cold);
    EXPECT_LE((warm.step - cold.step).norm(), 1e-8);
  }
}

TEST_F(SimplexQpTest, RefusesNoPieces) {
  SimplexQpSolution solution;
  EXPECT_THROW(SolveSimplexQp(nullptr, 0, &solution), std::invalid_argument);
}

TEST_F(SimplexQpTest, MinNormPointIsNearerThanAnyPointOfTheHull) {
  std::vector<LinearPiece> scratch;
  for (int trial = 0; trial < 2000; ++trial) {
    std::vector<Vector3d> vectors(1 + trial % 12);
    const Vector3d shift = 1.5 * Normal3();
    for (Vector3d& v : vectors) v = Normal3() + shift;
    const Vector3d m = MinNormPoint(vectors.data(),
                                    static_cast<int>(vectors.size()), &scratch);
    // The plane through m orthogonal to it separates the hull from the origin.
    for (const Vector3d& v : vectors) {
      EXPECT_GE(v.dot(m), m.squaredNorm() - 1e-10);
    }
  }
}

TEST_F(SimplexQpTest, MinNormPointOfASegmentIsTheFootOfItsPerpendicular) {
  const Vector3d ends[] = {{1, -1, 0}, {1, 3, 0}};
  std::vector<LinearPiece> scratch;
  EXPECT_TRUE(MinNormPoint(ends, 2, &scratch).isApprox(Vector3d(1, 0, 0)));
}

}  // namespace
}  // namespace krot::internal
