#include "krot/adjust/adjustment_blocks.h"

#include <cmath>
#include <map>
#include <vector>

#include "krot/base/disjoint_sets.h"
#include "krot/base/numbers.h"
#include "krot/geometry.h"
#include "krot/geometry/transform.h"

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

Vector3d CenterOf(const PoseBlock& frame) {
  return Center({RotationOf(frame), TranslationOf(frame)});
}

struct CenterStatistics {
  Vector3d centroid = Vector3d::Zero();
  double rms = 0;  // distance to the centroid
};

CenterStatistics Summarize(const std::vector<PoseBlock>& frames,
                           const std::vector<size_t>& indices) {
  CenterStatistics statistics;
  const double count = static_cast<double>(indices.size());
  for (const size_t f : indices) {
    statistics.centroid += CenterOf(frames[f]) / count;
  }
  for (const size_t f : indices) {
    statistics.rms +=
        (CenterOf(frames[f]) - statistics.centroid).squaredNorm() / count;
  }
  statistics.rms = std::sqrt(statistics.rms);
  return statistics;
}

// The rotation nearest to the sum of R_before^T R_after; the identity if
// several are.
Matrix3d MeanRotation(const std::vector<PoseBlock>& before,
                      const std::vector<PoseBlock>& after,
                      const std::vector<size_t>& indices) {
  Matrix3d sum = Matrix3d::Zero();
  for (const size_t f : indices) {
    sum += RotationOf(before[f]).transpose() * RotationOf(after[f]);
  }
  return NearestRotation(sum).value_or(Matrix3d::Identity());
}

// For each frame the typical distance of the points that it sees.
std::vector<double> TypicalDistances(
    const AdjustmentBlocks& blocks,
    const std::vector<AdjustmentObservation>& of) {
  std::vector<double> distances;
  std::vector<int32_t> frame_of;
  for (const AdjustmentObservation& observation : of) {
    distances.push_back((blocks.points[observation.point] -
                         CenterOf(blocks.frames[observation.frame]))
                            .norm());
    frame_of.push_back(observation.frame);
  }
  return GroupMedians(distances, frame_of,
                      static_cast<int32_t>(blocks.frames.size()), {});
}

// The frames of a component that keep their place among the others, once the
// world has turned.
std::vector<size_t> HeldFrames(const AdjustmentBlocks& before,
                               const AdjustmentBlocks& after,
                               const std::vector<double>& distances_before,
                               const std::vector<double>& distances_after,
                               const AdjustmentComponent& component,
                               const Matrix3d& rotation) {
  std::vector<CameraMove> cameras;
  for (const size_t f : component.frames) {
    cameras.push_back({CenterOf(before.frames[f]),
                       rotation * CenterOf(after.frames[f]),
                       distances_before[f], distances_after[f]});
  }
  const std::vector<char> keeps =
      FindConsensus(cameras, !component.has_fixed_scale);
  std::vector<size_t> held;
  for (size_t n = 0; n < keeps.size(); ++n) {
    if (keeps[n] != 0) held.push_back(component.frames[n]);
  }
  return held;
}

// Moves the frame's centre to `center`, and turns the frame with the world
// unless `keep_rotation`.
void MoveFrame(const Vector3d& center, const Matrix3d& world_rotation,
               bool keep_rotation, PoseBlock* frame) {
  Pose pose = ToPose(*frame);
  if (!keep_rotation) {
    pose.quaternion_wxyz = ToWxyz(
        Eigen::Quaterniond(RotationOf(*frame) * world_rotation.transpose()));
  }
  pose.translation = -(pose.Rotation() * center);
  const PoseBlock moved = ToBlock(pose);
  std::copy(moved.begin() + (keep_rotation ? 4 : 0), moved.end(),
            frame->begin() + (keep_rotation ? 4 : 0));
}

}  // namespace

