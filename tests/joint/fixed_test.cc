#include "krot/problem/known_rotation_problem.h"

#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "krot/joint/joint.h"
#include "krot/problem/cost.h"
#include "krot/problem/gauge.h"
#include "krot/sweeps/res_int.h"
#include "tests/joint/small_scenes.h"

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Solves with positions that must not move, against the same problem without
// any: fixed frames are one rig with known baselines, fixed points one point
// that is seen through shifted cameras.

constexpr double kFixedGap = 1e-6;

void Fix(int num_frames, int num_points, RandomScene* scene) {
  KnownRotationProblem& problem = scene->problem;
  if (num_frames > 0) problem.fixed_translations.resize(problem.num_frames);
  for (int f = 0; f < num_frames; ++f) {
    problem.fixed_translations[f] = scene->estimate.translations[f];
  }
  if (num_points > 0) problem.fixed_points.resize(problem.num_points);
  for (int k = 0; k < num_points; ++k) {
    problem.fixed_points[k] = scene->estimate.points[k];
  }
}

// Without the observations of which nothing moves.
void DropConstants(RandomScene* scene) {
  KnownRotationProblem& problem = scene->problem;
  std::vector<Observation> kept;
  for (const Observation& o : problem.observations) {
    if (problem.IsFixedPoint(o.point) &&
        problem.IsFixedFrame(problem.views[o.view].frame)) {
      continue;
    }
    kept.push_back(o);
  }
  problem.observations = kept;
  IndexObservations(&problem);
}

// One frame at the world's origin, to be moved, in the place of all fixed ones.
int32_t MergeFrames(const KnownRotationProblem& fixed, RandomScene* merged) {
  KnownRotationProblem& problem = merged->problem;
  const int32_t rig = problem.num_frames++;
  merged->estimate.translations.push_back(Vector3d::Zero());
  for (View& view : problem.views) {
    if (!fixed.IsFixedFrame(view.frame)) continue;
    view.cam_from_rig_translation +=
        view.cam_from_rig_rotation * *fixed.fixed_translations[view.frame];
    view.cam_from_rig_rotation = view.cam_from_world_rotation;
    view.frame = rig;
  }
  return rig;
}

// One point at the world's origin, likewise, the last.
int32_t MergePoints(const KnownRotationProblem& fixed, RandomScene* merged) {
  KnownRotationProblem& problem = merged->problem;
  const int32_t origin = problem.num_points++;
  merged->estimate.points.push_back(Vector3d::Zero());
  std::vector<Observation> kept;
  std::vector<Observation> moved;
  for (Observation o : problem.observations) {
    if (!fixed.IsFixedPoint(o.point)) {
      kept.push_back(o);
      continue;
    }
    View view = problem.views[o.view];
    view.cam_from_rig_translation +=
        view.cam_from_world_rotation * *fixed.fixed_points[o.point];
    o.view = static_cast<int32_t>(problem.views.size());
    o.point = origin;
    problem.views.push_back(view);
    moved.push_back(o);
  }
  kept.insert(kept.end(), moved.begin(), moved.end());
  problem.observations = kept;
  return origin;
}

// Holds the two together: as good as rigid.
void Link(int32_t rig, int32_t origin, KnownRotationProblem* problem) {
  constexpr double kStiffness = 1e8;  // pixels
  for (int axis = 0; axis < 2; ++axis) {
    Matrix3d turn = Matrix3d::Identity();
    if (axis == 1) turn << 0, 1, 0, 0, 0, 1, 1, 0, 0;
    Observation link;
    link.E = RowAtRay({0, 0}, kStiffness * Eigen::Matrix2d::Identity());
    link.view = static_cast<int32_t>(problem->views.size());
    link.point = origin;
    problem->views.push_back({turn, turn, {0, 0, 1}, rig});
    problem->observations.push_back(link);
  }
}

RandomScene WithoutFixed(const RandomScene& scene) {
  RandomScene merged = scene;
  merged.problem.fixed_translations.clear();
  merged.problem.fixed_points.clear();
  const KnownRotationProblem& fixed = scene.problem;
  int32_t rig = -1;
  if (!fixed.fixed_translations.empty()) rig = MergeFrames(fixed, &merged);
  if (!fixed.fixed_points.empty()) {
    const int32_t origin = MergePoints(fixed, &merged);
    if (rig >= 0) Link(rig, origin, &merged.problem);
  }
  IndexObservations(&merged.problem);
  return merged;
}

