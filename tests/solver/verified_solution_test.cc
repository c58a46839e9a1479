#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/QR>

#include "krot/solver/verified_blocks.h"
#include "krot/solver/verified_dense.h"

namespace krot {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Every point is seen by all frames but one; one frame's rows are left out.
UncertainSystem RandomSystem(int num_points, int num_frames, unsigned seed) {
  std::mt19937 generator(seed);
  std::normal_distribution<double> normal;
  const auto random_block = [&] {
    return UncertainSystem::Block(
        Eigen::Matrix<double, 3, 2>::NullaryExpr([&](auto, auto) {
          return normal(generator);
        }).cast<long double>());
  };
  UncertainSystem system;
  for (int32_t k = 0; k < num_points; ++k) {
    for (int32_t f = -1; f < num_frames; ++f) {
      if (f >= 0 && f == k % num_frames) continue;
      UncertainSystem::Columns columns;
      columns.point = k;
      columns.frame = f;
      columns.point_rows = random_block();
      if (f >= 0) columns.frame_rows = random_block();
      system.columns.push_back(columns);
    }
    system.point_bound.emplace_back(1, 2, 3);
  }
  system.frame_bound.assign(num_frames, {3, 2, 1});
  return system;
}

void SetErrors(double error, UncertainSystem* system) {
  for (UncertainSystem::Columns& columns : system->columns) {
    columns.point_error.setConstant(error);
    if (columns.frame >= 0) columns.frame_error.setConstant(error);
  }
}

// A system within the uncertainty, dense; the signs of what differs are random.
struct Sample {
  MatrixXd M;
  VectorXd g;
};

Sample Draw(const UncertainSystem& system, std::mt19937* generator) {
  std::uniform_real_distribution<double> uniform(-1, 1);
  Sample sample{MatrixXd::Zero(system.num_rows(), system.num_columns()),
                VectorXd(system.num_rows())};
  int64_t column = 0;
  for (const UncertainSystem::Columns& c : system.columns) {
    for (int r = 0; r < 3; ++r) {
      for (int d = 0; d < 2; ++d) {
        sample.M(3 * c.point + r, column + d) =
            static_cast<double>(c.point_rows(r, d)) +
            c.point_error(r, d) * uniform(*generator);
        if (c.frame < 0) continue;
        const int64_t row =
            3 * (static_cast<int64_t>(system.point_bound.size()) + c.frame);
        sample.M(row + r, column + d) =
            static_cast<double>(c.frame_rows(r, d)) +
            c.frame_error(r, d) * uniform(*generator);
      }
    }
    column += 2;
  }
  int64_t row = 0;
  for (const auto* bounds : {&system.point_bound, &system.frame_bound}) {
    for (const Eigen::Vector3d& bound : *bounds) {
      for (const double entry : bound) {
        sample.g[row++] = entry * uniform(*generator);
      }
    }
  }
  return sample;
}

// Both ways to bound the length of a solution.
struct Method {
  std::string name;
  std::function<std::optional<double>(const UncertainSystem&)> bound_length;
};

class BoundSolution : public testing::TestWithParam<Method> {
 protected:
  std::optional<double> Bound(const UncertainSystem& system) const {
    return GetParam().bound_length(system);
  }
};

TEST_P(BoundSolution, HoldsForEverySystemWithinTheUncertainty) {
  std::mt19937 generator(1);
  int num_bounded = 0;
  for (unsigned seed = 1; seed <= 30; ++seed) {
    UncertainSystem system = RandomSystem(6, 4, seed);
    SetErrors(1e-4, &system);
    const std::optional<double> bound = Bound(system);
    num_bounded += bound.has_value();
    if (!bound) continue;  // too badly conditioned for this uncertainty
    for (int trial = 0; trial < 10; ++trial) {
      const Sample sample = Draw(system, &generator);
      const VectorXd a =
          -sample.M.completeOrthogonalDecomposition().solve(sample.g);
      ASSERT_LE((sample.M * a + sample.g).norm(), 1e-9);
      EXPECT_LE(a.norm(), *bound);
      EXPECT_GE(3000 * a.norm(), *bound);  // and is no idle one
    }
  }
  EXPECT_GE(num_bounded, 25);
}

TEST_P(BoundSolution, DoesNotDependOnTheUnitsOfAPoint) {
  UncertainSystem system = RandomSystem(5, 3, 2);
  SetErrors(1e-12, &system);
  const std::optional<double> bound = Bound(system);
  ASSERT_TRUE(bound);
  for (UncertainSystem::Columns& columns : system.columns) {
    if (columns.point != 2) continue;
    columns.point_rows *= 0x1p-100L;
    columns.point_error *= 0x1p-100;
  }
  system.point_bound[2] *= 0x1p-100;
  const std::optional<double> scaled = Bound(system);
  ASSERT_TRUE(scaled);
  EXPECT_NEAR(*scaled, *bound, 1e-6 * *bound);
}

TEST_P(BoundSolution, GivesNoneUnlessFullRankIsProved) {
  const UncertainSystem system = RandomSystem(5, 3, 3);
  EXPECT_TRUE(Bound(system));

  UncertainSystem uncertain = system;
  SetErrors(2, &uncertain);
  EXPECT_FALSE(Bound(uncertain));

  UncertainSystem without_row = system;
  for (UncertainSystem::Columns& columns : without_row.columns) {
    if (columns.frame == 1) columns.frame_rows.row(2).setZero();
  }
  EXPECT_FALSE(Bound(without_row));

  UncertainSystem dependent = system;
  for (UncertainSystem::Columns& columns : dependent.columns) {
    if (columns.point != 4) continue;
    columns.point_rows.row(0) =
        columns.point_rows.row(1) - 2 * columns.point_rows.row(2);
  }
  EXPECT_FALSE(Bound(dependent));
  for (UncertainSystem::Columns& columns : dependent.columns) {
    columns.point_rows *= 1 + 1e-17L;
  }
  EXPECT_FALSE(Bound(dependent));

  UncertainSystem unseen = system;  // fewer unknowns than rows
  unseen.point_bound.emplace_back(1, 1, 1);
  EXPECT_FALSE(Bound(unseen));
}

TEST_P(BoundSolution, GivesNoneForNumbersThatAreNotFinite) {
  const UncertainSystem system = RandomSystem(6, 3, 4);
  ASSERT_TRUE(Bound(system));
  for (const double bad : {std::numeric_limits<double>::infinity(),
                           std::numeric_limits<double>::quiet_NaN()}) {
    UncertainSystem broken = system;
    broken.point_bound[1][1] = bad;
    EXPECT_FALSE(Bound(broken));
    broken = system;
    broken.columns[2].point_error(1, 1) = bad;
    EXPECT_FALSE(Bound(broken));
    broken = system;
    broken.columns[2].point_rows(1, 1) = bad;
    EXPECT_FALSE(Bound(broken));
  }
}

INSTANTIATE_TEST_SUITE_P(
    Methods, BoundSolution,
    testing::Values(
        Method{"ByBlocks", BoundSolutionByBlocks},
        Method{"ByInverse",
               [](const UncertainSystem& system) -> std::optional<double> {
                 const auto largest = BoundSolutionByInverse(system);
                 if (!largest) return std::nullopt;
                 return *largest *
                        std::sqrt(static_cast<double>(system.num_columns()));
               }}),
    [](const auto& test) { return test.param.name; });

// A point on the line through two frames can move along it.
TEST(BoundSolutionByInverse, HoldsWhereASystemAllButLosesItsRank) {
  for (const double distance : {1e-4, 1e-8}) {
    UncertainSystem system = RandomSystem(5, 3, 5);
    for (UncertainSystem::Columns& columns : system.columns) {
      if (columns.point != 4) continue;
      columns.point_rows.row(0) =
          columns.point_rows.row(1) + distance * columns.point_rows.row(0);
    }
    const std::optional<double> bound = BoundSolutionByInverse(system);
    ASSERT_TRUE(bound);
    std::mt19937 generator(6);
    const Sample sample = Draw(system, &generator);
    const VectorXd a =
        -sample.M.completeOrthogonalDecomposition().solve(sample.g);
    EXPECT_LE(a.norm(),
              *bound * std::sqrt(static_cast<double>(system.num_columns())));
  }
}

}  // namespace
}  // namespace krot
