#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "krot/analysis/epipolar_match.h"
#include "krot/geometry.h"

namespace krot::internal {

// A match of one image, whose pose is in question, with another, whose pose is
// known.
struct WitnessMatch {
  PixelRay ray;        // of the image in question, in its camera's axes
  PixelRay other_ray;  // of the other image, in world axes
  Eigen::Vector3d other_center;
};

enum class PoseChange {
  kMove,  // another centre, the same rotation
  kTurn   // another rotation, the same centre
};

// The pose, changed in one of the two ways, for which the matches have the
// least sum of absolute errors: Sampson's distances, by iteratively reweighted
// least squares from the pose as it is. `noise_px`, positive, is the error
// below which matches weigh the same. A local minimum; the pose itself if there
// are no matches. O(iterations * matches), at most 50 iterations.
RigidTransform FitEpipolarPose(const std::vector<WitnessMatch>& matches,
                               const RigidTransform& cam_from_world,
                               PoseChange change, double noise_px);

// How many of the matches are within the tolerance under a pose of their image.
int64_t NumAgreeing(const std::vector<WitnessMatch>& matches,
                    const RigidTransform& cam_from_world, double tolerance_px);

// The point with the least weighted sum of squared distances to lines.
class NearestPoint {
 public:
  // A line through a point along a unit vector.
  void Add(const Eigen::Vector3d& point, const Eigen::Vector3d& direction,
           double weight);

  // None where the lines do not determine it.
  std::optional<Eigen::Vector3d> Solve() const;

 private:
  Eigen::Matrix3d normal_ = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right_side_ = Eigen::Vector3d::Zero();
};

}  // namespace krot::internal
