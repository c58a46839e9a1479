#include "krot/adjust/ceres_problem.h"

#include <array>
#include <string>
#include <vector>

#include <ceres/numeric_diff_cost_function.h>
#include <gtest/gtest.h>

#include "krot/adjust/adjustment_blocks.h"
#include "krot/camera/camera_model.h"
#include "krot/camera/models.h"
#include "krot/synthetic/scene.h"
#include "tests/adjust/small_blocks.h"

namespace krot::internal {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// The oracle knows no derivative: central differences of a projection written
// with Eigen's quaternions and the camera's own ProjectRay.

Vector3d Transform(const double* block, const Vector3d& x) {
  const Eigen::Quaterniond q(block[0], block[1], block[2], block[3]);
  return q * x + Vector3d(block[4], block[5], block[6]);
}

template <typename CameraModel>
struct NaiveReprojection {
  Vector2d pixel;

  bool operator()(const double* point, const double* frame,
                  const double* sensor, const double* camera,
                  double* residual) const {
    const Vector3d x_cam = Transform(
        sensor, Transform(frame, Vector3d(point[0], point[1], point[2])));
    Eigen::Map<Vector2d> difference(residual);
    difference =
        ProjectRay({CameraModel::kId, camera}, x_cam.hnormalized()) - pixel;
    return true;
  }
  bool operator()(const double* point, const double* frame,
                  const double* camera, double* residual) const {
    const double identity[7] = {1, 0, 0, 0, 0, 0, 0};
    return (*this)(point, frame, identity, camera, residual);
  }
};

struct Configuration {
  std::array<double, 3> point = {0.3, -0.2, 4.0};
  std::array<double, 7> frame = {0.9, 0.1, -0.3, 0.2, 0.1, -0.2, 0.5};
  std::array<double, 7> sensor = {0.8, -0.1, 0.2, 0.1, -0.05, 0.1, 0.02};
  std::vector<double> camera;
  Vector2d pixel = Vector2d(100.25, 300.5);

  explicit Configuration(int model_id) {
    Eigen::Map<Eigen::Vector4d>(frame.data()).normalize();
    Eigen::Map<Eigen::Vector4d>(sensor.data()).normalize();
    camera = DefaultCamera(model_id, 1024, 768, 900).params;
  }
};

void ExpectSame(const ceres::CostFunction& cost,
                const ceres::CostFunction& oracle,
                const std::vector<const double*>& blocks) {
  Vector2d residual, expected;
  std::vector<std::vector<double>> jacobians, expected_jacobians;
  std::vector<double*> pointers, expected_pointers;
  for (const int size : cost.parameter_block_sizes()) {
    jacobians.emplace_back(2 * size);
    expected_jacobians.emplace_back(2 * size);
  }
  for (size_t i = 0; i < blocks.size(); ++i) {
    pointers.push_back(jacobians[i].data());
    expected_pointers.push_back(expected_jacobians[i].data());
  }
  ASSERT_TRUE(cost.Evaluate(blocks.data(), residual.data(), pointers.data()));
  ASSERT_TRUE(oracle.Evaluate(blocks.data(), expected.data(),
                              expected_pointers.data()));
  EXPECT_LT((residual - expected).norm(), 1e-9);
  for (size_t i = 0; i < blocks.size(); ++i) {
    // A quaternion of another norm is another function to either side: only
    // what is tangent to the sphere counts.
    const bool is_pose = jacobians[i].size() == 14;
    for (size_t j = 0; j < jacobians[i].size(); ++j) {
      if (is_pose && j % 7 < 4) continue;
      EXPECT_NEAR(jacobians[i][j], expected_jacobians[i][j],
                  1e-5 * (1 + std::abs(expected_jacobians[i][j])))
          << "block " << i << ", entry " << j;
    }
    if (!is_pose) continue;
    for (int row = 0; row < 2; ++row) {
      const Eigen::Map<const Eigen::Vector4d> q(blocks[i]);
      const Eigen::Matrix4d tangent =
          Eigen::Matrix4d::Identity() - q * q.transpose();
      const Eigen::Map<const Eigen::Vector4d> ours(&jacobians[i][7 * row]);
      const Eigen::Map<const Eigen::Vector4d> theirs(
          &expected_jacobians[i][7 * row]);
      EXPECT_LT((tangent * (ours - theirs)).norm(), 1e-5 * (1 + theirs.norm()));
    }
  }
}

class EveryCamera : public ::testing::TestWithParam<int> {};

TEST_P(EveryCamera, HasTheDerivativesOfItsReprojection) {
  VisitCameraModel(GetParam(), [](auto camera) {
    using Model = decltype(camera);
    constexpr int kNum = Model::kNumParams;
    const Configuration c(Model::kId);
    const ceres::NumericDiffCostFunction<NaiveReprojection<Model>,
                                         ceres::CENTRAL, 2, 3, 7, kNum>
        plain(new NaiveReprojection<Model>{c.pixel});
    ExpectSame(ReprojectionCost(Model::kId, false, c.pixel), plain,
               {c.point.data(), c.frame.data(), c.camera.data()});
    const ceres::NumericDiffCostFunction<NaiveReprojection<Model>,
                                         ceres::CENTRAL, 2, 3, 7, 7, kNum>
        rig(new NaiveReprojection<Model>{c.pixel});
    ExpectSame(
        ReprojectionCost(Model::kId, true, c.pixel), rig,
        {c.point.data(), c.frame.data(), c.sensor.data(), c.camera.data()});
  });
}

INSTANTIATE_TEST_SUITE_P(Models, EveryCamera, ::testing::Range(0, 17),
                         [](const auto& test) {
                           return std::string(
                               FindCameraModel(test.param)->name);
                         });

TEST(ReprojectionCost, FailsBehindTheCamera) {
  Configuration c(SimplePinhole::kId);
  Vector2d residual;
  const std::vector<const double*> blocks = {c.point.data(), c.frame.data(),
                                             c.camera.data()};
  const ReprojectionCost cost(SimplePinhole::kId, false, c.pixel);
  EXPECT_TRUE(cost.Evaluate(blocks.data(), residual.data(), nullptr));
  c.frame[6] = -50;
  EXPECT_FALSE(cost.Evaluate(blocks.data(), residual.data(), nullptr));
}

// The oracle knows no derivative: central differences of ProjectErrors along
// motions of every unknown.

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
