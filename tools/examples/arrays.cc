// arrays: rotations and rays in, positions and a bound out. A ring of cameras
// looks at a cloud of points; every ray is wrong by up to a pixel.

#include <cmath>
#include <cstdio>
#include <random>

#include <Eigen/Geometry>

#include "krot/known_rotation.h"

int main() {
  constexpr int kCameras = 12;
  constexpr int kPoints = 200;
  constexpr double kFocalLength = 1000;  // pixels
  std::mt19937 random(1);
  std::uniform_real_distribution<double> in_cube(-1, 1);

  krot::KnownRotations problem;
  problem.num_points = kPoints;
  problem.focal_lengths.assign(kCameras, kFocalLength);
  std::vector<Eigen::Vector3d> points(kPoints);
  for (Eigen::Vector3d& point : points) {
    for (int k = 0; k < 3; ++k) point[k] = in_cube(random);
  }
  for (int camera = 0; camera < kCameras; ++camera) {
    const double angle = 2 * M_PI * camera / kCameras;
    problem.rotations.push_back(
        Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()).toRotationMatrix());
    for (int point = 0; point < kPoints; ++point) {
      // The cameras look at the origin from a distance of 5.
      const Eigen::Vector3d in_camera =
          problem.rotations[camera] * points[point] + Eigen::Vector3d(0, 0, 5);
      const Eigen::Vector2d noise(in_cube(random), in_cube(random));
      problem.observations.push_back(
          {camera, point, in_camera.hnormalized() + noise / kFocalLength});
    }
  }

  const krot::KnownRotationsResult result = krot::SolveKnownRotations(problem);
  std::printf("largest error %.4f px; none below %.4f px is possible\n",
              result.max_error, result.lower_bound);
  const bool is_proved =
      result.termination == krot::KnownRotationsTermination::kGapReached;
  return is_proved ? 0 : 1;
}
