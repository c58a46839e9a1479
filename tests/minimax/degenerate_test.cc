// Sub-problems without the general position of optimum_test.cc.

#include <algorithm>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "krot/minimax/fast_descent.h"
#include "tests/oracle/ellipsoid_oracle.h"
#include "tests/testing/random_residuals.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

constexpr double kAgreement = 1e-9;  // pixels
constexpr int kInstances = 50;

// How far two ways of evaluating the residuals at x may differ: v and w are
// sums of terms that beside a camera are far larger than they.
double RoundingOfCost(const ResidualProblem& problem, const Vector3d& x,
                      double cost) {
  constexpr double kEpsilon = 2.3e-16;
  double rounding = 0;
  for (const Residual& r : problem.residuals) {
    const double v_terms = r.A.norm() * x.norm() + r.b.norm();
    const double w_terms = r.c.norm() * x.norm() + std::abs(r.d);
    rounding =
        std::max(rounding, kEpsilon * (v_terms + cost * w_terms) / r.Depth(x));
  }
  return rounding;
}

class DegenerateTest : public testing::TestWithParam<double> {
 protected:
  Norm norm() const { return {GetParam()}; }

  DescentSummary Minimize(const ResidualProblem& problem, Vector3d* x) {
    FastDescent descent(FastDescentOptions{}, norm());
    Fill(problem, &descent.residuals());
    const DescentSummary summary = descent.Minimize(x);
    EXPECT_LE(summary.cost, summary.cost_initial);
    EXPECT_NEAR(problem.Cost(*x, norm()), summary.cost,
                RoundingOfCost(problem, *x, summary.cost));
    return summary;
  }

  // Off the centre of the first camera, where v and w vanish.
  Vector3d StartBesideCamera(const ResidualProblem& problem, double distance) {
    const Residual& ray = problem.residuals.front();
    Eigen::Matrix3d rows;
    rows << ray.A, ray.c.transpose();
    const Vector3d center =
        -rows.inverse() * Vector3d(ray.b[0], ray.b[1], ray.d);
    Vector3d aside = distance * generator_.Normal3();
    if (ray.c.dot(aside) < 0) aside = -aside;
    return center + aside;
  }

  void ExpectOptimum(const ResidualProblem& problem, double distance) {
    ExpectOptimumFrom(problem, generator_.Start(problem, distance));
  }

  void ExpectOptimumFrom(const ResidualProblem& problem, Vector3d x) {
    const DescentSummary summary = Minimize(problem, &x);
    const OracleOptimum oracle =
        MinimizeByEllipsoids(problem.residuals, norm(), x, /*radius=*/20);
    ASSERT_LT(oracle.cost - oracle.lower_bound, 0.5 * kAgreement);
    EXPECT_NEAR(summary.cost, oracle.cost, kAgreement);
    EXPECT_EQ(summary.termination, DescentTermination::kStationary);
  }

  ProblemGenerator generator_{3};
};

TEST_P(DegenerateTest, OneRayIsMetExactly) {
  for (int instance = 0; instance < kInstances; ++instance) {
    const ResidualProblem problem = generator_.Triangulation(1, 5);
    Vector3d x = generator_.Start(problem, 0.5);
    const DescentSummary summary = Minimize(problem, &x);
    EXPECT_LT(summary.cost, kAgreement);
    EXPECT_EQ(summary.termination, DescentTermination::kZeroCost);
  }
}

TEST_P(DegenerateTest, ConsistentDataLeaveNoResidual) {
  for (const int rays : {2, 3, 8, 40}) {
    for (int instance = 0; instance < kInstances; ++instance) {
      for (const ResidualProblem& problem :
           {generator_.Triangulation(rays, 0), generator_.Resection(rays, 0)}) {
        Vector3d x = generator_.Start(problem, 0.5);
        EXPECT_LT(Minimize(problem, &x).cost, kAgreement);
      }
    }
  }
}

TEST_P(DegenerateTest, AStartAtTheOptimumStays) {
  for (int instance = 0; instance < kInstances; ++instance) {
    const ResidualProblem problem = generator_.Triangulation(6, 5);
    Vector3d x = problem.x_true;
    const double cost = Minimize(problem, &x).cost;
    Vector3d again = x;
    const DescentSummary summary = Minimize(problem, &again);
    EXPECT_NEAR(summary.cost, cost, kAgreement);
    EXPECT_EQ(summary.termination, DescentTermination::kStationary);
  }
}

TEST_P(DegenerateTest, RepeatedRaysChangeNothing) {
  for (int instance = 0; instance < kInstances; ++instance) {
    ResidualProblem problem = generator_.Triangulation(5, 5);
    for (int i = 0; i < 10; ++i) {
      problem.residuals.push_back(problem.residuals[i % 3]);
    }
    ExpectOptimum(problem, 0.5);
  }
}

