#pragma once

#include <cmath>
#include <random>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// Small problems with an estimate in front of every camera.

struct RandomScene {
  KnownRotationProblem problem;
  Estimate estimate;
};

struct RandomSceneOptions {
  int num_frames = 5;
  int num_points = 20;
  int views_per_frame = 1;
  double baseline = 0;  // |t_sr| of every view but the first of its frame
  unsigned seed = 1;
};

// Frames in [-1, 1]^3 look roughly along +z at points 5 to 8 away, so that
// every depth is positive; every view sees every point, and observations lie
// a few pixels off at a focal length of 1000 px (J is no multiple of I).
inline RandomScene MakeRandomScene(const RandomSceneOptions& options) {
  std::mt19937 generator(options.seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto vector3 = [&] {
    return Eigen::Vector3d(uniform(generator), uniform(generator),
                           uniform(generator));
  };
  const auto small_rotation = [&] {
    return Eigen::AngleAxisd(0.2 * uniform(generator), vector3().normalized())
        .toRotationMatrix();
  };

  RandomScene scene;
  KnownRotationProblem& problem = scene.problem;
  problem.num_frames = options.num_frames;
  problem.num_points = options.num_points;
  for (int v = 0; v < options.views_per_frame; ++v) {
    const Eigen::Matrix3d cam_from_rig =
        v == 0 ? Eigen::Matrix3d::Identity() : small_rotation();
    const Eigen::Vector3d t_sr =
        v == 0 ? Eigen::Vector3d(0, 0, 0)
               : Eigen::Vector3d(options.baseline * vector3().normalized());
    for (int f = 0; f < options.num_frames; ++f) {
      problem.views.push_back({cam_from_rig, cam_from_rig, t_sr, f});
    }
  }
  for (int f = 0; f < options.num_frames; ++f) {
    const Eigen::Matrix3d rig_from_world = small_rotation();
    scene.estimate.translations.push_back(-rig_from_world * vector3());
    for (View& view : problem.views) {
      if (view.frame == f) view.cam_from_world_rotation *= rig_from_world;
    }
  }

  for (int k = 0; k < options.num_points; ++k) {
    const Eigen::Vector3d point =
        vector3() + Eigen::Vector3d(0, 0, 6.5 + 0.5 * uniform(generator));
    scene.estimate.points.push_back(point);
    for (int j = 0; j < static_cast<int>(problem.views.size()); ++j) {
      const View& view = problem.views[j];
      const Eigen::Vector3d x_cam =
          view.cam_from_world_rotation * point +
          view.cam_from_rig_rotation * scene.estimate.translations[view.frame] +
          view.cam_from_rig_translation;
      Observation observation;
      const Eigen::Vector2d u =
          x_cam.hnormalized() + 4e-3 * vector3().head<2>();
      Eigen::Matrix2d J;
      J << 1000 + 50 * uniform(generator), 20 * uniform(generator),
          20 * uniform(generator), 1000 + 50 * uniform(generator);
      observation.E = RowAtRay(u, J);
      observation.view = j;
      observation.point = k;
      problem.observations.push_back(observation);
    }
  }
  IndexObservations(&problem);
  return scene;
}

// Where a row was taken by RowAtRay.
inline Eigen::Vector2d RayOf(const Observation& observation) {
  return -observation.E.bottomLeftCorner<2, 2>().inverse() *
         observation.E.bottomRightCorner<2, 1>();
}

// Takes such a row elsewhere, with the same Jacobian.
inline void MoveRay(const Eigen::Vector2d& by, Observation* observation) {
  observation->E.bottomRightCorner<2, 1>() -=
      observation->E.bottomLeftCorner<2, 2>() * by;
}

}  // namespace krot::internal
