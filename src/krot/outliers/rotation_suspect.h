#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "krot/base/context.h"
#include "krot/bridge/bridge.h"
#include "krot/model/model.h"
#include "krot/outliers/conflict.h"
#include "krot/outliers/decision.h"
#include "krot/outliers/removal.h"

namespace krot {

// An image that conflicts gather in, so that its rotation is the suspect:
// known rotations do not move.
struct RotationSuspect {
  ImageId image_id = 0;
  std::string image_name;
  int64_t num_conflicts = 0;  // that it takes part in
  // The turn of its camera, about its own axes, that fits best.
  double angle_deg = 0;
  Eigen::Vector3d axis_in_cam = Eigen::Vector3d::Zero();
  // Of its observations of points that others hold: all, and those above the
  // bound at the best position with its rotation and with the turn.
  int64_t num_observations = 0;
  int64_t num_above = 0;
  int64_t num_above_turned = 0;
  // No translations and points bring all errors below the one with the image;
  // without it they come down to the other. True pixels.
  double lower_bound_with = 0;
  double max_error_without = 0;
};

// Of the images that have a part in most conflicts, and in no fewer than three,
// the one with most observations removed; none otherwise. Points are placed by
// what the removal leaves of all other images, at their optimum; the turn, with
// the camera's position, is then that of least squares in pixels, errors above
// `bound` counting less (Cauchy). Costs three solves.
std::optional<RotationSuspect> FindRotationSuspect(
    const Model& model, const BuiltProblem& built, const ErrorBound& bound,
    const std::vector<Conflict>& conflicts, const Removal& removal,
    const Context& context);

}  // namespace krot
