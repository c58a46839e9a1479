#include <limits>

#include <gtest/gtest.h>

#include "krot/verify/force_checker.h"
#include "tests/problem/random_problem.h"

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Rotations are known to kRotationError: whatever is computed from them must
// allow for what another rotation as near gives. Offsets whose entries cancel
// are those that a wrong sum of absolute values would lose.
const Vector3d kFar(1e6, -1e6, 0);
const Matrix3d kTurned =
    (Matrix3d() << 1, -1e-15, 0, 1e-15, 1, 0, 0, 0, 1).finished();

View SensorAt(const Vector3d& cam_from_rig_translation, int32_t frame) {
  return {Matrix3d::Identity(), Matrix3d::Identity(), cam_from_rig_translation,
          frame};
}

void Turn(View* view) {
  view->cam_from_world_rotation = kTurned;
  view->cam_from_rig_rotation = kTurned;
}

// Two sensors see one point at rays that differ; in one place, far from the
// rig's origin, or elsewhere.
KnownRotationProblem TwoSensors(const Vector3d& first = kFar,
                                const Vector3d& second = kFar) {
  KnownRotationProblem problem;
  problem.num_frames = problem.num_points = 1;
  problem.views = {SensorAt(first, 0), SensorAt(second, 0)};
  const Eigen::Matrix2d J = 1000 * Eigen::Matrix2d::Identity();
  problem.observations = {{RowAtRay({-0.001, 0}, J), 0, 0},
                          {RowAtRay({0.001, 0}, J), 1, 0}};
  IndexObservations(&problem);
  return problem;
}

Certificate OfOppositeForces() {
  return {1, 1e-9, {{0, 1, {-1, 0}}, {1, 1, {1, 0}}}};
}

TEST(RoundingAllowance, CoversOffsetsOfSensorsThatAreFarFromTheirFrame) {
  const Certificate certificate = OfOppositeForces();
  const auto constants = [&](const KnownRotationProblem& problem) {
    ForceChecker checker(problem, Norm::L2(), certificate);
    EXPECT_FALSE(checker.Balance());
    return checker.SumConstants();
  };
  const Vector3d here = Vector3d::Zero();
  for (KnownRotationProblem& problem :
       std::vector{TwoSensors(), TwoSensors(kFar, here), TwoSensors(here, kFar),
                   TwoSensors(kFar, -kFar)}) {
    for (const int turned : {0, 1}) {
      const ForceChecker::Constants before = constants(problem);
      View& view = problem.views[turned];
      const View original = view;
      Turn(&view);
      const ForceChecker::Constants after = constants(problem);
      view = original;
      EXPECT_LE(std::abs(after.value - before.value), before.error);
    }
  }
  KnownRotationProblem problem = TwoSensors();
  EXPECT_EQ(constants(problem).value, 0);
  Turn(&problem.views[1]);
  EXPECT_GT(std::abs(constants(problem).value), 1e-7L);
}

TEST(RoundingAllowance, CoversOffsetsOfWhatIsPulled) {
  const Certificate certificate = OfOppositeForces();
  const Pull pull{Pull::Kind::kView, 1, {2e4, -1e4, -1e4}};
  const auto constants = [&](const KnownRotationProblem& problem,
                             const std::vector<Pull>& pulls) {
    ForceChecker checker(problem, Norm::L2(), certificate, pulls);
    EXPECT_FALSE(checker.Balance());
    return checker.SumConstants();
  };
  KnownRotationProblem problem = TwoSensors();
  const auto by_pull = [&](auto part) {
    return constants(problem, {pull}).*part - constants(problem, {}).*part;
  };
  const auto allowed = by_pull(&ForceChecker::Constants::error);
  problem.views[1].cam_from_rig_rotation = kTurned;
  const auto change = std::abs(by_pull(&ForceChecker::Constants::value));
  EXPECT_GT(change, 1e-6L);
  EXPECT_LE(change, allowed);
}

