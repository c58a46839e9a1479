#include <algorithm>
#include <array>
#include <optional>
#include <vector>

#include <ceres/autodiff_cost_function.h>
#include <ceres/dynamic_autodiff_cost_function.h>
#include <ceres/normal_prior.h>
#include <ceres/problem.h>
#include <ceres/rotation.h>

#include "krot/adjust/adjustment_blocks.h"
#include "krot/adjust/ceres_problem.h"
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
  return CenterOf(blocks.sensors[sensor]);
}

bool Moves(const AdjustmentColumns::Pose& pose) {
  return pose.center != AdjustmentColumns::kHeld;
}

bool Moves(const AdjustmentColumns& columns, const Place& place) {
  if (place.point >= 0) return columns.point_moves[place.point] != 0;
  return Moves(columns.frames[place.frame]) ||
         (place.sensor >= 0 && Moves(columns.sensors[place.sensor]));
}

// Whether the length between two places can change.
bool MoveApart(const AdjustmentColumns& columns, const Place& a,
               const Place& b) {
  if (a.frame < 0 || a.frame != b.frame) {
    return Moves(columns, a) || Moves(columns, b);
  }
  if (a.sensor == b.sensor) return false;
  return (a.sensor >= 0 && Moves(columns.sensors[a.sensor])) ||
         (b.sensor >= 0 && Moves(columns.sensors[b.sensor]));
}

// Where the cameras and points of a model are among the blocks.
class Places {
 public:
  Places(const Model& model, const AdjustmentBlocks& blocks)
      : images_(ImageGeometries(model)),
        sensor_offsets_(SensorOffsets(model)),
        has_frame_(blocks.frames.size(), 0),
        has_point_(blocks.points.size(), 0) {
    for (const AdjustmentObservation& observation : blocks.observations) {
      has_frame_[observation.frame] = 1;
      has_point_[observation.point] = 1;
    }
  }

  // None if it has no observation.
  std::optional<Place> Find(bool is_image, int32_t index) const {
    Place place;
    if (!is_image) {
      if (has_point_[index] == 0) return std::nullopt;
      place.point = index;
      return place;
    }
    const ImageGeometry& image = images_[index];
    if (!image.has_pose || has_frame_[image.frame] == 0) return std::nullopt;
    place.frame = image.frame;
    place.sensor = SensorBlock(image, sensor_offsets_);
    return place;
  }

 private:
  const std::vector<ImageGeometry> images_;
  const std::vector<int32_t> sensor_offsets_;
  std::vector<char> has_frame_, has_point_;
};

void AddPositions(const Places& places, const BundleAdjustmentOptions& options,
                  const AdjustmentColumns& columns, AdjustmentBlocks* blocks) {
  std::vector<char> has_position(blocks->points.size(), 0);
  for (const KnownPosition& known : options.positions) {
    const auto place =
        places.Find(known.of == KnownPosition::Of::kImage, known.index);
    if (!place || !Moves(columns, *place)) continue;
    if (place->point >= 0) {
      CheckArgument(has_position[place->point] == 0, "positions", known.index,
                    "one of each point");
      has_position[place->point] = 1;
    }
    blocks->positions.push_back(
        {*place, known.region.centre,
         kRegionSigmas * *options.sigma_px * known.region.UnitFromWorld()});
  }
}

void AddDistances(const Places& places, const BundleAdjustmentOptions& options,
                  AdjustmentColumns* columns, AdjustmentBlocks* blocks) {
  std::vector<int32_t> of_frame(blocks->frames.size(), -1);
  std::vector<int32_t> of_point(blocks->points.size(), -1);
  int32_t number = 0;
  for (const AdjustmentComponent& component :
       FindComponents(*blocks, options.refine_sensor_from_rig)) {
    for (const size_t f : component.frames) of_frame[f] = number;
    for (const size_t k : component.points) of_point[k] = number;
    ++number;
  }
  const auto component_of = [&](const Place& place) {
    return place.point >= 0 ? of_point[place.point] : of_frame[place.frame];
  };
  for (size_t n = 0; n < options.distances.size(); ++n) {
    const KnownDistance& known = options.distances[n];
    DistanceObservation distance;
    distance.index = static_cast<int32_t>(n);
    const auto a = places.Find(known.ends[0].is_image, known.ends[0].index);
    const auto b = places.Find(known.ends[1].is_image, known.ends[1].index);
    if (!a || !b || component_of(*a) != component_of(*b) ||
        !MoveApart(*columns, *a, *b)) {
      continue;
    }
    distance.ends = {*a, *b};
    if (LengthOf(distance, *blocks) == 0) continue;  // has no direction
    if (known.metres) {
      distance.length = *known.metres;
      distance.px_from_world =
          kRegionSigmas * *options.sigma_px / known.tolerance;
    }
    for (const Place& end : distance.ends) {
      if (end.point >= 0) columns->Keep(end.point);
    }
    blocks->distances.push_back(distance);
  }
}

}  // namespace

