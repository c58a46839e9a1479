#include "krot/problem/gauge.h"

#include "krot/geometry.h"
#include "krot/problem/subset.h"

namespace krot::internal {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

// The views that have observations, in the order of their first observations.
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

BlockStructure AnchoredStructure(const KnownRotationProblem& problem,
                                 const Context& context) {
  BlockStructure structure;
  structure.point_begin = problem.point_begin;
  structure.frame_of.reserve(problem.observations.size());
  for (const Observation& observation : problem.observations) {
    structure.frame_of.push_back(problem.views[observation.view].frame);
  }
  std::vector<int64_t> count;
  for (int32_t f = 0; f < problem.num_frames; ++f) {
    count.push_back(problem.frame_begin[f + 1] - problem.frame_begin[f]);
  }
  ReduceRanks(context, std::plus<int64_t>(), &count);
  const Components components = FindComponents(problem, context);
  std::vector<char> is_held(components.count, 0);
  if (!problem.fixed_points.empty()) {
    structure.point_is_fixed.assign(problem.num_points, 0);
  }
  for (int32_t k = 0; k < problem.num_points; ++k) {
    if (!problem.IsFixedPoint(k)) continue;
    structure.point_is_fixed[k] = 1;
    if (components.of_point[k] >= 0) is_held[components.of_point[k]] = 1;
  }
  structure.frame_is_fixed.assign(problem.num_frames, 0);
  for (int32_t f = 0; f < problem.num_frames; ++f) {
    if (components.of_frame[f] >= 0 && !problem.IsFixedFrame(f)) continue;
    structure.frame_is_fixed[f] = 1;
    if (components.of_frame[f] >= 0) is_held[components.of_frame[f]] = 1;
  }
  std::vector<int32_t> anchor(components.count, -1);
  for (int32_t f = 0; f < problem.num_frames; ++f) {
    if (components.of_frame[f] < 0 || is_held[components.of_frame[f]]) continue;
    int32_t& best = anchor[components.of_frame[f]];
    if (best < 0 || count[f] > count[best]) best = f;
  }
  for (const int32_t f : anchor) {
    if (f >= 0) structure.frame_is_fixed[f] = 1;
  }
  return structure;
}

std::vector<Matrix3d> RigFromWorldRotations(
    const KnownRotationProblem& problem) {
  std::vector<Matrix3d> rotations(problem.num_frames, Matrix3d::Identity());
  for (const View& view : problem.views) {
    rotations[view.frame] =
        view.cam_from_rig_rotation.transpose() * view.cam_from_world_rotation;
  }
  return rotations;
}

std::vector<Vector3d> CentresOf(const std::vector<Matrix3d>& rig_from_world,
                                const std::vector<Vector3d>& translations) {
  std::vector<Vector3d> centres;
  for (size_t f = 0; f < translations.size(); ++f) {
    centres.push_back(-(rig_from_world[f].transpose() * translations[f]));
  }
  return centres;
}

void MoveCentres(const std::vector<Matrix3d>& rig_from_world,
                 const Estimate& from, double step,
                 const BlockVector& direction, Estimate* to) {
  to->points.resize(from.points.size());
  to->translations.resize(from.translations.size());
  for (size_t k = 0; k < from.points.size(); ++k) {
    to->points[k] = from.points[k] + step * direction.points[k];
  }
  for (size_t f = 0; f < from.translations.size(); ++f) {
    to->translations[f] =
        from.translations[f] - step * (rig_from_world[f] * direction.frames[f]);
  }
}

BlockVector GradientOf(const KnownRotationProblem& problem,
                       const BlockStructure& structure,
                       const std::function<Vector3d(int64_t i)>& multiplier) {
  BlockVector gradient;
  gradient.SetZero(problem.num_points, problem.num_frames);
  for (size_t i = 0; i < problem.observations.size(); ++i) {
    const Observation& o = problem.observations[i];
    const View& view = problem.views[o.view];
    const Vector3d own =
        view.cam_from_world_rotation.transpose() *
        (o.E.transpose() * multiplier(static_cast<int64_t>(i)));
    gradient.points[o.point] += own;
    if (!structure.frame_is_fixed[view.frame]) {
      gradient.frames[view.frame] -= own;
    }
  }
  return gradient;
}

}  // namespace krot::internal
