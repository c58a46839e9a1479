// What the public headers promise, by them alone.

#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "krot/adjust.h"
#include "krot/certificate.h"
#include "krot/check.h"
#include "krot/compare.h"
#include "krot/known_rotation.h"
#include "krot/minimax.h"
#include "krot/outliers.h"
#include "krot/solve.h"
#include "krot/tolerances.h"

namespace krot {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

const Model& Sample() {
  static const Model model = ReadModel(KROT_SAMPLE);
  return model;
}

// Cameras around points; every ray is off by up to a hundredth.
KnownRotations Ring(int num_cameras, int num_points) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> in_cube(-1, 1);
  KnownRotations ring;
  ring.num_points = num_points;
  for (int c = 0; c < num_cameras; ++c) {
    ring.rotations.push_back(
        Eigen::AngleAxisd(2 * M_PI * c / num_cameras, Vector3d::UnitY())
            .toRotationMatrix());
  }
  for (int k = 0; k < num_points; ++k) {
    const Vector3d x(in_cube(random), in_cube(random), in_cube(random));
    for (int c = 0; c < num_cameras; ++c) {
      const Vector3d in_camera = ring.rotations[c] * x + Vector3d(0, 0, 5);
      const Vector2d noise(in_cube(random), in_cube(random));
      ring.observations.push_back(
          {c, k, in_camera.hnormalized() + 0.01 * noise});
    }
  }
  return ring;
}

double LargestError(const KnownRotations& problem,
                    const KnownRotationsResult& result) {
  double largest = 0;
  for (const RayObservation& seen : problem.observations) {
    const Vector3d in_camera =
        problem.rotations[seen.camera] * result.points[seen.point] +
        result.translations[seen.camera];
    EXPECT_GT(in_camera.z(), 0);
    const double f =
        problem.focal_lengths.empty() ? 1 : problem.focal_lengths[seen.camera];
    largest =
        std::max(largest, f * (in_camera.hnormalized() - seen.ray).norm());
  }
  return largest;
}

TEST(SolveKnownRotations, ReachesItsBoundWithTheErrorsThatItTells) {
  const KnownRotations ring = Ring(6, 30);
  const KnownRotationsResult result = SolveKnownRotations(ring);
  EXPECT_EQ(result.termination, KnownRotationsTermination::kGapReached);
  EXPECT_NEAR(result.max_error, LargestError(ring, result),
              1e-9 * result.max_error);
  EXPECT_GT(result.lower_bound, 0);
  EXPECT_LE(result.lower_bound, result.max_error);
  EXPECT_GE(result.lower_bound, (1 - 1e-4) * result.max_error);
}

TEST(SolveKnownRotations, DependsNeitherOnTheOrderNorOnTheUnitOfRays) {
  KnownRotations ring = Ring(5, 20);
  const KnownRotationsResult first = SolveKnownRotations(ring);
  std::reverse(ring.observations.begin(), ring.observations.end());
  ring.focal_lengths.assign(5, 1000);
  const KnownRotationsResult second = SolveKnownRotations(ring);
  EXPECT_NEAR(second.max_error, 1000 * first.max_error,
              3e-4 * second.max_error);
}

