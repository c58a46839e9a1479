#pragma once

#include <ceres/cost_function.h>
#include <Eigen/Core>

namespace krot {

// Reprojection error, projected minus measured, in pixels. Blocks: point (3),
// rig_from_world (7), sensor_from_rig (7; only with a sensor), camera.
//
//   x_cam = sensor_from_rig (rig_from_world x)
//
// Evaluation fails, and Ceres rejects the step, where x_cam is not in front of
// the camera or has no finite pixel.
class ReprojectionCost final : public ceres::CostFunction {
 public:
  // Throws std::invalid_argument if there is no such camera model.
  ReprojectionCost(int camera_model, bool has_sensor,
                   const Eigen::Vector2d& pixel);

  bool Evaluate(double const* const* blocks, double* residuals,
                double** jacobians) const override;

 private:
  Eigen::Vector2d pixel_;
  int camera_model_;
};

}  // namespace krot
