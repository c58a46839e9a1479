#include "krot/adjust/ceres_problem.h"

#include <array>
#include <string>
#include <vector>

#include <ceres/numeric_diff_cost_function.h>
#include <gtest/gtest.h>

#include "krot/camera/camera_model.h"
#include "krot/camera/models.h"
#include "krot/synthetic/scene.h"

// The oracle knows no derivative: central differences of a projection written
// with Eigen's quaternions and the camera's own ProjectRay.

namespace krot::internal {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

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

}  // namespace
}  // namespace krot::internal
