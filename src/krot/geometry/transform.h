#pragma once

#include <vector>

#include <Eigen/Core>

namespace krot::internal {

// [a]x, so that [a]x b = a x b.
Eigen::Matrix3d CrossMatrix(const Eigen::Vector3d& a);

// The median (LowerMedian) of each coordinate; there must be one place.
Eigen::Vector3d MedianPlace(const std::vector<Eigen::Vector3d>& places);

// A camera of two models of one scene, which have the same axes.
struct CameraMove {
  Eigen::Vector3d before = Eigen::Vector3d::Zero();  // its centre
  Eigen::Vector3d after = Eigen::Vector3d::Zero();
  // From what it typically sees, scene units; 0 if that is not known.
  double distance_before = 0;
  double distance_after = 0;
};

// Which cameras keep their place among the others, 1 or 0: what the models
// differ by otherwise is one translation and, if `scale_is_free`, one scale. A
// camera that leaves its place, a runaway, moves by more than cameras typically
// are away from their centroid or from what they see, whichever is less, and by
// more than ten times as far as they typically move. Up to half of the cameras
// may be runaways. All keep their place where there are fewer than three, or
// where the distances of fewer than half of them are known.
// O(cameras).
std::vector<char> FindConsensus(const std::vector<CameraMove>& cameras,
                                bool scale_is_free);

}  // namespace krot::internal