void AddSurvey(const Model& model, const BundleAdjustmentOptions& options,
               AdjustmentColumns* columns, AdjustmentBlocks* blocks) {
  blocks->positions.clear();
  blocks->distances.clear();
  if (options.positions.empty() && options.distances.empty()) return;
  const Places places(model, *blocks);
  AddPositions(places, options, *columns, blocks);
  if (!options.distances.empty()) {
    AddDistances(places, options, columns, blocks);
  }
}

Vector3d PositionOf(const Place& place, const AdjustmentBlocks& blocks) {
  if (place.point >= 0) return blocks.points[place.point];
  const PoseBlock& frame = blocks.frames[place.frame];
  return RotationOf(frame).transpose() *
         (CenterInRig(blocks, place.sensor) - TranslationOf(frame));
}

double LengthOf(const DistanceObservation& distance,
                const AdjustmentBlocks& blocks) {
  return (PositionOf(distance.ends[0], blocks) -
          PositionOf(distance.ends[1], blocks))
      .norm();
}

double ErrorPx(const DistanceObservation& distance,
               const AdjustmentBlocks& blocks) {
  return distance.px_from_world *
         (LengthOf(distance, blocks) - distance.length);
}

double HalfSquaredSurvey(const AdjustmentBlocks& blocks) {
  double sum = 0;
  for (const PositionObservation& position : blocks.positions) {
    sum += (position.px_from_world *
            (PositionOf(position.of, blocks) - position.position))
               .squaredNorm();
  }
  for (const DistanceObservation& distance : blocks.distances) {
    const double error = ErrorPx(distance, blocks);
    sum += error * error;
  }
  return sum / 2;
}