JointOptions FixedOptions(Norm norm) {
  JointOptions options;
  options.norm = norm;
  options.relative_gap = kFixedGap;
  return options;
}

void ExpectInPlace(const KnownRotationProblem& problem,
                   const Estimate& estimate) {
  for (int32_t f = 0; f < problem.num_frames; ++f) {
    if (!problem.IsFixedFrame(f)) continue;
    EXPECT_EQ(estimate.translations[f], *problem.fixed_translations[f]);
  }
  for (int32_t k = 0; k < problem.num_points; ++k) {
    if (!problem.IsFixedPoint(k)) continue;
    EXPECT_EQ(estimate.points[k], *problem.fixed_points[k]);
  }
}

void ExpectOptimumOfMerged(const RandomScene& scene, Norm norm,
                           double tolerance) {
  Estimate estimate = scene.estimate;
  const JointSummary summary =
      SolveJoint(scene.problem, FixedOptions(norm), {}, &estimate);
  EXPECT_EQ(summary.termination, SolveTermination::kGapReached);
  ExpectInPlace(scene.problem, estimate);
  EXPECT_EQ(summary.cost_final, Cost(scene.problem, estimate, norm, 1));
  ASSERT_TRUE(summary.certificate);
  const CertificateCheck check =
      CheckCertificate(scene.problem, norm, *summary.certificate);
  EXPECT_TRUE(check.is_accepted) << check.refusal;
  EXPECT_GE(check.proved_bound, (1 - kFixedGap) * summary.cost_final);

  RandomScene merged = WithoutFixed(scene);
  const JointSummary expected =
      SolveJoint(merged.problem, FixedOptions(norm), {}, &merged.estimate);
  // One point through shifted cameras has baselines that say nothing.
  if (!IsScaleFree(scene.problem)) {
    EXPECT_EQ(expected.termination, SolveTermination::kGapReached);
  }
  EXPECT_NEAR(summary.cost_final, expected.cost_final,
              tolerance * expected.cost_final);
}

const Norm kNorms[] = {Norm::L1(), Norm::L2(), Norm::LInf()};

TEST(Fixed, FramesGiveTheOptimumOfOneRigInTheirPlace) {
  for (unsigned seed = 0; seed < 6; ++seed) {
    for (const int num_frames : {1, 2, 3}) {
      RandomScene scene = MakeSmallScene(seed);
      Fix(num_frames, 0, &scene);
      ExpectOptimumOfMerged(scene, kNorms[seed % 3], 2 * kFixedGap);
    }
  }
}

TEST(Fixed, FramesOfRigsGiveTheOptimumOfOneRigInTheirPlace) {
  for (unsigned seed = 0; seed < 3; ++seed) {
    RandomScene scene = MakeSmallScene(seed, 0.3);
    Fix(2, 0, &scene);
    ExpectOptimumOfMerged(scene, Norm::L2(), 2 * kFixedGap);
  }
}

TEST(Fixed, PointsGiveTheOptimumOfOnePointSeenThroughShiftedCameras) {
  for (unsigned seed = 0; seed < 6; ++seed) {
    for (const int num_points : {1, 4}) {
      RandomScene scene = MakeSmallScene(seed);
      Fix(0, num_points, &scene);
      ExpectOptimumOfMerged(scene, kNorms[seed % 3], 2 * kFixedGap);
    }
  }
}

TEST(Fixed, FramesAndPointsGiveTheOptimumOfBothHeldTogether) {
  for (unsigned seed = 0; seed < 4; ++seed) {
    RandomScene scene = MakeSmallScene(seed);
    Fix(1 + static_cast<int>(seed % 2), 3, &scene);
    DropConstants(&scene);
    ExpectOptimumOfMerged(scene, Norm::L2(), 1e-5);
  }
}

TEST(Fixed, AllFramesLeaveEveryPointToItself) {
  RandomScene scene = MakeSmallScene(2);
  Fix(scene.problem.num_frames, 0, &scene);
  ExpectOptimumOfMerged(scene, Norm::L2(), 2 * kFixedGap);
}

TEST(Fixed, AllPointsLeaveEveryFrameToItself) {
  RandomScene scene = MakeSmallScene(3);
  Fix(0, scene.problem.num_points, &scene);
  ExpectOptimumOfMerged(scene, Norm::L2(), 2 * kFixedGap);
}