TEST_P(DegenerateTest, OneImageTwiceCostsHalfTheirDistance) {
  for (int instance = 0; instance < kInstances; ++instance) {
    ResidualProblem problem = generator_.Triangulation(1, 0);
    Residual twin = problem.residuals[0];  // 6 and 4 pixels beside it
    const Eigen::Vector2d offset(6, 4);
    twin.A += offset * twin.c.transpose();
    twin.b += offset * twin.d;
    problem.residuals.push_back(twin);
    Vector3d x = generator_.Start(problem, 0.5);
    const DescentSummary summary = Minimize(problem, &x);
    EXPECT_NEAR(summary.cost, 0.5 * NormOf(offset, norm()), kAgreement);
    EXPECT_EQ(summary.termination, DescentTermination::kStationary);
  }
}

// The point slides along the line, to infinity or into a camera: beside one
// of depth near zero the residuals bend so strongly that steps creep, and
// 100 iterations may end within 1 % of the optimum only.
TEST_P(DegenerateTest, CentresOnALineThroughThePointAreSolvedToOnePercent) {
  for (int instance = 0; instance < kInstances; ++instance) {
    ResidualProblem problem;
    problem.x_true = 0.2 * generator_.Normal3();
    const Vector3d direction = generator_.Normal3().normalized();
    for (int i = 0; i < 6; ++i) {
      const Vector3d center =
          problem.x_true + (4 + 4 * generator_.Uniform()) * direction;
      problem.residuals.push_back(generator_.Ray(problem.x_true, center, 5));
    }
    Vector3d x = generator_.Start(problem, 0.2);
    const DescentSummary summary = Minimize(problem, &x);
    const OracleOptimum nearby = MinimizeByEllipsoids(
        problem.residuals, norm(), problem.x_true, /*radius=*/1e3);
    EXPECT_LE(summary.cost, 1.01 * nearby.cost);
  }
}

TEST_P(DegenerateTest, NearlyParallelRaysMeetFarAway) {
  for (int instance = 0; instance < kInstances; ++instance) {
    ResidualProblem problem;
    problem.x_true = 0.2 * generator_.Normal3();
    const Vector3d direction = generator_.Normal3().normalized();
    for (int i = 0; i < 4; ++i) {
      const Vector3d center = 6 * direction + 0.15 * generator_.Normal3();
      problem.residuals.push_back(generator_.Ray(problem.x_true, center, 0.5));
    }
    ExpectOptimum(problem, 0.05);
  }
}

// Two cameras side by side that both see the point on their axes: the cost
// falls as 1 / depth, without end.
TEST_P(DegenerateTest, ParallelRaysReachTheirInfimum) {
  ResidualProblem problem;
  for (const double side : {-1.0, 1.0}) {
    Residual ray;
    ray.A << 1000, 0, 0, 0, 1000, 0;
    ray.b << 1000 * side, 0;
    ray.c << 0, 0, 1;
    problem.residuals.push_back(ray);
  }
  Vector3d x(0.3, 0.2, 5);
  const DescentSummary summary = Minimize(problem, &x);
  EXPECT_LT(summary.cost, 2e-6 * summary.cost_initial);
  EXPECT_TRUE(summary.termination == DescentTermination::kFarAway ||
              summary.termination == DescentTermination::kStationary);
}

// The same, with a third ray that keeps the infimum positive: 5 pixels to the
// side of one camera, for which every depth allows half.
TEST_P(DegenerateTest, AnInfimumAtInfinityMayBePositive) {
  ResidualProblem problem;
  for (const double side : {-1.0, 1.0}) {
    Residual ray;
    ray.A << 1000, 0, 0, 0, 1000, 0;
    ray.b << 1000 * side, 0;
    ray.c << 0, 0, 1;
    problem.residuals.push_back(ray);
  }
  Residual third = problem.residuals[1];
  third.A(1, 2) = 5;
  problem.residuals.push_back(third);
  Vector3d x(0.3, 0.2, 5);
  const DescentSummary summary = Minimize(problem, &x);
  EXPECT_GE(summary.cost, 2.5);
  EXPECT_LT(summary.cost, 2.5 * (1 + 1e-3));
  EXPECT_TRUE(summary.termination == DescentTermination::kFarAway ||
              summary.termination == DescentTermination::kStationary);
}

// Beside one camera its residual is large and bends strongly, the others' are
// far away: where depths end is no matter of where they start.
TEST_P(DegenerateTest, AStartBesideACameraLeadsToTheOptimumToo) {
  for (int instance = 0; instance < kInstances; ++instance) {
    const ResidualProblem problem = generator_.Triangulation(5, 5);
    const double distance = std::pow(10, -1 - 5 * generator_.Uniform());
    Vector3d x = StartBesideCamera(problem, distance);
    if (!std::isfinite(problem.Cost(x, norm()))) continue;  // behind another
    ExpectOptimumFrom(problem, x);
  }
}

