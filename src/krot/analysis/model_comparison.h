#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "krot/base/context.h"
#include "krot/compare.h"
#include "krot/model.h"

namespace krot::internal {

// The angle between two rotations, in [0, 180] degrees; exact for small ones.
double AngleDeg(const Eigen::Matrix3d& A, const Eigen::Matrix3d& B);

// Where one image stands in two models.
struct PosePair {
  Eigen::Matrix3d cam_from_world1_rotation = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d cam_from_world2_rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d center1 = Eigen::Vector3d::Zero();
  Eigen::Vector3d center2 = Eigen::Vector3d::Zero();
  // The median distance from the points that it sees; 0 if it sees none.
  double distance1 = 0;
  double distance2 = 0;
  double weight = 1;  // of the squared distance in AlignCenters; > 0
};

// The poses that keep their place among the others from one model to the other
// (krot/geometry/transform.h). A camera that ran away says nothing about the
// frame that the models have in common. All poses if there is no such frame.
// O(images).
std::vector<PosePair> HeldPoses(const std::vector<PosePair>& poses);

// The RMS distance of the first model's camera centres from their centroid: a
// length that differences can be compared with, and the one that KROT's gauge
// keeps if they are HeldPoses. 0 if there are none.
double SceneRadius(const std::vector<PosePair>& poses);

// Aligns the two models as KROT's gauge does (problem/gauge.h), by HeldPoses:
// the rotation is the chordal mean of the images' R1' R2; then the centroids of
// the camera centres coincide, and the RMS distances from them are equal. Where
// one of these two radii is zero the scale is 1. None if there are no poses, or
// if the rotations point in all directions and have no mean. O(images).
std::optional<Similarity> AlignFrames(const std::vector<PosePair>& poses);

// The similarity that minimises the weighted sum of squared distances between
// the camera centres [Umeyama, PAMI 13(4), 1991]. None if there are fewer than
// three, or if those of one model lie on a line, to 3e-5 of its length, since
// any rotation about it would fit. O(images).
std::optional<Similarity> AlignCenters(const std::vector<PosePair>& poses);

// The identity for kNone, otherwise as above. Where all poses are equal bit by
// bit, the result is exactly the identity, if there is one.
std::optional<Similarity> Align(AlignmentKind kind,
                                const std::vector<PosePair>& poses);

// What two models of the same images have in common.

struct IndexPair {
  int32_t first = 0;   // index in the first model's list
  int32_t second = 0;  // index in the second's
};

struct ElementPair {
  uint64_t first = 0;  // index in the first model's track_elements
  uint64_t second = 0;
};

struct ModelCorrespondence {
  // Images of the same name, whatever their ids, in the order of the first
  // model. Of images that share a name within one model the first counts.
  std::vector<IndexPair> images;
  // 2D points of these images that both models list under the same index, not
  // more than 0.01 px apart, and that belong to a 3D point in both; where
  // several tracks hold a 2D point, those of 3D points with the same id.
  std::vector<ElementPair> observations;
  // 3D points that share more of these observations with each other than
  // with any third point, whatever their ids; among equals the one with the
  // same id, else the one that comes first. In the order of the first model.
  std::vector<IndexPair> points;
};

// Requires valid models (ValidateModel).
// O(2D points + observations log observations).
ModelCorrespondence FindCorrespondence(const Model& model1,
                                       const Model& model2);

// The poses of the shared images that have one in both models, in their order.
std::vector<PosePair> SharedPoses(const Model& model1, const Model& model2,
                                  const ModelCorrespondence& correspondence);

// As the public one. Requires valid models (ValidateModel) and the
// correspondence of just these. The result is the same at any thread count.
// O(observations).
std::optional<ComparisonSummary> CompareModels(
    const Model& model1, const Model& model2,
    const ModelCorrespondence& correspondence,
    const CompareModelsOptions& options);

// Degenerate geometry of an estimated model, which fits observations for no
// good reason: a point in a camera's centre lies on all of its rays, parallel
// rays meet at infinity, and where all points are one all cameras see the same.
// Errors do not show this; they may even fall to zero by it.
struct Collapse {
  int64_t num_points = 0;  // that two cameras see
  // Ids of points whose nearest camera has come closer than a millionth of the
  // median distance of the cameras that see them.
  std::vector<Point3DId> in_camera;
  // Ids of points whose rays have come within a millionth of a radian of each
  // other.
  std::vector<Point3DId> at_infinity;
  // Whether all points have come to lie within a millionth of the distance of
  // the nearest camera.
  bool is_in_one_place = false;

  bool Any() const {
    return is_in_one_place || !in_camera.empty() || !at_infinity.empty();
  }
  // Whether most points are part of it: then nothing is left of the scene.
  bool IsWhole() const {
    return is_in_one_place ||
           2 * static_cast<int64_t>(in_camera.size() + at_infinity.size()) >
               num_points;
  }
};

// Finds what has degenerated between two models with the same images. The
// second model's points must be among the first's. Only what was a hundred
// times less degenerate before, or had no finite position, counts. Requires
// valid models. O(observations).
Collapse FindCollapse(const Model& before, const Model& after,
                      const Context& context = {});

}  // namespace krot::internal
