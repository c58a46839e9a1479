#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "krot/camera/camera_model.h"
#include "krot/conic/interior_point.h"
#include "krot/convert/build_problem.h"
#include "krot/convert/reprojection.h"
#include "krot/joint/joint.h"
#include "krot/pipeline/solve_model.h"
#include "krot/pipeline/stages.h"
#include "krot/proof/certificate.h"
#include "krot/synthetic/scene.h"
#include "tests/camera/random_camera.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

// Every camera model, panoramas included, against pinholes.

// Rows of the same bearings and the same noise, seen by pinholes: each
// observation by its own, which looks along the ray of the point's true place
// and has the lens' scale there, by central differences. With e the noise,
// v / w = J q - e in coordinates q of the plane across that ray.
void SeeByPinholes(const Model& model, const Estimate& truth,
                   BuiltProblem* built) {
  constexpr double kStep = 1e-5;
  const Reprojection reprojection(model, *built);
  for (size_t i = 0; i < built->pixels.size(); ++i) {
    const int64_t index = static_cast<int64_t>(i);
    const Intrinsics& source = reprojection.SourceOf(index);
    const auto error_at = [&](const Eigen::Vector3d& ray) {
      return ProjectionError(source, built->pixels[i], ray).value();
    };
    const Eigen::Vector3d n = reprojection.InCamera(truth, index).normalized();
    Eigen::Matrix<double, 2, 3> B;
    B.row(0) = n.unitOrthogonal();
    B.row(1) = n.cross(Eigen::Vector3d(B.row(0)));
    Eigen::Matrix2d J;
    for (int k = 0; k < 2; ++k) {
      const Eigen::Vector3d h = kStep * B.row(k).transpose();
      J.col(k) = (error_at(n + h) - error_at(n - h)) / (2 * kStep);
    }
    auto& E = built->problem.observations[i].E;
    E.row(0) = n.transpose();
    E.bottomRows<2>() = J * B + error_at(n) * n.transpose();
  }
}

class EveryCamera : public ::testing::TestWithParam<int> {};

INSTANTIATE_TEST_SUITE_P(Models, EveryCamera, ::testing::Range(0, 18),
                         [](const auto& test) {
                           return ModelName(test.param);
                         });

TEST_P(EveryCamera, ReachesTheMaximumThatPinholesReachWithTheSameNoise) {
  SceneOptions options = SceneOf(8, 150, 4, 1);
  options.camera_model_id = GetParam();
  options.focal_length_factor = 0.5;  // up to 81 degrees off the axis
  options.start_translation_noise = 0.01;
  options.start_point_noise = 0.01;
  const SyntheticScene scene = SynthesizeScene(options);
  const SolveSummary summary = SolveModel(scene.model, {}).summary;
  EXPECT_EQ(summary.termination, SolveTermination::kGapReached);
  EXPECT_FALSE(summary.is_given_back);

  BuiltProblem built = BuildProblem(scene.ground_truth, {});
  ASSERT_EQ(built.problem.observations.size(),
            static_cast<size_t>(summary.num_observations));
  SeeByPinholes(scene.ground_truth, built.start, &built);
  Estimate estimate = built.start;
  const double expected =
      SolveJoint(built.problem, {}, {}, &estimate).cost_final;
  EXPECT_GT(expected, 1);
  EXPECT_NEAR(summary.cost_final, expected, 0.01 * expected);
}

// Where thousands of observations set the maximum, or are not told from those
// that do: the certificate is of rows at one estimate, the proof of those at
// another.
TEST(ProveRows, RepairsTheMultipliersOfALargeSupportForNewRows) {
  SceneOptions scene = SceneOf(40, 4000, 10, 1);
  scene.start_translation_noise = 0.003;
  scene.start_point_noise = 0.003;
  const Model model = SynthesizeScene(scene).model;
  const Norm norm = Norm::L2();
  BuiltProblem built = BuildProblem(model, {});
  const Reprojection reprojection(model, built);
  ASSERT_FALSE(reprojection.IsLinear());

  Estimate estimate = built.start;
  reprojection.TakeRows(estimate, 1, &built.problem);
  InteriorPointOptions options;
  options.smallest_gap = 1e-2;
  std::vector<Multiplier> multipliers;
  MinimizeJointly(built.problem, options, {}, &estimate, &multipliers);
  const double cost = reprojection.TrueCost(estimate, norm, 1);
  const double sufficient = 0.97 * cost;
  const std::optional<Certificate> found = RepairCertificate(
      built.problem, norm, estimate, multipliers, {sufficient}, {});
  ASSERT_TRUE(found);
  ASSERT_GT(found->observations.size(), 20000U);
  Context threads;
  threads.num_threads = 3;
  const std::optional<Certificate> again = RepairCertificate(
      built.problem, norm, estimate, multipliers, {sufficient}, threads);
  ASSERT_TRUE(again);
  EXPECT_EQ(again->lower_bound, found->lower_bound);

  reprojection.TakeRows(estimate, 1, &built.problem);
  SolveModelOptions solve;
  solve.norm = norm;
  const std::optional<PixelCertificate> proof =
      ProveRows(model, built, estimate, solve, {*found, {}}, sufficient, {});
  ASSERT_TRUE(proof);
  const PixelCertificateCheck check =
      CheckPixelCertificate(model, built, norm, *proof, {});
  EXPECT_TRUE(check.is_accepted) << check.refusal;
  EXPECT_GE(check.lower_bound, 0.96 * cost);
  EXPECT_LE(check.lower_bound, cost);
}

}  // namespace
}  // namespace krot::internal