TEST(SolveKnownRotations, RefusesWhatIsOutOfRangeByName) {
  const auto refusal = [](const KnownRotations& problem) -> std::string {
    try {
      SolveKnownRotations(problem);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  KnownRotations ring = Ring(3, 5);
  ring.observations[7].camera = 3;
  EXPECT_EQ(refusal(ring), "observations[7].camera = 3, must be in [0, 3)");
  ring = Ring(3, 5);
  ring.observations[7].point = -1;
  EXPECT_EQ(refusal(ring), "observations[7].point = -1, must be in [0, 5)");
  ring = Ring(3, 5);
  ring.rotations[1] *= 2;
  EXPECT_NE(refusal(ring).find("rotations[1]"), std::string::npos);
  ring = Ring(3, 5);
  ring.focal_lengths = {1, 1, 0};
  EXPECT_NE(refusal(ring).find("focal_lengths[2]"), std::string::npos);
}

TEST(SolveKnownRotations, OfNothingIsNothing) {
  const KnownRotationsResult result = SolveKnownRotations({});
  EXPECT_TRUE(result.points.empty());
  EXPECT_EQ(result.lower_bound, 0);
}

TEST(SolveKnownRotations, SaysThatNoEstimateMeetsABoundThatIsTooLow) {
  KnownRotationsOptions options;
  options.init_max_error = 1e-4;
  const KnownRotationsResult result = SolveKnownRotations(Ring(6, 30), options);
  EXPECT_EQ(result.termination, KnownRotationsTermination::kInfeasible);
  EXPECT_GE(result.lower_bound, 1e-4);
  EXPECT_TRUE(result.points.empty());
}

// The error of x seen by a camera, whichever of the two is the unknown.
TEST(Residuals, OfPointAndCameraAreTheReprojectionError) {
  const RigidTransform cam_from_world = {
      Eigen::AngleAxisd(0.3, Vector3d(1, 2, 3).normalized()).toRotationMatrix(),
      {0.1, -0.2, 0.5}};
  const Vector3d point(0.4, 0.3, 3);
  const Vector2d ray(0.01, 0.02);
  const double error =
      800 * ((cam_from_world * point).hnormalized() - ray).norm();
  EXPECT_NEAR(
      ResidualValue(PointResidual(cam_from_world, ray, 800), point, Norm::L2()),
      error, 1e-9);
  EXPECT_NEAR(
      ResidualValue(CameraResidual(cam_from_world.rotation, point, ray, 800),
                    cam_from_world.translation, Norm::L2()),
      error, 1e-9);
}

TEST(MinimizeLargestResidual, HasOneOptimumByEitherSettings) {
  const KnownRotations ring = Ring(6, 1);
  std::vector<Residual> residuals;
  for (const RayObservation& seen : ring.observations) {
    residuals.push_back(PointResidual(
        {ring.rotations[seen.camera], Vector3d(0, 0, 5)}, seen.ray, 1000));
  }
  FastDescentOptions options;
  Vector3d fast = Vector3d::Zero();
  const DescentSummary by_newton =
      MinimizeLargestResidual(residuals, options, Norm::L2(), &fast);
  options.settings = FastDescentSettings::kPaper;
  Vector3d paper = Vector3d::Zero();
  const DescentSummary by_balls =
      MinimizeLargestResidual(residuals, options, Norm::L2(), &paper);
  EXPECT_LT(by_balls.cost, by_balls.cost_initial);
  EXPECT_NEAR(by_newton.cost, by_balls.cost, 1e-2 * by_balls.cost);
  // No point nearby is better.
  std::mt19937 random(3);
  std::normal_distribution<double> off(0, 1e-3);
  for (int trial = 0; trial < 1000; ++trial) {
    const Vector3d x = fast + Vector3d(off(random), off(random), off(random));
    double cost = 0;
    for (const Residual& residual : residuals) {
      cost = std::max(cost, ResidualValue(residual, x, Norm::L2()));
    }
    EXPECT_GE(cost, (1 - 1e-9) * by_newton.cost);
  }
}

TEST(Solve, ProvesItsResultByACertificateOfTheModelAlone) {
  SolveOptions options;
  options.write_certificate = true;
  options.finish_by_least_squares = false;
  int num_calls = 0;
  options.on_progress = [&](const SolveState&) { ++num_calls; };
  const SolveResult result = Solve(Sample(), options);
  EXPECT_EQ(result.termination, SolveTermination::kGapReached);
  EXPECT_GT(num_calls, 0);
  ASSERT_TRUE(result.lower_bound && result.certificate);
  const auto errors = Summarize(PixelErrors(result.model));
  EXPECT_EQ(errors.max, result.errors_after.max);
  EXPECT_LE(*result.lower_bound, errors.max);
  EXPECT_GE(*result.lower_bound, (1 - 1e-4) * errors.max);
  const CertificateVerdict verdict =
      VerifyCertificate(Sample(), *result.certificate);
  EXPECT_TRUE(verdict.is_accepted) << verdict.refusal;
  EXPECT_DOUBLE_EQ(verdict.lower_bound, *result.lower_bound);
}

TEST(Solve, GivesBackTheBestSoFarWhenItIsCancelled) {
  CancelFlag stop{false};
  Context context;
  context.cancel = &stop;
  SolveOptions options;
  options.on_progress = [&](const SolveState&) { stop = true; };
  const SolveResult result = Solve(Sample(), options, context);
  EXPECT_EQ(result.termination, SolveTermination::kInterrupted);
  EXPECT_LE(result.errors_after.max, result.errors_before.max);
  EXPECT_NO_THROW(ValidateModel(result.model));
}

TEST(Solve, HandsItsOptionsOn) {
  SolveOptions options;
  options.norm = Norm::LInf();
  const SolveResult of_inf = Solve(Sample(), options);
  options.norm.p = 0.5;
  EXPECT_THROW(Solve(Sample(), options), std::invalid_argument);
  options = {};
  options.fixed.frames.assign(Sample().frames.size(), 1);
  const SolveResult fixed = Solve(Sample(), options);
  for (size_t n = 0; n < fixed.model.images.size(); ++n) {
    EXPECT_EQ(fixed.model.images[n].cam_from_world.translation,
              Sample().images[n].cam_from_world.translation);
  }
  options = {};
  options.min_track_length = 3;
  const SolveResult longer = Solve(Sample(), options);
  EXPECT_LT(longer.num_points, of_inf.num_points);
  EXPECT_GT(longer.left_out[static_cast<int>(LeftOut::kShortTrack)], 0);
}

TEST(Triangulate, LeavesTheCameras) {
  const SolveResult result = Triangulate(Sample());
  EXPECT_FALSE(result.lower_bound);
  EXPECT_LT(result.errors_after.max, result.errors_before.max);
  for (size_t n = 0; n < result.model.images.size(); ++n) {
    EXPECT_EQ(result.model.images[n].cam_from_world.translation,
              Sample().images[n].cam_from_world.translation);
  }
}

TEST(RemoveOutliers, BracketsHowManyHaveToGo) {
  OutlierOptions options;
  options.max_error = 0.8 * Solve(Sample()).lowest_max_error;
  const OutlierResult result = RemoveOutliers(Sample(), options);
  EXPECT_TRUE(result.is_within);
  EXPECT_LE(result.errors_after.max, 1.0001 * *options.max_error);
  EXPECT_GT(result.num_proved, 0);
  EXPECT_LE(result.num_proved, static_cast<int64_t>(result.removed.size()));
  ASSERT_TRUE(result.conflicts);
  const ConflictVerdict verdict = VerifyConflicts(Sample(), *result.conflicts);
  EXPECT_TRUE(verdict.is_accepted) << verdict.refusal;
  EXPECT_EQ(verdict.num_conflicts, result.num_proved);
}

TEST(FindTolerances, BoxesHoldThePositionsOfTheModel) {
  TolerancesOptions options;
  options.max_error = 1.5 * Solve(Sample()).lowest_max_error;
  options.tolerance = 0.1;
  options.images = {5};
  const TolerancesResult result = FindTolerances(Sample(), options);
  EXPECT_EQ(result.termination, ToleranceTermination::kDone);
  ASSERT_EQ(result.boxes.size(), 1u);
  const ToleranceBox& box = result.boxes[0];
  EXPECT_EQ(box.name, Sample().images[5].name);
  for (int k = 0; k < 3; ++k) {
    EXPECT_LE(box.box.low[k].reached, box.position[k]);
    EXPECT_GE(box.box.high[k].reached, box.position[k]);
    ASSERT_TRUE(box.box.low[k].proved && box.box.high[k].proved);
    EXPECT_LE(*box.box.low[k].proved, box.box.low[k].reached);
    EXPECT_GE(*box.box.high[k].proved, box.box.high[k].reached);
  }
}

TEST(Adjust, LowersTheSumOfSquaresBelowItsCap) {
  AdjustOptions options;
  options.max_error_factor = 1.2;
  const AdjustResult result = Adjust(Sample(), options);
  ASSERT_TRUE(result.max_error);
  EXPECT_LT(result.errors_after.max, *result.max_error);
  EXPECT_LT(result.errors_after.rms, result.errors_start.rms);
}

TEST(CompareModels, OfAModelAndItselfMovedIsNothing) {
  Similarity moved;
  moved.scale = 2;
  moved.translation = {1, 2, 3};
  CompareModelsOptions options;
  options.alignment = AlignmentKind::kSimilarity;
  const auto same =
      CompareModels(Sample(), TransformModel(Sample(), moved), options);
  ASSERT_TRUE(same);
  EXPECT_EQ(same->num_shared_poses,
            static_cast<int64_t>(Sample().images.size()));
  EXPECT_LT(same->center.max, 1e-9 * same->scene_radius);
}

TEST(CureModel, RemovesWhatCheckModelCallsWrong) {
  const ModelCheck check = CheckModel(Sample());
  ASSERT_TRUE(check.sigma_px);
  const Model cured = CureModel(Sample(), check).model;
  EXPECT_LE(cured.track_elements.size(),
            Sample().track_elements.size() - check.observations.size());
  EXPECT_NO_THROW(ValidateModel(cured));
}

TEST(WriteCertificate, GivesBackWhatItTook) {
  const std::string path = ::testing::TempDir() + "/public_face.json";
  WriteCertificate("{}", path);
  EXPECT_EQ(ReadCertificate(path), "{}");
  EXPECT_THROW(VerifyCertificate(Sample(), "{}"), ModelError);
  EXPECT_THROW(WriteCertificate("{}", "/proc/nothing/here.json"), WriteError);
}

}  // namespace
}  // namespace krot