// With R = R_s R_f and c = c_f + R_f'c_s, both as in AdjustmentColumns::Pose.
BlockJacobian DifferentiatePose(const AdjustmentColumns& columns,
                                const AdjustmentBlocks& blocks, int32_t frame,
                                int32_t sensor) {
  BlockJacobian pose;
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

BlockJacobian DifferentiatePosition(const AdjustmentColumns& columns,
                                    const AdjustmentBlocks& blocks,
                                    const Place& place) {
  BlockJacobian position;
  if (place.point < 0) {
    position = DifferentiatePose(columns, blocks, place.frame, place.sensor);
    position.J = position.J.bottomRows<3>().eval();
  } else if (columns.kept_points[place.point] != AdjustmentColumns::kHeld) {
    position = {{columns.kept_points[place.point]}, Matrix3d::Identity()};
  } else {
    position.J.resize(3, 0);
  }
  return position;
}

BlockJacobian DifferentiateLength(const AdjustmentColumns& columns,
                                  const AdjustmentBlocks& blocks,
                                  const std::array<Place, 2>& ends) {
  const Vector3d direction =
      (PositionOf(ends[0], blocks) - PositionOf(ends[1], blocks)).normalized();
  BlockJacobian a = DifferentiatePosition(columns, blocks, ends[0]);
  const BlockJacobian b = DifferentiatePosition(columns, blocks, ends[1]);
  BlockJacobian length;
  length.blocks = a.blocks;
  length.blocks.insert(length.blocks.end(), b.blocks.begin(), b.blocks.end());
  length.J.resize(1, a.J.cols() + b.J.cols());
  length.J << direction.transpose() * a.J, -direction.transpose() * b.J;
  return length;
}

namespace {

// A camera's centre, from the blocks rig_from_world and, unless it is null,
// sensor_from_rig.
template <typename T>
Eigen::Matrix<T, 3, 1> CenterFrom(const T* frame, const T* sensor) {
  Eigen::Matrix<T, 3, 1> x = Eigen::Matrix<T, 3, 1>::Zero();
  for (const T* pose : {sensor, frame}) {
    if (pose == nullptr) continue;
    const T inverse[4] = {pose[0], -pose[1], -pose[2], -pose[3]};
    const T from[3] = {x[0] - pose[4], x[1] - pose[5], x[2] - pose[6]};
    ceres::UnitQuaternionRotatePoint(inverse, from, x.data());
  }
  return x;
}

// The difference of a camera's centre from its known position, in pixels.
struct CenterCost {
  PositionObservation position;

  template <typename T>
  bool operator()(const T* frame, const T* sensor, T* residual) const {
    Eigen::Map<Eigen::Matrix<T, 3, 1>> r(residual);
    r = position.px_from_world.cast<T>() *
        (CenterFrom(frame, sensor) - position.position.cast<T>());
    return true;
  }
  template <typename T>
  bool operator()(const T* frame, T* residual) const {
    return (*this)(frame, static_cast<const T*>(nullptr), residual);
  }
};

void AddPositionBlocks(AdjustmentBlocks* blocks, ceres::Problem* problem) {
  for (const PositionObservation& position : blocks->positions) {
    const Place& of = position.of;
    if (of.point >= 0) {
      problem->AddResidualBlock(
          new ceres::NormalPrior(position.px_from_world, position.position),
          nullptr, blocks->points[of.point].data());
      continue;
    }
    double* const frame = blocks->frames[of.frame].data();
    auto* const cost = new CenterCost{position};
    if (of.sensor < 0) {
      problem->AddResidualBlock(
          new ceres::AutoDiffCostFunction<CenterCost, 3, 7>(cost), nullptr,
          frame);
    } else {
      problem->AddResidualBlock(
          new ceres::AutoDiffCostFunction<CenterCost, 3, 7, 7>(cost), nullptr,
          frame, blocks->sensors[of.sensor].data());
    }
  }
}

// The difference of a length from the known distance, in pixels.
struct DistanceCost {
  // The parameters of an end: of a point, or of a frame and perhaps a sensor;
  // -1: none. Both ends may share some.
  struct End {
    int point = -1, frame = -1, sensor = -1;
  };
  std::array<End, 2> ends;
  double length;
  double px_from_world;

  template <typename T>
  bool operator()(const T* const* parameters, T* residual) const {
    const auto position_of = [&](const End& end) -> Eigen::Matrix<T, 3, 1> {
      if (end.point < 0) {
        return CenterFrom(parameters[end.frame],
                          end.sensor < 0 ? nullptr : parameters[end.sensor]);
      }
      const T* x = parameters[end.point];
      return {x[0], x[1], x[2]};
    };
    *residual = px_from_world *
                ((position_of(ends[0]) - position_of(ends[1])).norm() - length);
    return true;
  }
};

void AddDistanceBlocks(AdjustmentBlocks* blocks, ceres::Problem* problem) {
  for (const DistanceObservation& distance : blocks->distances) {
    if (distance.px_from_world == 0) continue;
    std::vector<double*> parameters;
    std::vector<int> sizes;
    const auto number_of = [&](double* block, int size) {
      const auto found = std::find(parameters.begin(), parameters.end(), block);
      const auto number = static_cast<int>(found - parameters.begin());
      if (found == parameters.end()) {
        parameters.push_back(block);
        sizes.push_back(size);
      }
      return number;
    };
    auto* const cost =
        new DistanceCost{{}, distance.length, distance.px_from_world};
    for (size_t n = 0; n < distance.ends.size(); ++n) {
      const Place& place = distance.ends[n];
      DistanceCost::End& end = cost->ends[n];
      if (place.point >= 0) {
        end.point = number_of(blocks->points[place.point].data(), 3);
        continue;
      }
      end.frame = number_of(blocks->frames[place.frame].data(), 7);
      if (place.sensor < 0) continue;
      end.sensor = number_of(blocks->sensors[place.sensor].data(), 7);
    }
    auto* const function =
        new ceres::DynamicAutoDiffCostFunction<DistanceCost>(cost);
    for (const int size : sizes) function->AddParameterBlock(size);
    function->SetNumResiduals(1);
    problem->AddResidualBlock(function, nullptr, parameters);
  }
}

}  // namespace

void AddSurveyBlocks(AdjustmentBlocks* blocks, ceres::Problem* problem) {
  AddPositionBlocks(blocks, problem);
  AddDistanceBlocks(blocks, problem);
}

}  // namespace krot::internal
