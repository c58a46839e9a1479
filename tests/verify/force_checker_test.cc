#include "krot/verify/force_checker.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "krot/base/numbers.h"
#include "tests/problem/random_problem.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

using Real = ForceChecker::Real;
using Vector2 = ForceChecker::Vector2;
using Vector3 = ForceChecker::Vector3;
using Matrix3 = Eigen::Matrix<Real, 3, 3>;

// One point, seen twice by one frame: at slopes of 1/2 and 0 with one lens, of
// 2 and 1 with another. Multipliers whose forces cancel: with f the focal
// length, f_1 y_1 + f_2 y_2 = 0 and delta (lambda_1 + lambda_2) = f_1 u_1'y_1 +
// f_2 u_2'y_2. The first is the stronger one, as its depth has to change less;
// by what y would have to change it were the weaker one.
struct Balanced {
  KnownRotationProblem problem;
  Certificate certificate;
};

Balanced MakeBalanced() {
  Balanced balanced;
  KnownRotationProblem& problem = balanced.problem;
  problem.num_frames = problem.num_points = 1;
  const View view{Eigen::Matrix3d::Identity(), Eigen::Matrix3d::Identity(),
                  Eigen::Vector3d::Zero(), 0};
  problem.views = {view, view};
  const Eigen::Matrix2d identity = Eigen::Matrix2d::Identity();
  problem.observations = {{RowAtRay({0.5, 0}, 500 * identity), 0, 0},
                          {RowAtRay({2, 1}, 1000 * identity), 1, 0}};
  IndexObservations(&problem);
  const Eigen::Vector2d y(-1.5, -1.5);
  balanced.certificate = {(1000 * 3 * 0.75 - 500 * 0.5 * 1.5) / 6,
                          0,
                          {{0, 3, y}, {1, 3, -0.5 * y}}};
  return balanced;
}

Vector3 ForceOf(const Balanced& balanced, int i) {
  const CertifiedObservation& o = balanced.certificate.observations[i];
  const Vector3 multipliers(Real{balanced.certificate.lower_bound} * o.lambda,
                            o.y[0], o.y[1]);
  return balanced.problem.observations[i].E.cast<Real>().transpose() *
         multipliers;
}

Matrix3 InverseTransposed(const Balanced& balanced, int i) {
  return Matrix3(balanced.problem.observations[i].E.cast<Real>())
      .inverse()
      .transpose();
}

Real Dual(const Vector2& y, double p) {
  const Vector2 a = y.cwiseAbs();
  return p == 1   ? std::max(a[0], a[1])
         : p == 2 ? std::hypot(a[0], a[1])
                  : a[0] + a[1];
}

// The longest y within a circle, by trying.
Real LongestAround(const CertifiedObservation& o, double radius, double p) {
  Real longest = 0;
  for (int n = 0; n < 360; ++n) {
    const double angle = n * kPi / 180;
    const Eigen::Vector2d change(std::cos(angle), std::sin(angle));
    longest = std::max(longest, Dual((o.y + radius * change).cast<Real>(), p));
  }
  return longest;
}

TEST(ForceChecker, ChangesTheStrongestByWhatIsMissingAndBoundsRhoByThat) {
  Balanced balanced = MakeBalanced();
  ASSERT_LT((ForceOf(balanced, 0) + ForceOf(balanced, 1)).norm(), 1e-15);
  balanced.certificate.observations[1].y += Eigen::Vector2d(1e-4, 2e-4);
  const CertifiedObservation& strong = balanced.certificate.observations[0];
  const auto missing =
      static_cast<double>((ForceOf(balanced, 0) + ForceOf(balanced, 1)).norm());
  const Matrix3 rows = InverseTransposed(balanced, 0);
  const double y = missing * static_cast<double>(rows.bottomRows<2>().norm());
  const double depth = missing * static_cast<double>(rows.row(0).norm()) /
                       (balanced.certificate.lower_bound * strong.lambda);
  for (const double p : {1.0, 2.0, double{INFINITY}}) {
    ForceChecker checker(balanced.problem, Norm{p}, balanced.certificate);
    ASSERT_FALSE(checker.Balance());
    const std::vector<MultiplierChange> changes = checker.Changes();
    ASSERT_EQ(changes.size(), 2u);
    EXPECT_GE(changes[0].y, y);
    EXPECT_LE(changes[0].y, y * (1 + 1e-8));
    EXPECT_GE(changes[0].depth, depth);
    EXPECT_LE(changes[0].depth, depth * (1 + 1e-8));
    EXPECT_EQ(changes[1].y, 0);
    EXPECT_EQ(changes[1].depth, 0);

    std::string refusal;
    const std::optional<double> rho = checker.BoundRho(&refusal);
    ASSERT_TRUE(rho) << refusal;
    const Real longest = LongestAround(strong, y, p);
    EXPECT_GE(*rho, longest / (strong.lambda * (1 - Real{depth})));
    EXPECT_LE(*rho,
              longest / (strong.lambda * (1 - Real{depth})) * (1 + 1e-8L));
  }
}

