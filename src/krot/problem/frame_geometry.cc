#include "krot/problem/frame_geometry.h"

#include <cstdint>

#include "krot/geometry.h"

namespace krot::internal {
namespace {

// The views that have observations: in this order, a frame's first one is that
// of its first observation.
std::vector<int32_t> SeenViews(const KnownRotationProblem& problem,
                               const Context& context) {
  std::vector<int32_t> seen;
  InTurnOfRanks(
      context,
      [&](std::vector<int32_t>* views) {
        std::vector<char> is_seen(problem.views.size(), 0);
        for (const int32_t view : *views) is_seen[view] = 1;
        for (const Observation& observation : problem.observations) {
          if (is_seen[observation.view]) continue;
          is_seen[observation.view] = 1;
          views->push_back(observation.view);
        }
      },
      &seen);
  return seen;
}

}  // namespace

std::vector<FrameGeometry> DescribeFrames(const KnownRotationProblem& problem,
                                          const Context& context) {
  std::vector<FrameGeometry> frames(problem.num_frames);
  for (const View& view : problem.views) ++frames[view.frame].num_views;

  for (const int32_t v : SeenViews(problem, context)) {
    const View& view = problem.views[v];
    FrameGeometry& frame = frames[view.frame];
    const Eigen::Vector3d centre_in_rig =
        Center({view.cam_from_rig_rotation, view.cam_from_rig_translation});
    if (!frame.is_seen_through) {
      frame.is_seen_through = true;
      frame.centre_in_rig = centre_in_rig;
      frame.world_from_rig =
          view.cam_from_world_rotation.transpose() * view.cam_from_rig_rotation;
    } else if ((centre_in_rig - frame.centre_in_rig).norm() >
               kCoincident * frame.centre_in_rig.norm()) {
      frame.has_two_centres = true;
    }
  }
  return frames;
}

}  // namespace krot::internal
