#include <algorithm>

#include <gtest/gtest.h>

#include "krot/pipeline/rounds.h"
#include "krot/problem/cost.h"
#include "tests/convert/lens_model.h"

namespace krot::internal {
namespace {

// Two estimates on both sides of a third, three times as far behind it as
// before it.
class BesideTheTruth : public ::testing::Test {
 protected:
  BesideTheTruth() : from_(built_.start), to_(built_.start) {
    for (int k = 0; k < built_.problem.num_points; ++k) {
      const Eigen::Vector3d way(k % 2 ? 0.02 : -0.02, 0.01, 0.02);
      from_.points[k] -= way;
      to_.points[k] += 3 * way;
    }
  }

  double CostOf(const Estimate& estimate) const {
    return reprojection_.TrueCost(estimate, Norm::L2(), 1);
  }
  double CostOfPoint(const Estimate& estimate, int k) const {
    double cost = 0;
    for (int64_t i = built_.problem.point_begin[k];
         i < built_.problem.point_begin[k + 1]; ++i) {
      cost = std::max(cost, reprojection_.Error(estimate, Norm::L2(), i));
    }
    return cost;
  }

  const Model model_ = MakeLensModel({});
  BuiltProblem built_ = BuildProblem(model_, {});
  const Reprojection reprojection_{model_, built_};
  Estimate from_, to_;
};

using BestOnSegment_ = BesideTheTruth;

TEST_F(BestOnSegment_, StopsWhereTheTrueErrorIsLowAndNotAtItsEnd) {
  ASSERT_GT(CostOf(to_), CostOf(from_));
  double step = -1;
  const Estimate best =
      BestOnSegment(reprojection_, from_, to_, Norm::L2(), Context{1}, &step);
  EXPECT_GT(step, 0);
  EXPECT_LT(step, 0.5);
  EXPECT_LT(CostOf(best), 0.5 * CostOf(from_));
  EXPECT_NEAR((best.points[0] - from_.points[0]).norm(),
              step * (to_.points[0] - from_.points[0]).norm(), 1e-12);
}

TEST_F(BestOnSegment_, StaysWhereEveryStepIsUphill) {
  double step = -1;
  const Estimate best = BestOnSegment(reprojection_, built_.start, to_,
                                      Norm::L2(), Context{1}, &step);
  EXPECT_LE(CostOf(best), CostOf(built_.start));
  const Estimate up =
      BestOnSegment(reprojection_, from_, from_, Norm::L2(), Context{1}, &step);
  EXPECT_EQ(step, 0);
  EXPECT_EQ(up.points, from_.points);
}

using BestPointsOnSegments_ = BesideTheTruth;

TEST_F(BestPointsOnSegments_, GoAllTheWayButWhereAPointGetsWorse) {
  Estimate to = built_.start;
  to.points[3] = to_.points[3];
  ASSERT_GT(CostOfPoint(to, 3), CostOfPoint(from_, 3));
  const Estimate best = BestPointsOnSegments(reprojection_, built_.problem,
                                             from_, to, Norm::L2(), 1);
  for (int k = 0; k < built_.problem.num_points; ++k) {
    EXPECT_LE(CostOfPoint(best, k), CostOfPoint(from_, k)) << k;
    if (k == 3) continue;
    EXPECT_EQ(best.points[k], to.points[k]);
  }
  EXPECT_NE(best.points[3], to.points[3]);
}

using TrustRegions_ = BesideTheTruth;

TEST_F(TrustRegions_, BoundTheObservationsWhosePromiseWasNotKept) {
  Estimate to = built_.start;
  to.points[3] = to_.points[3];
  double level = 0;  // kept by all points but one
  for (int k = 0; k < built_.problem.num_points; ++k) {
    if (k != 3) level = std::max(level, CostOfPoint(to, k));
  }
  TrustRegions trust;
  EXPECT_TRUE(trust.IsEmpty());
  const int64_t count =
      trust.Shrink(reprojection_, built_.problem, from_, to, Norm::L2(), level);
  EXPECT_GT(count, 0);
  std::vector<int64_t> observation_of;
  double highest = 2;  // of a bound, as a share of the level
  for (int shrink = 0; shrink < 3; ++shrink, highest *= 2) {
    const KnownRotationProblem bounded =
        trust.AddTo(built_.problem, from_, level, &observation_of);
    ASSERT_EQ(bounded.observations.size(), observation_of.size());
    ASSERT_EQ(bounded.observations.size(),
              built_.problem.observations.size() + count);
    int64_t num_bounds = 0;
    for (size_t i = 0; i < observation_of.size(); ++i) {
      const Observation& row = bounded.observations[i];
      if (observation_of[i] >= 0) {
        EXPECT_EQ(row.E, built_.problem.observations[observation_of[i]].E);
        continue;
      }
      ++num_bounds;
      EXPECT_EQ(row.point, 3);
      const auto residual = [&](const Estimate& estimate) {
        return ResidualOf(ViewPoint(bounded, row, estimate), Norm::L2());
      };
      EXPECT_NEAR(residual(from_), 0, 1e-9 * level);
      EXPECT_NEAR(residual(to), highest * level, 1e-9 * level);
    }
    EXPECT_EQ(num_bounds, count);
    trust.Shrink(reprojection_, built_.problem, from_, to, Norm::L2(), level);
  }
  trust.Clear();
  EXPECT_TRUE(trust.IsEmpty());
}

}  // namespace
}  // namespace krot::internal