// No more than what the changes take, which are tiny, rounded up.
TEST(ForceChecker, RoundsRhoUp) {
  const Balanced balanced = MakeBalanced();
  ForceChecker checker(balanced.problem, Norm::L2(), balanced.certificate);
  ASSERT_FALSE(checker.Balance());
  const MultiplierChange change = checker.Changes()[0];
  const CertifiedObservation& o = balanced.certificate.observations[0];
  std::string refusal;
  const std::optional<double> rho = checker.BoundRho(&refusal);
  ASSERT_TRUE(rho);
  EXPECT_GE(*rho, (o.y.cast<Real>().norm() + change.y) /
                      (o.lambda * (1 - Real{change.depth})));
}

TEST(ForceChecker, RefusesMultipliersThatMayHaveToChangeByHalf) {
  for (const double share : {0.4, 0.6, 1e9}) {
    Balanced balanced = MakeBalanced();
    CertifiedObservation& o = balanced.certificate.observations[1];
    // Its force per y is 1000 (1, 0, -2); the first's depth takes (1/2, 0, 1).
    o.y[0] += share * 3 * balanced.certificate.lower_bound /
              (1000 * std::sqrt(5.0) * std::sqrt(1.25));
    ForceChecker checker(balanced.problem, Norm::L2(), balanced.certificate);
    ASSERT_FALSE(checker.Balance());
    std::string refusal;
    EXPECT_EQ(checker.BoundRho(&refusal).has_value(), share < 0.5) << refusal;
  }
}

// Rotations are known to kRotationError: where another that is as near misses
// balance, the multipliers' changes make up for that.
TEST(ForceChecker, AllowsForWhatRotationsMakeOfForces) {
  const Balanced balanced = MakeBalanced();
  ForceChecker checker(balanced.problem, Norm::L2(), balanced.certificate);
  ASSERT_FALSE(checker.Balance());
  const MultiplierChange allowed = checker.Changes()[0];
  const Matrix3 rows = InverseTransposed(balanced, 0);
  for (int axis = 0; axis < 3; ++axis) {
    const Vector3 turn = kRotationError * Vector3::Unit(axis);
    // Of the second view alone, as its force is the first one's negative.
    const Real missing = turn.cross(ForceOf(balanced, 1)).norm();
    ASSERT_GT(missing, 0);
    EXPECT_GE(allowed.y, missing * rows.bottomRows<2>().norm());
    EXPECT_GE(allowed.depth, missing * rows.row(0).norm() /
                                 (balanced.certificate.lower_bound *
                                  balanced.certificate.observations[0].lambda));
  }
}

