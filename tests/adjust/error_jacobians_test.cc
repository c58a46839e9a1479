#include "krot/adjust/adjustment_blocks.h"

#include <string>

#include <gtest/gtest.h>

#include "krot/camera/camera_model.h"
#include "tests/adjust/small_blocks.h"

// The oracle knows no derivative: central differences of ProjectErrors along
// motions of every unknown.

namespace krot::internal {
namespace {

using Eigen::Vector3d;

constexpr double kNoCap = 1e300;

std::vector<ProjectedError> ErrorsAlong(const AdjustmentColumns& columns,
                                        const AdjustmentBlocks& blocks,
                                        const BlockVector& direction,
                                        double step) {
  AdjustmentBlocks moved = blocks;
  MoveAlong(columns, blocks, direction, step, &moved);
  return *ProjectErrors(moved, kNoCap, 1);
}

class EveryCameraMoves : public ::testing::TestWithParam<int> {};

TEST_P(EveryCameraMoves, AsTheDerivativesOfItsErrorsAndDepthsSay) {
  BundleAdjustmentOptions options;
  options.refine_principal_point = true;
  const AdjustmentBlocks blocks = SmallBlocks(GetParam());
  const AdjustmentColumns columns(options, blocks);
  ErrorJacobians jacobians(columns, blocks);
  jacobians.Evaluate(blocks, 1);
  // Each block by itself, and all points at once.
  for (int32_t moved = 0; moved <= columns.num_blocks; ++moved) {
    BlockVector direction =
        RandomDirection(blocks.points.size(), columns.num_blocks);
    for (Vector3d& x : direction.points) {
      if (moved < columns.num_blocks) x.setZero();
    }
    for (int32_t b = 0; b < columns.num_blocks; ++b) {
      if (b != moved) direction.frames[b].setZero();
    }
    constexpr double kStep = 1e-6;
    const auto forth = ErrorsAlong(columns, blocks, direction, kStep);
    const auto back = ErrorsAlong(columns, blocks, direction, -kStep);
    for (size_t i = 0; i < blocks.observations.size(); ++i) {
      const int32_t k = blocks.observations[i].point;
      Vector3d slope = jacobians.by_point(i) * direction.points[k];
      for (int n = 0; n < jacobians.num_blocks(i); ++n) {
        slope +=
            jacobians.by_block(i, n) * direction.frames[jacobians.blocks(i)[n]];
      }
      Vector3d expected;
      expected << (forth[i].r - back[i].r) / (2 * kStep),
          (forth[i].w - back[i].w) / (2 * kStep);
      EXPECT_LT((slope - expected).norm(), 1e-5 * (1 + expected.norm()))
          << "block " << moved << ", observation " << i;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Models, EveryCameraMoves, ::testing::Range(0, 17),
                         [](const auto& test) {
                           return std::string(
                               FindCameraModel(test.param)->name);
                         });

TEST(MoveAlong, KeepsTheBitsOfWhatIsHeldStill) {
  const AdjustmentBlocks blocks = SmallBlocks(4);
  const auto move = [&](const BundleAdjustmentOptions& options) {
    const AdjustmentColumns columns(options, blocks);
    AdjustmentBlocks moved = blocks;
    MoveAlong(columns, blocks,
              RandomDirection(blocks.points.size(), columns.num_blocks), 1e-3,
              &moved);
    return moved;
  };
  BundleAdjustmentOptions options;
  options.refine_points3D = false;
  EXPECT_EQ(move(options).points, blocks.points);
  EXPECT_NE(move(options).frames, blocks.frames);
  EXPECT_NE(move(options).sensors, blocks.sensors);
  options.refine_sensor_from_rig = false;
  EXPECT_EQ(move(options).sensors, blocks.sensors);
  options.constant_rig_from_world_rotation = true;
  for (size_t f = 0; f < blocks.frames.size(); ++f) {
    const PoseBlock moved = move(options).frames[f];
    for (int i = 0; i < 4; ++i) EXPECT_EQ(moved[i], blocks.frames[f][i]);
    EXPECT_NE(moved, blocks.frames[f]);
  }
  options.refine_rig_from_world = false;
  EXPECT_EQ(move(options).frames, blocks.frames);
  options.refine_extra_params = false;
  for (size_t c = 0; c < blocks.cameras.size(); ++c) {
    const std::vector<double> moved = move(options).cameras[c];
    EXPECT_NE(moved[0], blocks.cameras[c][0]);
    EXPECT_NE(moved[1], blocks.cameras[c][1]);
    for (size_t i = 2; i < moved.size(); ++i) {
      EXPECT_EQ(moved[i], blocks.cameras[c][i]);
    }
  }
  options.refine_focal_length = false;
  EXPECT_EQ(move(options).cameras, blocks.cameras);
  EXPECT_EQ(AdjustmentColumns(options, blocks).num_unknowns, 0);
}

}  // namespace
}  // namespace krot::internal
