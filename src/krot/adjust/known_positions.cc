#include <vector>

#include "krot/adjust/adjustment_blocks.h"
#include "krot/base/check.h"
#include "krot/geometry.h"
#include "krot/geometry/transform.h"

namespace krot::internal {
namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::Vector3d;

Vector3d CenterInRig(const AdjustmentBlocks& blocks, int32_t sensor) {
  if (sensor < 0) return Vector3d::Zero();
  const PoseBlock& block = blocks.sensors[sensor];
  return Center({RotationOf(block), TranslationOf(block)});
}

bool Moves(const AdjustmentColumns& columns,
           const PositionObservation& position) {
  if (position.point >= 0) return columns.point_moves[position.point] != 0;
  const auto moves = [](const AdjustmentColumns::Pose& pose) {
    return pose.center != AdjustmentColumns::kHeld;
  };
  return moves(columns.frames[position.frame]) ||
         (position.sensor >= 0 && moves(columns.sensors[position.sensor]));
}

}  // namespace

void AddPositions(const Model& model,
                  const std::vector<KnownPosition>& positions, double sigma_px,
                  const AdjustmentColumns& columns, AdjustmentBlocks* blocks) {
  std::vector<char> has_frame(blocks->frames.size(), 0);
  std::vector<char> has_point(blocks->points.size(), 0);
  for (const AdjustmentObservation& observation : blocks->observations) {
    has_frame[observation.frame] = 1;
    has_point[observation.point] = 1;
  }
  const std::vector<ImageGeometry> images = ImageGeometries(model);
  const std::vector<int32_t> sensor_offsets = SensorOffsets(model);
  for (const KnownPosition& known : positions) {
    PositionObservation position;
    position.position = known.region.centre;
    position.px_from_world =
        kRegionSigmas * sigma_px * known.region.UnitFromWorld();
    if (known.of == KnownPosition::Of::kPoint3D) {
      position.point = known.index;
      if (has_point[position.point] == 0) continue;
      CheckArgument(has_point[position.point] == 1, "positions", known.index,
                    "one of each point");
    } else {
      const ImageGeometry& image = images[known.index];
      position.frame = image.frame;
      position.sensor = SensorBlock(image, sensor_offsets);
      if (!image.has_pose || has_frame[position.frame] == 0) continue;
    }
    if (!Moves(columns, position)) continue;
    if (position.point >= 0) has_point[position.point] = 2;
    blocks->positions.push_back(position);
  }
}

Vector3d PlaceOf(const PositionObservation& position,
                 const AdjustmentBlocks& blocks) {
  if (position.point >= 0) return blocks.points[position.point];
  const PoseBlock& frame = blocks.frames[position.frame];
  return RotationOf(frame).transpose() *
         (CenterInRig(blocks, position.sensor) - TranslationOf(frame));
}

double HalfSquaredPositions(const AdjustmentBlocks& blocks) {
  double sum = 0;
  for (const PositionObservation& position : blocks.positions) {
    sum += (position.px_from_world *
            (PlaceOf(position, blocks) - position.position))
               .squaredNorm();
  }
  return sum / 2;
}

// With R = R_s R_f and c = c_f + R_f'c_s, both as in AdjustmentColumns::Pose.
PoseJacobian DifferentiatePose(const AdjustmentColumns& columns,
                               const AdjustmentBlocks& blocks, int32_t frame,
                               int32_t sensor) {
  PoseJacobian pose;
  std::vector<Eigen::Matrix<double, 6, 3>> J;
  const auto add = [&](int32_t block, const Matrix3d& rotation,
                       const Matrix3d& center) {
    if (block == AdjustmentColumns::kHeld) return;
    pose.blocks.push_back(block);
    J.emplace_back();
    J.back() << rotation, center;
  };
  const Matrix3d R_frame = RotationOf(blocks.frames[frame]);
  Matrix3d R = R_frame;
  Matrix3d lever = Matrix3d::Zero();
  if (sensor >= 0) {
    const Matrix3d R_sensor = RotationOf(blocks.sensors[sensor]);
    R = R_sensor * R_frame;
    lever = CrossMatrix(R_frame.transpose() * CenterInRig(blocks, sensor));
    const AdjustmentColumns::Pose& of_sensor = columns.sensors[sensor];
    add(of_sensor.rotation, R_sensor, Matrix3d::Zero());
    add(of_sensor.center, Matrix3d::Zero(), R_frame.transpose());
  }
  const AdjustmentColumns::Pose& of_frame = columns.frames[frame];
  add(of_frame.rotation, R, lever);
  add(of_frame.center, Matrix3d::Zero(), Matrix3d::Identity());
  pose.J.resize(6, 3 * static_cast<Index>(J.size()));
  for (size_t b = 0; b < J.size(); ++b) {
    pose.J.middleCols<3>(static_cast<Index>(3 * b)) = J[b];
  }
  return pose;
}

}  // namespace krot::internal
