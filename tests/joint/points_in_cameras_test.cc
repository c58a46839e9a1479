#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "krot/joint/joint.h"
#include "krot/problem/cost.h"
#include "tests/joint/small_scenes.h"

namespace krot::internal {
namespace {

constexpr double kTinyDepth = 1e-13;

// A second camera where the first one is, which sees the same, and a point in
// front of both at a tiny depth, whose rays differ by a hundred pixels: it has
// a small residual for as long as the cameras are as near to each other.
RandomScene WithAPointInTwoCameras(const RandomScene& scene) {
  RandomScene result;
  const KnownRotationProblem& from = scene.problem;
  KnownRotationProblem& problem = result.problem;
  problem.views = from.views;
  problem.views.push_back(from.views[0]);
  problem.views.back().frame = from.num_frames;
  problem.num_frames = from.num_frames + 1;
  problem.num_points = from.num_points + 1;
  const auto twin = static_cast<int32_t>(from.views.size());
  for (const Observation& o : from.observations) {
    problem.observations.push_back(o);
    if (o.view != 0) continue;
    problem.observations.push_back(o);
    problem.observations.back().view = twin;
  }
  // The twin sees the point a tenth off along x, in its first ray's
  // coordinates.
  const Eigen::Vector2d disparity(0.1, 0);
  Observation near = from.observations[0];
  const Eigen::Matrix2d J = near.E.block<2, 2>(1, 0);
  const Eigen::Vector2d u = -J.inverse() * near.E.block<2, 1>(1, 2);
  near.point = from.num_points;
  near.view = 0;
  problem.observations.push_back(near);
  near.view = twin;
  near.E = RowAtRay(u + disparity, J);
  problem.observations.push_back(near);
  IndexObservations(&problem);

  result.estimate = scene.estimate;
  const Eigen::Vector3d t = scene.estimate.translations[0];
  result.estimate.translations.push_back(
      t + kTinyDepth * Eigen::Vector3d(disparity[0], disparity[1], 0));
  const Eigen::Vector3d ray = u.homogeneous();
  result.estimate.points.push_back(
      from.views[0].cam_from_world_rotation.transpose() *
      (kTinyDepth * ray - t));
  return result;
}

TEST(SolveJoint, LeavesPointsInCamerasWithinSixtyIterations) {
  for (const unsigned seed : {1u, 2u, 3u, 4u, 5u}) {
    SCOPED_TRACE(seed);
    const RandomScene scene = WithAPointInTwoCameras(MakeSmallScene(seed));
    JointOptions options;
    options.relative_gap = 1e-4;
    Estimate estimate = scene.estimate;
    const JointSummary summary =
        SolveJoint(scene.problem, options, {}, &estimate);
    EXPECT_EQ(summary.termination, SolveTermination::kGapReached);
    EXPECT_LE(summary.iterations.size(), 60u);
    ASSERT_TRUE(summary.certificate);
    const CertificateCheck check =
        CheckCertificate(scene.problem, options.norm, *summary.certificate);
    EXPECT_TRUE(check.is_accepted) << check.refusal;
    const double cost = Cost(scene.problem, estimate, options.norm, 1);
    EXPECT_GE(check.proved_bound, (1 - options.relative_gap) * cost);
  }
}

}  // namespace
}  // namespace krot::internal