// What is missing may pull at a sensor that is away from its frame's first.
TEST(ForceChecker, AllowsForWhatChangesAddToTheConstants) {
  Balanced balanced = MakeBalanced();
  std::vector<Observation>& observations = balanced.problem.observations;
  std::vector<CertifiedObservation>& rows = balanced.certificate.observations;
  std::swap(observations[0], observations[1]);  // the weaker one comes first
  std::swap(rows[0], rows[1]);
  std::swap(rows[0].observation, rows[1].observation);
  IndexObservations(&balanced.problem);
  const Eigen::Vector3d offset(1e-3, -1e-3, 0);
  balanced.problem.views[0].cam_from_rig_translation = offset;
  ASSERT_EQ(observations[1].view, 0);
  const Vector3 before = ForceOf(balanced, 0);
  rows[0].y += Eigen::Vector2d(1e-4, -1e-4);
  const Vector3 missing = ForceOf(balanced, 0) - before;

  ForceChecker checker(balanced.problem, Norm::L2(), balanced.certificate);
  ASSERT_FALSE(checker.Balance());
  const Real error = checker.SumConstants().error;
  EXPECT_GE(error, std::abs(missing.dot(offset.cast<Real>())));
  EXPECT_LE(error, 1.1L * missing.norm() * offset.lpNorm<1>());
}

TEST(Pull, StandsAtThePointOrAtTheCentreOfTheView) {
  RandomSceneOptions options;
  options.views_per_frame = 2;
  options.baseline = 0.3;
  const RandomScene scene = MakeRandomScene(options);
  const KnownRotationProblem& problem = scene.problem;
  const Vector3d direction(0.2, -0.5, 0.7);
  const Pull of_point{Pull::Kind::kPoint, 4, direction};
  EXPECT_EQ(PositionOf(problem, scene.estimate, of_point),
            scene.estimate.points[4]);
  const Pull of_view{Pull::Kind::kView, 3, direction};
  const Vector3d centre = PositionOf(problem, scene.estimate, of_view);
  const View& view = problem.views[3];
  const Vector3d in_camera =
      view.cam_from_world_rotation * centre +
      view.cam_from_rig_rotation * scene.estimate.translations[view.frame] +
      view.cam_from_rig_translation;
  EXPECT_LT(in_camera.norm(), 1e-14);
  EXPECT_EQ(Along(problem, scene.estimate, of_view), direction.dot(centre));
}

TEST(Pull, IsFixedWhereItsPointOrItsViewsFrameIs) {
  RandomSceneOptions options;
  options.views_per_frame = 2;
  KnownRotationProblem problem = MakeRandomScene(options).problem;
  for (const Pull::Kind kind : {Pull::Kind::kPoint, Pull::Kind::kView}) {
    for (int32_t n = 0; n < 10; ++n) {
      EXPECT_FALSE(IsFixedPosition(problem, {kind, n}));
    }
  }
  problem.fixed_translations.resize(problem.num_frames);
  problem.fixed_translations[2] = Vector3d::Zero();
  problem.fixed_points.resize(problem.num_points);
  problem.fixed_points[4] = Vector3d::Zero();
  for (int32_t n = 0; n < 10; ++n) {
    EXPECT_EQ(IsFixedPosition(problem, {Pull::Kind::kPoint, n}), n == 4);
    EXPECT_EQ(IsFixedPosition(problem, {Pull::Kind::kView, n}),
              problem.views[n].frame == 2);
  }
}

// Where points and views are called differently.
TEST(Pull, IsAtTheSamePositionInAPart) {
  const RandomScene scene = MakeRandomScene(RandomSceneOptions());
  std::vector<int64_t> observations;  // of all points but three, two views
  for (size_t i = 0; i < scene.problem.observations.size(); ++i) {
    const Observation& observation = scene.problem.observations[i];
    if (observation.point >= 3 && observation.view % 2 == 1) {
      observations.push_back(static_cast<int64_t>(i));
    }
  }
  const ProblemSubset part(scene.problem, observations);
  const Estimate estimate = part.Restrict(scene.estimate);
  for (const Pull::Kind kind : {Pull::Kind::kPoint, Pull::Kind::kView}) {
    const Pull pull{kind, 3, {0.2, -0.5, 0.7}};
    const std::optional<Pull> placed = InPart(part, pull);
    ASSERT_TRUE(placed);
    EXPECT_EQ(placed->direction, pull.direction);
    EXPECT_EQ(PositionOf(part.problem(), estimate, *placed),
              PositionOf(scene.problem, scene.estimate, pull));
    EXPECT_FALSE(InPart(part, {kind, 2}));
  }
}

}  // namespace
}  // namespace krot::internal
