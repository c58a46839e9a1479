#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "krot/compare.h"

namespace krot::internal {

// The angle between two rotations, in [0, 180] degrees; exact for small ones.
double AngleDeg(const Eigen::Matrix3d& A, const Eigen::Matrix3d& B);

// Where one image stands in two models.
struct PosePair {
  Eigen::Matrix3d cam_from_world1_rotation = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d cam_from_world2_rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d center1 = Eigen::Vector3d::Zero();
  Eigen::Vector3d center2 = Eigen::Vector3d::Zero();
  // From the points that it sees, the median; 0 if it sees none.
  double distance1 = 0;
  double distance2 = 0;
};

// Those that keep their place among the others from one model to the other
// (krot/geometry/consensus.h): a runaway says nothing about the frame that the
// models have in common. All of them where they have none. O(images).
std::vector<PosePair> HeldPoses(const std::vector<PosePair>& poses);

// The RMS distance of the first model's camera centres from their centroid: a
// length that differences can be compared with, and the one that KROT's gauge
// keeps if they are HeldPoses. 0 if there are none.
double SceneRadius(const std::vector<PosePair>& poses);

// The frame in which KROT keeps a model (problem/gauge.h), made the same in
// both: of HeldPoses, the rotation is the chordal mean of those that the images
// name (R1' R2), then the centroids of the camera centres coincide, and their
// RMS distances from it, too. Where one of the two radii is zero the scale
// is 1. None if there are no poses, or if the rotations point in all directions
// and have no mean. O(images).
std::optional<Similarity> AlignFrames(const std::vector<PosePair>& poses);

// The similarity that minimises the sum of squares of the distances between
// the camera centres [Umeyama, PAMI 13(4), 1991]. None if there are fewer than
// three, or if those of one model lie on a line, to 3e-5 of its length: the
// rotation about it could not be told. O(images).
std::optional<Similarity> AlignCenters(const std::vector<PosePair>& poses);

// The identity for kNone, the above otherwise. Where all poses are equal, bit
// by bit, every kind gives the identity to the bit, if it gives anything.
std::optional<Similarity> Align(AlignmentKind kind,
                                const std::vector<PosePair>& poses);

}  // namespace krot::internal