std::vector<AdjustmentComponent> FindComponents(const AdjustmentBlocks& blocks,
                                                bool refine_sensors) {
  const size_t num_frames = blocks.frames.size();
  const size_t num_sensors = blocks.sensors.size();
  const size_t num_nodes = num_frames + num_sensors + blocks.points.size();
  DisjointSets nodes(static_cast<int64_t>(num_nodes));
  std::vector<bool> is_used(num_nodes, false);
  std::vector<bool> is_scaled(num_frames, false);
  for (const AdjustmentObservation& observation : blocks.observations) {
    const size_t frame = observation.frame;
    const size_t point = num_frames + num_sensors + observation.point;
    is_used[frame] = is_used[point] = true;
    nodes.Unite(point, frame);
    if (observation.sensor < 0) continue;
    const size_t sensor = num_frames + observation.sensor;
    if (refine_sensors) {
      is_used[sensor] = true;
      nodes.Unite(sensor, frame);
    } else if (TranslationOf(blocks.sensors[observation.sensor]).norm() > 0) {
      is_scaled[frame] = true;
    }
  }

  std::vector<bool> is_held(num_nodes, false);
  for (size_t f = 0; f < num_frames; ++f) is_held[f] = blocks.frame_is_fixed[f];
  for (size_t k = 0; k < blocks.points.size(); ++k) {
    is_held[num_frames + num_sensors + k] = blocks.point_is_fixed[k];
  }
  for (const PositionObservation& position : blocks.positions) {
    is_held[position.point >= 0 ? num_frames + num_sensors + position.point
                                : position.frame] = true;
  }

  std::map<size_t, AdjustmentComponent> components;
  for (size_t node = 0; node < num_nodes; ++node) {
    if (!is_used[node]) continue;
    AdjustmentComponent& component = components[nodes.Find(node)];
    component.is_held = component.is_held || is_held[node];
    if (node < num_frames) {
      component.frames.push_back(node);
      component.has_fixed_scale = component.has_fixed_scale || is_scaled[node];
    } else if (node < num_frames + num_sensors) {
      component.sensors.push_back(node - num_frames);
    } else {
      component.points.push_back(node - num_frames - num_sensors);
    }
  }
  std::vector<AdjustmentComponent> list;
  for (auto& [root, component] : components) {
    list.push_back(std::move(component));
  }
  return list;
}

void RestoreSimilarity(const BundleAdjustmentOptions& options,
                       const AdjustmentBlocks& before,
                       AdjustmentBlocks* after) {
  if (!options.refine_rig_from_world || !options.refine_points3D) return;
  const bool keep_rotation = options.constant_rig_from_world_rotation;
  const std::vector<double> distances_before =
      TypicalDistances(before, before.observations);
  const std::vector<double> distances_after =
      TypicalDistances(*after, before.observations);
  for (const AdjustmentComponent& component :
       FindComponents(before, options.refine_sensor_from_rig)) {
    if (component.is_held) continue;
    const auto rotation_of =
        [&](const std::vector<size_t>& frames) -> Matrix3d {
      return keep_rotation ? Matrix3d::Identity()
                           : MeanRotation(before.frames, after->frames, frames);
    };
    const std::vector<size_t> held =
        HeldFrames(before, *after, distances_before, distances_after, component,
                   rotation_of(component.frames));
    const CenterStatistics old_centers = Summarize(before.frames, held);
    const CenterStatistics new_centers = Summarize(after->frames, held);
    // Applies to coordinates relative to the new centroid.
    Similarity similarity;
    similarity.translation = old_centers.centroid;
    if (!component.has_fixed_scale && old_centers.rms > 0 &&
        new_centers.rms > 0) {
      similarity.scale = old_centers.rms / new_centers.rms;
    }
    similarity.rotation = rotation_of(held);
    const auto move = [&](const Vector3d& x) -> Vector3d {
      return similarity * (x - new_centers.centroid);
    };
    for (const size_t f : component.frames) {
      MoveFrame(move(CenterOf(after->frames[f])), similarity.rotation,
                keep_rotation, &after->frames[f]);
    }
    for (const size_t s : component.sensors) {
      Eigen::Map<Vector3d>(after->sensors[s].data() + 4) *= similarity.scale;
    }
    for (const size_t k : component.points) {
      after->points[k] = move(after->points[k]);
    }
  }
}

}  // namespace krot::internal