// All points lie beside their observations on the same side, by anything up to
// 20 pixels: a step that takes the largest residuals to zero takes the small
// ones through zero and far beyond, which no linearisation tells.
TEST_P(DegenerateTest, ResidualsOnOneSideOnlyAreHalved) {
  for (int instance = 0; instance < 3; ++instance) {
    ResidualProblem problem = generator_.Resection(1000, 0);
    for (Residual& residual : problem.residuals) {
      const Eigen::Vector2d offset(20 * generator_.Uniform(), 0);
      residual.A += offset * residual.c.transpose();
      residual.b += offset * residual.d;
    }
    ExpectOptimumFrom(problem, problem.x_true);
  }
}

// Rays from the corners of a square and from above and below, all turned by
// the same angle: every residual is active at the centre.
TEST_P(DegenerateTest, ManyActiveResidualsAreNoObstacle) {
  ResidualProblem problem;
  for (int i = 0; i < 8; ++i) {
    const double angle = i * M_PI / 4;
    Eigen::Matrix3d R;
    R.row(2) << -std::cos(angle), -std::sin(angle), 0;
    R.row(0) << -std::sin(angle), std::cos(angle), 0;
    R.row(1) << 0, 0, 1;
    Residual ray;
    ray.A.row(0) = 1000 * R.row(0);
    ray.A.row(1) = 1000 * R.row(1);
    ray.A.row(0) -= 4 * R.row(2);  // 4 pixels to the left
    ray.c = R.row(2);
    ray.d = 5;
    ray.b << -4 * ray.d, 0;
    problem.residuals.push_back(ray);
  }
  EXPECT_NEAR(problem.Cost(Vector3d::Zero(), norm()), 4, 1e-12);
  for (int instance = 0; instance < kInstances; ++instance) {
    Vector3d x = generator_.Start(problem, 0.3);
    EXPECT_NEAR(Minimize(problem, &x).cost, 4, kAgreement);
  }
}

TEST_P(DegenerateTest, TheUnitOfLengthDoesNotMatter) {
  for (const double unit : {1e-6, 1e6}) {
    for (int instance = 0; instance < kInstances; ++instance) {
      const ResidualProblem problem = generator_.Triangulation(5, 5);
      Vector3d x = generator_.Start(problem, 0.5);
      ResidualProblem scaled = problem;  // x in other units
      for (Residual& residual : scaled.residuals) {
        residual.b *= unit;
        residual.d *= unit;
      }
      Vector3d y = unit * x;
      const double cost = Minimize(problem, &x).cost;
      EXPECT_NEAR(Minimize(scaled, &y).cost, cost, kAgreement);
    }
  }
}

// 1e5 units away a residual of 1000 px per radian rounds at about 1e-9 px.
TEST_P(DegenerateTest, ACoordinateFrameFarAwayCostsOnlyRounding) {
  for (int instance = 0; instance < kInstances; ++instance) {
    const ResidualProblem problem = generator_.Triangulation(5, 5);
    Vector3d x = generator_.Start(problem, 0.5);
    const Vector3d origin(1e5, -1e5, 1e5);
    ResidualProblem moved = problem;
    for (Residual& residual : moved.residuals) {
      residual.b -= residual.A * origin;
      residual.d -= residual.c.dot(origin);
    }
    Vector3d y = x + origin;
    const double cost = Minimize(problem, &x).cost;
    FastDescent descent(FastDescentOptions{}, norm());
    Fill(moved, &descent.residuals());
    EXPECT_NEAR(descent.Minimize(&y).cost, cost, 1e-6);
  }
}

TEST_P(DegenerateTest, ABlindStartIsLeftWhereItIs) {
  for (const FastDescentSettings settings :
       {FastDescentSettings::kPaper, FastDescentSettings::kFast}) {
    FastDescentOptions options;
    options.settings = settings;
    FastDescent descent(options, norm());
    Fill(generator_.Triangulation(3, 5), &descent.residuals());
    Vector3d x(0, 0, 1e4);
    const DescentSummary summary = descent.Minimize(&x);
    EXPECT_EQ(summary.termination, DescentTermination::kBehind);
    EXPECT_EQ(summary.cost, std::numeric_limits<double>::infinity());
    EXPECT_EQ(summary.iterations, 0);
    EXPECT_EQ(x, Vector3d(0, 0, 1e4));
  }
}

std::string NameOf(const testing::TestParamInfo<double>& info) {
  if (std::isinf(info.param)) return "LInf";
  return "L" + std::to_string(static_cast<int>(10 * info.param));
}

INSTANTIATE_TEST_SUITE_P(, DegenerateTest,
                         testing::Values(1, 1.5, 2, 3, Norm::LInf().p), NameOf);

}  // namespace
}  // namespace krot::internal
