#include "tests/cli/scenes.h"

#include <algorithm>
#include <limits>
#include <random>
#include <vector>

#include "krot/base/numbers.h"
#include "krot/convert/build_problem.h"
#include "krot/model.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {

SceneOptions SmallScene() {
  SceneOptions options = SceneOf(6, 60, 4, 0.5, 3);
  options.start_translation_noise = 0.003;
  options.start_point_noise = 0.003;
  return options;
}

Model SmallRigModel(int sensors_per_rig) {
  SceneOptions options = SmallScene();
  options.has_rigs = sensors_per_rig > 1;
  options.sensors_per_rig = sensors_per_rig;
  return SynthesizeScene(options).model;
}

Model SmallLegacyModel() { return SmallRigModel(1); }

void Save(const Model& model, const std::filesystem::path& folder,
          ModelFormat format) {
  WriteModelOptions options;
  options.format = format;
  options.overwrite = true;
  WriteModel(model, folder, options);
}

Model Load(const std::filesystem::path& folder) {
  Model model = ReadModel(folder, DetectModelFormat(folder));
  ValidateModel(model);
  return model;
}

Model Perturbed(const Model& model, double share, uint64_t seed) {
  BuildProblemOptions all;
  all.ignore_translations = true;
  const BuiltProblem built = BuildProblem(model, all);
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();
  for (const View& view : built.problem.views) {
    centroid -= view.cam_from_world_rotation.transpose() *
                built.start.translations[view.frame];
  }
  centroid /= static_cast<double>(built.problem.views.size());
  std::vector<double> distances;
  for (const Eigen::Vector3d& point : built.start.points) {
    distances.push_back((point - centroid).norm());
  }
  const auto median =
      distances.begin() + static_cast<int64_t>(distances.size() / 2);
  std::nth_element(distances.begin(), median, distances.end());

  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0, share * *median);
  Estimate moved = built.start;
  for (std::vector<Eigen::Vector3d>* unknowns :
       {&moved.translations, &moved.points}) {
    for (Eigen::Vector3d& x : *unknowns) {
      for (int axis = 0; axis < 3; ++axis) x[axis] += noise(random);
    }
  }
  return ApplyEstimate(model, built, moved);
}

Model WithoutTranslations(const Model& model) {
  Model result = model;
  for (Frame& frame : result.frames) {
    frame.rig_from_world.translation.setConstant(kNaN);
  }
  for (Image& image : result.images) {
    image.cam_from_world.translation.setConstant(kNaN);
  }
  return result;
}

Model WithShortTracks(const Model& model, uint64_t length) {
  Model result = model;
  result.points3D.clear();
  result.track_elements.clear();
  for (Image& image : result.images) {
    for (Point2D& point2D : image.points2D) {
      point2D.point3D_id = kInvalidPoint3DId;
    }
  }
  for (Point3D point : model.points3D) {
    const uint64_t begin = point.track_begin;
    if (length == 0) break;
    point.track_begin = result.track_elements.size();
    for (uint64_t n = begin; n < point.track_end && n < begin + length; ++n) {
      const TrackElement& element = model.track_elements[n];
      result.track_elements.push_back(element);
      for (Image& image : result.images) {
        if (image.id != element.image_id) continue;
        image.points2D[element.point2D_idx].point3D_id = point.id;
      }
    }
    point.track_end = result.track_elements.size();
    result.points3D.push_back(point);
  }
  return result;
}

Model FarAway(const Model& model, const Eigen::Vector3d& shift) {
  const auto move = [&](Pose* pose) {
    using Real = long double;
    pose->translation = (100 * pose->translation.cast<Real>() -
                         pose->Rotation().cast<Real>() * shift.cast<Real>())
                            .cast<double>();
  };
  Model far = model;
  for (Frame& frame : far.frames) move(&frame.rig_from_world);
  for (Image& image : far.images) move(&image.cam_from_world);
  for (Point3D& point : far.points3D) point.xyz = 100 * point.xyz + shift;
  return far;
}

}  // namespace krot::internal
