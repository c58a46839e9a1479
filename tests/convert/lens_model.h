#pragma once

#include <random>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "krot/camera/camera_model.h"
#include "krot/model.h"
#include "krot/model/rigs.h"

namespace krot::internal {

struct LensModelOptions {
  int camera_model_id = 2;
  std::vector<double> params = {500, 320, 240, -0.12};
  int num_images = 3;
  int num_points = 8;
  double pixel_noise = 1.5;  // uniform, per axis
  unsigned seed = 1;
};

// A legacy model at the truth but for its pixels: images side by side, one
// camera, every point in all of them and up to 50 degrees off their axes.
inline Model MakeLensModel(const LensModelOptions& options) {
  std::mt19937 generator(options.seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto vector3 = [&]() {
    return Eigen::Vector3d(uniform(generator), uniform(generator),
                           uniform(generator));
  };
  Model model;
  model.cameras = {{1, options.camera_model_id, 640, 480, options.params}};
  for (int k = 0; k < options.num_points; ++k) {
    Point3D point;
    point.id = k + 1;
    point.xyz = Eigen::Vector3d(2.2, 1.6, 0.6).cwiseProduct(vector3()) +
                Eigen::Vector3d(0, 0, 3);
    model.points3D.push_back(point);
  }
  for (int n = 0; n < options.num_images; ++n) {
    Image image;
    image.id = n + 1;
    image.camera_id = 1;
    image.name = std::to_string(n);
    const Eigen::Quaterniond q(Eigen::AngleAxisd(0.15, vector3().normalized()));
    image.cam_from_world.quaternion_wxyz = {q.w(), q.x(), q.y(), q.z()};
    const Eigen::Vector3d centre =
        Eigen::Vector3d(0.8, 0.8, 0.3).cwiseProduct(vector3());
    image.cam_from_world.translation = -(q * centre);
    for (const Point3D& point : model.points3D) {
      const Eigen::Vector2d pixel =
          ProjectPoint({options.camera_model_id, options.params.data()},
                       q * (point.xyz - centre))
              .value() +
          options.pixel_noise * vector3().head<2>();
      image.points2D.push_back({pixel.x(), pixel.y(), point.id});
    }
    model.images.push_back(image);
  }
  for (Point3D& point : model.points3D) {
    point.track_begin = model.track_elements.size();
    for (const Image& image : model.images) {
      model.track_elements.push_back(
          {image.id, static_cast<uint32_t>(point.id - 1)});
    }
    point.track_end = model.track_elements.size();
  }
  UseTrivialRigs(&model);
  return model;
}

}  // namespace krot::internal
