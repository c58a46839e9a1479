#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

namespace krot::internal {

// [a]x, so that [a]x b = a x b.
Eigen::Matrix3d CrossMatrix(const Eigen::Vector3d& a);

// The median (LowerMedian) of each coordinate; requires at least one place.
Eigen::Vector3d MedianPlace(const std::vector<Eigen::Vector3d>& places);

// The median distance of places from one of them or any other; 0 without any.
double MedianDistance(const std::vector<Eigen::Vector3d>& places,
                      const Eigen::Vector3d& from);

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

// A camera in two models of the same scene, whose axes are parallel.
struct CameraMove {
  Eigen::Vector3d before = Eigen::Vector3d::Zero();  // its centre
  Eigen::Vector3d after = Eigen::Vector3d::Zero();
  // The typical distance of what it sees, scene units; 0 if unknown.
  double distance_before = 0;
  double distance_after = 0;
};

// Finds the cameras that keep their place among the others, 1 or 0 per camera,
// after one common translation and, if `scale_is_free`, one common scale. The
// others are runaways: they move farther than the typical distance of cameras
// from their centroid or from what they see, whichever is less, and more than
// ten times as far as the median camera. Up to half of the cameras may be
// runaways. If there are fewer than three cameras, or the distances of fewer
// than half of them are known, all keep their place. O(cameras).
std::vector<char> FindConsensus(const std::vector<CameraMove>& cameras,
                                bool scale_is_free);

}  // namespace krot::internal
