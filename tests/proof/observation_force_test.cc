#include "krot/proof/observation_force.h"

#include <limits>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/LU>

#include "krot/proof/pull.h"
#include "tests/problem/random_problem.h"

namespace krot {
namespace {

using Eigen::Vector3d;

// By the inverse, and outwards by a billionth; rows of lengths that differ by
// ten decades would show allowances for rounding that are too large.
TEST(Compliance, IsWhatTheRowsOfTheInverseAreLong) {
  std::mt19937 generator(3);
  std::normal_distribution<double> normal;
  for (int n = 0; n < 200; ++n) {
    Observation observation;
    for (double& entry : observation.E.reshaped()) entry = normal(generator);
    observation.E.row(n % 3) *= 1e10;
    using Matrix3 = Eigen::Matrix<long double, 3, 3>;
    const Matrix3 inverse =
        Matrix3(observation.E.cast<long double>()).inverse().transpose();
    const auto y = static_cast<double>(inverse.bottomRows<2>().norm());
    const auto depth = static_cast<double>(inverse.row(0).norm());
    const Compliance compliance = MakeCompliance(observation);
    EXPECT_GE(static_cast<double>(compliance.y), y);
    EXPECT_LE(static_cast<double>(compliance.y), y * (1 + 2e-9));
    EXPECT_GE(static_cast<double>(compliance.delta_lambda), depth);
    EXPECT_LE(static_cast<double>(compliance.delta_lambda), depth * (1 + 2e-9));
  }
}

TEST(Compliance, IsInfiniteWhereRowsMayDepend) {
  Observation observation;
  observation.E << 1, 2, 3, 4, 5, 6, 7, 8, 9;
  EXPECT_EQ(MakeCompliance(observation).y,
            std::numeric_limits<long double>::infinity());
  EXPECT_EQ(MakeCompliance(observation).delta_lambda,
            std::numeric_limits<long double>::infinity());
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

}  // namespace
}  // namespace krot
