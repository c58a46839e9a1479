// triangulate_point: the point whose largest error in five cameras is lowest,
// by the paper's Fast Descent Method: the way down is the centre of the
// smallest ball that encloses the directions in which the largest errors fall.

#include <algorithm>
#include <cstdio>
#include <vector>

#include <Eigen/Geometry>

#include "krot/minimax.h"

int main() {
  constexpr double kFocalLength = 800;  // pixels
  const Eigen::Vector3d truth(0.3, -0.2, 4);
  const Eigen::Vector2d noise_px[] = {
      {0.7, 0.1}, {-0.4, 0.5}, {0.2, -0.8}, {-0.6, -0.3}, {0.1, 0.9}};

  std::vector<krot::Residual> residuals;
  for (int camera = 0; camera < 5; ++camera) {
    // The cameras stand in a row and look along z.
    krot::RigidTransform cam_from_world;
    cam_from_world.translation = {0.5 * (camera - 2), 0.1 * camera, 0};
    const Eigen::Vector2d ray = (cam_from_world * truth).hnormalized() +
                                noise_px[camera] / kFocalLength;
    residuals.push_back(krot::PointResidual(cam_from_world, ray, kFocalLength));
  }

  krot::FastDescentOptions options;
  options.settings = krot::FastDescentSettings::kPaper;
  Eigen::Vector3d x(0, 0, 1);  // anywhere in front of all cameras
  const krot::DescentSummary summary =
      krot::MinimizeLargestResidual(residuals, options, krot::Norm::L2(), &x);

  std::printf("(%.4f, %.4f, %.4f): %.4f -> %.4f px in %d steps\n", x[0], x[1],
              x[2], summary.cost_initial, summary.cost, summary.iterations);
  // The true point is one candidate, so the optimum is no worse.
  double error_of_truth = 0;
  for (const krot::Residual& residual : residuals) {
    error_of_truth = std::max(
        error_of_truth, krot::ResidualValue(residual, truth, krot::Norm::L2()));
  }
  return summary.cost <= error_of_truth ? 0 : 1;
}
