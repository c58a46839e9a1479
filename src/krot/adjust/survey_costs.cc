#include <algorithm>
#include <array>
#include <vector>

#include <ceres/autodiff_cost_function.h>
#include <ceres/dynamic_autodiff_cost_function.h>
#include <ceres/normal_prior.h>
#include <ceres/problem.h>
#include <ceres/rotation.h>

#include "krot/adjust/adjustment_blocks.h"
#include "krot/adjust/ceres_problem.h"

namespace krot::internal {
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