TEST(RoundingAllowance, CoversWhereFixedFramesAndPointsStand) {
  KnownRotationProblem problem;
  problem.num_frames = problem.num_points = 2;
  problem.views = {SensorAt(Vector3d::Zero(), 0), SensorAt(kFar, 1)};
  problem.fixed_translations = {Vector3d(-kFar), Vector3d(-3 * kFar)};
  problem.fixed_points = {Vector3d(3 * kFar), std::nullopt};
  const Eigen::Matrix2d J = Eigen::Matrix2d::Identity();
  problem.observations = {{RowAtRay({0, 0}, J), 0, 0},
                          {RowAtRay({0, 0}, J), 1, 1}};
  IndexObservations(&problem);

  const FixedConstants fixed(problem);
  EXPECT_EQ(fixed.origin(), kFar.cast<FixedConstants::Real>());
  EXPECT_FALSE(fixed.IsAwayFromOrigin(0));
  ASSERT_TRUE(fixed.IsAwayFromOrigin(1));
  View turned = problem.views[1];
  Turn(&turned);
  const auto expect_covered = [](const FixedConstants::Part& before,
                                 const FixedConstants::Part& after) {
    const auto change = (after.x_cam - before.x_cam).cwiseAbs().sum();
    EXPECT_GT(change, 0);
    EXPECT_LE(change, kRotationError * before.size);
  };
  expect_covered(fixed.OfFrame(problem.views[1]), fixed.OfFrame(turned));
  expect_covered(fixed.OfPoint(problem.views[1], 0), fixed.OfPoint(turned, 0));
  EXPECT_EQ(fixed.OfPoint(problem.views[1], 1).size, 0);
}

// A translation is lost beside the place of its sensor, and the place of one
// sensor beside that of another.
TEST(RoundingAllowance, CoversSumsOfTranslationsThatDifferInSize) {
  const Certificate certificate = OfOppositeForces();
  const KnownRotationProblem rig = TwoSensors({1, 0, 0}, {0x1p70, -0x1p70, 0});
  ForceChecker checker(rig, Norm::L2(), certificate);
  ASSERT_FALSE(checker.Balance());
  EXPECT_GE(checker.SumConstants().error, 1000);  // the force along x, times 1

  KnownRotationProblem problem = TwoSensors(Vector3d::Zero(), {0x1p70, 0, 0});
  problem.num_frames = 2;
  problem.views[1].frame = 1;
  problem.fixed_translations = {Vector3d::Zero(), Vector3d(1, 0, 0)};
  IndexObservations(&problem);
  const FixedConstants::Part part =
      FixedConstants(problem).OfFrame(problem.views[1]);
  ASSERT_EQ(part.x_cam.x(), 0x1p70L);
  EXPECT_GE(part.size * kRotationError, 1);
}

TEST(FixedConstants, CountsFromTheFirstFixedPointWhereNoFrameIsFixed) {
  KnownRotationProblem problem = TwoSensors();
  problem.num_points = 4;
  problem.fixed_points = {std::nullopt, Vector3d(7, -11, 13), Vector3d(1, 2, 3),
                          std::nullopt};
  IndexObservations(&problem);
  const FixedConstants fixed(problem);
  EXPECT_EQ(fixed.origin(), Vector3d(7, -11, 13).cast<FixedConstants::Real>());
  EXPECT_EQ(fixed.origin_size(), 0);
  EXPECT_FALSE(fixed.IsAwayFromOrigin(0));
  const FixedConstants::Part nothing = fixed.OfPoint(problem.views[0], 1);
  EXPECT_EQ(nothing.x_cam, FixedConstants::Vector3::Zero());
  EXPECT_EQ(nothing.size, 0);
  const FixedConstants::Part away = fixed.OfPoint(problem.views[0], 2);
  EXPECT_EQ(away.x_cam, FixedConstants::Vector3(-6, 13, -10));
  EXPECT_EQ(away.size, 29);
}

}  // namespace
}  // namespace krot::internal
