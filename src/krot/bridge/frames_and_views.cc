#include "krot/bridge/frames_and_views.h"

#include <algorithm>
#include <optional>
#include <vector>

#include "krot/bridge/order_of_ids.h"

namespace krot::internal {

void AddFramesAndViews(const Model& model,
                       const std::vector<ImageGeometry>& geometries,
                       Ranks* ranks, BuiltProblem* built) {
  KnownRotationProblem& problem = built->problem;
  std::vector<int32_t> frame_index(model.frames.size(), -1);
  for (const Observation& observation : problem.observations) {
    frame_index[geometries[observation.view].frame] = 0;
  }
  if (ranks != nullptr) {
    ranks->Reduce([](int32_t a, int32_t b) { return std::max(a, b); },
                  &frame_index);
  }
  for (const int32_t f : OrderOfIds(model.frames)) {
    if (frame_index[f] < 0) continue;
    frame_index[f] = problem.num_frames++;
    built->frame_of.push_back(f);
  }
  built->start.translations.resize(problem.num_frames);

  std::vector<int32_t> view_index(geometries.size(), -1);
  for (const int32_t n : OrderOfIds(model.images)) {
    const ImageGeometry& image = geometries[n];
    if (!image.has_pose || frame_index[image.frame] < 0) continue;
    view_index[n] = static_cast<int32_t>(problem.views.size());
    built->image_of.push_back(n);
    const int32_t frame = frame_index[image.frame];
    problem.views.push_back({image.cam_from_world.rotation,
                             image.cam_from_rig.rotation,
                             image.cam_from_rig.translation, frame});
    built->start.translations[frame] = image.rig_from_world.translation;
  }
  for (Observation& observation : problem.observations) {
    observation.view = view_index[observation.view];
  }
}

void FixPositions(const FixedParts& fixed, BuiltProblem* built) {
  KnownRotationProblem& problem = built->problem;
  const auto fix = [](const std::vector<char>& marks,
                      const std::vector<int32_t>& index_of,
                      const std::vector<Eigen::Vector3d>& start,
                      std::vector<std::optional<Eigen::Vector3d>>* positions) {
    if (marks.empty()) return;
    positions->resize(index_of.size());
    for (size_t n = 0; n < index_of.size(); ++n) {
      if (marks[index_of[n]]) (*positions)[n] = start[n];
    }
  };
  fix(fixed.frames, built->frame_of, built->start.translations,
      &problem.fixed_translations);
  fix(fixed.points3D, built->point_of, built->start.points,
      &problem.fixed_points);
}

}  // namespace krot::internal
