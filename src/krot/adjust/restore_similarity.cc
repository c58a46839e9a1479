#include "krot/adjust/restore_similarity.h"

#include <cmath>
#include <map>
#include <vector>

#include "krot/base/disjoint_sets.h"
#include "krot/geometry/rigid_transform.h"
#include "krot/geometry/rotation.h"
#include "krot/geometry/similarity.h"

namespace krot {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// What moves together: indices of AdjustmentBlocks. Sensors only where they are
// refined; else `has_fixed_scale` says whether they have a translation.
struct Component {
  std::vector<size_t> frames;
  std::vector<size_t> sensors;
  std::vector<size_t> points;
  bool has_fixed_scale = false;
  bool is_held = false;  // something in it is fixed
};

std::vector<Component> FindComponents(const AdjustmentBlocks& blocks,
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

  std::map<size_t, Component> components;
  for (size_t node = 0; node < num_nodes; ++node) {
    if (!is_used[node]) continue;
    Component& component = components[nodes.Find(node)];
    if (node < num_frames) {
      component.frames.push_back(node);
      component.is_held = component.is_held || blocks.frame_is_fixed[node];
      component.has_fixed_scale = component.has_fixed_scale || is_scaled[node];
    } else if (node < num_frames + num_sensors) {
      component.sensors.push_back(node - num_frames);
    } else {
      const size_t point = node - num_frames - num_sensors;
      component.points.push_back(point);
      component.is_held = component.is_held || blocks.point_is_fixed[point];
    }
  }
  std::vector<Component> list;
  for (auto& [root, component] : components) {
    list.push_back(std::move(component));
  }
  return list;
}

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

// The rotation nearest to the sum of R_before^T R_after; none if several are.
Matrix3d MeanRotation(const std::vector<PoseBlock>& before,
                      const std::vector<PoseBlock>& after,
                      const std::vector<size_t>& indices) {
  Matrix3d sum = Matrix3d::Zero();
  for (const size_t f : indices) {
    sum += RotationOf(before[f]).transpose() * RotationOf(after[f]);
  }
  return NearestRotation(sum).value_or(Matrix3d::Identity());
}

// Moves the frame's centre to `center`; turns it with the world unless
// `keep_rotation`.
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

void RestoreSimilarity(const BundleAdjustmentOptions& options,
                       const AdjustmentBlocks& before,
                       AdjustmentBlocks* after) {
  if (!options.refine_rig_from_world || !options.refine_points3D) return;
  const bool keep_rotation = options.constant_rig_from_world_rotation;
  for (const Component& component :
       FindComponents(before, options.refine_sensor_from_rig)) {
    if (component.is_held) continue;
    const CenterStatistics old_centers =
        Summarize(before.frames, component.frames);
    const CenterStatistics new_centers =
        Summarize(after->frames, component.frames);
    // Of what lies around the new centroid.
    Similarity similarity;
    similarity.translation = old_centers.centroid;
    if (!component.has_fixed_scale && old_centers.rms > 0 &&
        new_centers.rms > 0) {
      similarity.scale = old_centers.rms / new_centers.rms;
    }
    if (!keep_rotation) {
      similarity.rotation =
          MeanRotation(before.frames, after->frames, component.frames);
    }
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

}  // namespace krot
