#include "krot/adjust/adjustment_blocks.h"

#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "krot/model.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// x -> scale rotation x + shift, on everything but the sensors' rotations.
void Move(double scale, const Matrix3d& rotation, const Vector3d& shift,
          AdjustmentBlocks* blocks) {
  for (PoseBlock& frame : blocks->frames) {
    const Matrix3d moved = RotationOf(frame) * rotation.transpose();
    const Vector3d t = scale * TranslationOf(frame) - moved * shift;
    const Eigen::Quaterniond q(moved);
    frame = {q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z()};
  }
  for (PoseBlock& sensor : blocks->sensors) {
    for (int i = 4; i < 7; ++i) sensor[i] *= scale;
  }
  for (Vector3d& point : blocks->points) {
    point = scale * (rotation * point) + shift;
  }
}

Model Scene(int sensors_per_rig) {
  SceneOptions options = SceneOf(6, 50, 6, 1);
  options.sensors_per_rig = sensors_per_rig;
  return SynthesizeScene(options).model;
}

void ExpectNear(const AdjustmentBlocks& a, const AdjustmentBlocks& b) {
  for (size_t f = 0; f < a.frames.size(); ++f) {
    EXPECT_LT((RotationOf(a.frames[f]) - RotationOf(b.frames[f])).norm(),
              1e-12);
    EXPECT_LT((TranslationOf(a.frames[f]) - TranslationOf(b.frames[f])).norm(),
              1e-12);
  }
  for (size_t s = 0; s < a.sensors.size(); ++s) {
    EXPECT_LT(
        (TranslationOf(a.sensors[s]) - TranslationOf(b.sensors[s])).norm(),
        1e-12);
  }
  for (size_t k = 0; k < a.points.size(); ++k) {
    EXPECT_LT((a.points[k] - b.points[k]).norm(), 1e-11);
  }
}

TEST(RestoreSimilarity, UndoesASimilarityOfTheWholeModel) {
  const Matrix3d rotation =
      Eigen::AngleAxisd(0.3, Vector3d(1, 2, -1).normalized())
          .toRotationMatrix();
  for (const int sensors_per_rig : {1, 3}) {
    const AdjustmentBlocks before =
        MakeAdjustmentBlocks(Scene(sensors_per_rig), 2);
    AdjustmentBlocks after = before;
    Move(1.7, rotation, Vector3d(1, -2, 0.5), &after);
    RestoreSimilarity({}, before, &after);
    ExpectNear(after, before);
  }
}

TEST(RestoreSimilarity, IsThatOfTheOthersWhereACameraRunsAway) {
  const Matrix3d rotation =
      Eigen::AngleAxisd(0.3, Vector3d(1, 2, -1).normalized())
          .toRotationMatrix();
  const AdjustmentBlocks before = MakeAdjustmentBlocks(Scene(1), 2);
  AdjustmentBlocks after = before;
  // Turned by half a circle, and a million times as far away.
  PoseBlock& runaway = after.frames[2];
  std::swap(runaway[0], runaway[1]);
  std::swap(runaway[2], runaway[3]);
  for (int i = 4; i < 7; ++i) runaway[i] *= 1e6;
  Move(1.7, rotation, Vector3d(1, -2, 0.5), &after);
  RestoreSimilarity({}, before, &after);
  AdjustmentBlocks others = after;
  others.frames[2] = before.frames[2];
  ExpectNear(others, before);
  EXPECT_GT(TranslationOf(after.frames[2]).norm(), 1e5);
}

TEST(RestoreSimilarity, LeavesTheScaleToConstantBaselines) {
  const AdjustmentBlocks before = MakeAdjustmentBlocks(Scene(3), 2);
  AdjustmentBlocks after = before;
  Move(1, Matrix3d::Identity(), Vector3d(1, -2, 0.5), &after);
  const AdjustmentBlocks scaled = [&] {
    AdjustmentBlocks blocks = after;
    Move(2, Matrix3d::Identity(), Vector3d::Zero(), &blocks);
    blocks.sensors = before.sensors;
    return blocks;
  }();
  BundleAdjustmentOptions options;
  options.refine_sensor_from_rig = false;
  AdjustmentBlocks restored = scaled;
  RestoreSimilarity(options, before, &restored);
  const double distance = (restored.points[0] - restored.points[1]).norm();
  EXPECT_NEAR(distance, (scaled.points[0] - scaled.points[1]).norm(), 1e-12);
  // The same frames without a fixed baseline get their size back.
  RestoreSimilarity({}, before, &restored);
  EXPECT_NEAR((restored.points[0] - restored.points[1]).norm(),
              (before.points[0] - before.points[1]).norm(), 1e-12);
}

TEST(RestoreSimilarity, DoesNothingWherePointsOrFramesAreHeldStill) {
  const AdjustmentBlocks before = MakeAdjustmentBlocks(Scene(1), 2);
  AdjustmentBlocks moved = before;
  Move(2, Matrix3d::Identity(), Vector3d(1, 0, 0), &moved);
  for (const bool hold_points : {false, true}) {
    BundleAdjustmentOptions options;
    options.refine_points3D = !hold_points;
    options.refine_rig_from_world = hold_points;
    AdjustmentBlocks after = moved;
    RestoreSimilarity(options, before, &after);
    ExpectNear(after, moved);
  }
}

}  // namespace
}  // namespace krot::internal