TEST(Fixed, AFrameAloneChangesNoOptimum) {
  const RandomScene free = MakeSmallScene(1);
  RandomScene scene = free;
  Fix(1, 0, &scene);
  EXPECT_TRUE(IsScaleFree(scene.problem));
  Estimate expected = free.estimate;
  Estimate found = scene.estimate;
  EXPECT_NEAR(SolveJoint(scene.problem, FixedOptions(Norm::L2()), {}, &found)
                  .cost_final,
              SolveJoint(free.problem, FixedOptions(Norm::L2()), {}, &expected)
                  .cost_final,
              1e-4);
  ExpectInPlace(scene.problem, found);
}

TEST(Fixed, PositionsElsewhereAreNotProvedByTheCertificate) {
  RandomScene scene = MakeSmallScene(4);
  Fix(2, 0, &scene);
  Estimate estimate = scene.estimate;
  const JointSummary summary =
      SolveJoint(scene.problem, FixedOptions(Norm::L2()), {}, &estimate);
  ASSERT_TRUE(summary.certificate);
  // The sum of its constants is next to zero and linear in the position: it
  // keeps its sign in one direction at most.
  KnownRotationProblem moved = scene.problem;
  *moved.fixed_translations[1] += Vector3d(0.1, 0, 0);
  const bool is_accepted =
      CheckCertificate(moved, Norm::L2(), *summary.certificate).is_accepted;
  *moved.fixed_translations[1] -= Vector3d(0.2, 0, 0);
  const bool is_accepted_on_the_other_side =
      CheckCertificate(moved, Norm::L2(), *summary.certificate).is_accepted;
  EXPECT_FALSE(is_accepted && is_accepted_on_the_other_side);
}

TEST(Fixed, PositionsHoldAStartFromNothing) {
  for (const int num_points : {0, 3}) {
    RandomScene scene = MakeSmallScene(5);
    Fix(2, num_points, &scene);
    DropConstants(&scene);
    Estimate nothing;
    const InitializerSummary summary =
        FindStart(scene.problem, {}, {}, &nothing);
    ASSERT_EQ(summary.termination, SolveTermination::kWithinBound);
    ExpectInPlace(scene.problem, nothing);
    EXPECT_LT(Cost(scene.problem, nothing, Norm::L2(), 1), 100);
  }
}

TEST(Fixed, PositionsThatContradictTheBoundAreProvedToDoSo) {
  RandomScene scene = MakeSmallScene(5);
  Fix(3, 0, &scene);
  *scene.problem.fixed_translations[2] += Vector3d(0.5, 0, 0);
  InitializerOptions options;
  options.max_error = 10;
  Estimate nothing;
  const InitializerSummary summary =
      FindStart(scene.problem, options, {}, &nothing);
  EXPECT_EQ(summary.termination, SolveTermination::kInfeasible);
  EXPECT_GT(summary.lower_bound, 10);
}

TEST(Fixed, PositionsStayInSweeps) {
  RandomScene scene = MakeSmallScene(6);
  Fix(2, 2, &scene);
  Estimate estimate = scene.estimate;
  const ResIntSummary summary = SolveResInt(scene.problem, {}, {}, &estimate);
  EXPECT_LT(summary.cost_final, summary.cost_initial);
  ExpectInPlace(scene.problem, estimate);
}

TEST(Fixed, PositionsHoldTheGauge) {
  for (const int num_frames : {1, 2}) {
    RandomScene scene = MakeSmallScene(7);
    Fix(num_frames, 0, &scene);
    Estimate estimate = scene.estimate;
    const Vector3d centre = *FixedOrigin(scene.problem);
    for (Vector3d& s : estimate.points) s = centre + 2 * (s - centre);
    for (const View& view : scene.problem.views) {
      const Vector3d at_centre = -(view.cam_from_world_rotation * centre);
      Vector3d& t = estimate.translations[view.frame];
      t = at_centre + 2 * (t - at_centre);
    }
    PutFixed(scene.problem, &estimate);
    const Estimate scaled = estimate;
    RestoreGauge(scene.problem, scene.estimate, &estimate);
    ExpectInPlace(scene.problem, estimate);
    const Estimate& expected = num_frames == 1 ? scene.estimate : scaled;
    for (int32_t k = 0; k < scene.problem.num_points; ++k) {
      EXPECT_LT((estimate.points[k] - expected.points[k]).norm(), 1e-12);
    }
    for (int32_t f = 0; f < scene.problem.num_frames; ++f) {
      EXPECT_LT((estimate.translations[f] - expected.translations[f]).norm(),
                1e-12);
    }
  }
}

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
