#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "krot/analysis/noise.h"
#include "krot/check.h"
#include "krot/linear/blocks.h"
#include "krot/model.h"
#include "krot/model/rigs.h"

namespace krot::internal {

// An observation at the least squares of its track. The error and its
// derivatives are divided by its relative sigma.
struct PoseRow {
  uint64_t element = 0;  // in Model::track_elements
  int32_t image = 0;
  double relative_sigma = 1;
  Eigen::Vector3d x_cam;
  Eigen::Vector2d error;  // projected - measured, pixels
  // By the camera's rotation (from the left) and centre. The derivative by the
  // point is minus that by the centre.
  Eigen::Matrix<double, 2, 6> F;
};

// The observations of each track that `noise` tests, as it fits them.
class PoseRows {
 public:
  // Keeps references. Requires a valid model. O(observations).
  PoseRows(const Model& model, const ModelNoise& noise);

  // Of point k; empty if fewer than two are left.
  std::vector<PoseRow> Of(size_t k) const;

  const std::vector<ImageGeometry>& geometries() const { return geometries_; }

  // By the turn of the row's frame about its centre, in rig axes, and by that.
  Eigen::Matrix<double, 2, 6> ByFrame(const PoseRow& row) const;

  // G with G G' = H^+, H being the information of the rows about their point.
  static Eigen::Matrix3d RootOf(const std::vector<PoseRow>& rows);

 private:
  const Model& model_;
  const ModelNoise& noise_;
  const std::vector<ImageGeometry> geometries_;
  const std::vector<int32_t> image_of_;  // by track element
  std::vector<double> nearest_;  // distance of a point, by image; scene units
};

// The cameras of images: a model's, or others that project the same.
struct Lenses {
  std::vector<Camera> cameras;
  std::vector<int32_t> of_image;  // in `cameras`, as Model::images
  bool can_move_in_rigs = true;
};

// What images share of a camera, and may be wrong with it: columns of the
// derivatives that are freed together.
struct SharedGroup {
  int32_t camera = 0;  // index in Lenses::cameras
  int32_t rig = -1;    // index in Model::rigs, of kPlaceInRig
  CameraFault fault = CameraFault::kFocalLength;
  std::vector<int> params;  // indices in Camera::params
  Eigen::Index begin = 0;   // the first column
  Eigen::Index size = 0;
  int64_t num_images = 0;
  // As in PoseSums, over the camera's images.
  int64_t num_directions = 0;
  double square = 0;
};

// The derivatives of a PoseRow's error by the columns of a group. No camera
// model has more parameters.
struct ByGroup {
  int32_t group;
  Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, 16> C;
};

// The focal length, principal point and distortion of every lens with an image
// plane, and the place of every camera in its rig but for the reference
// sensor's.
class SharedColumns {
 public:
  // Keeps references. `sums` are AddUpImages of the model.
  SharedColumns(const Lenses& lenses,
                const std::vector<ImageGeometry>& geometries,
                const std::vector<PoseSums>& sums);

  const std::vector<SharedGroup>& groups() const { return groups_; }
  Eigen::Index num_columns() const { return num_columns_; }

  // Leaves only these groups their columns.
  void Keep(const std::vector<char>& is_kept);

  // By the columns of the groups that have some. A camera in a rig turns about
  // its centre, which moves in the rig. Derivatives by the lens are
  // central differences.
  std::vector<ByGroup> ByGroups(const PoseRow& row) const;

 private:
  void AddLenses();
  void AddPlaces();
  void Number();

  const Lenses& lenses_;
  const std::vector<ImageGeometry>& geometries_;
  std::vector<SharedGroup> groups_;
  std::vector<std::vector<int32_t>> groups_of_camera_;
  std::vector<int32_t> place_of_image_;  // -1: a reference sensor
  Eigen::Index num_columns_ = 0;
};

// What the columns of cameras gain, the points and the poses eliminated: D and
// g, below.
struct GainSystem {
  explicit GainSystem(Eigen::Index size)
      : D(Eigen::MatrixXd::Zero(size, size)), g(Eigen::VectorXd::Zero(size)) {}

  Eigen::VectorXd StepOf(const SharedGroup& group) const {
    return DeterminedStep<Eigen::VectorXd>(
        D.block(group.begin, group.begin, group.size, group.size),
        g.segment(group.begin, group.size));
  }
  double GainOf(const SharedGroup& group) const {
    return group.size == 0 || g.size() == 0
               ? 0
               : -g.segment(group.begin, group.size).dot(StepOf(group));
  }

  // Frees the group's columns: what is left is the gain beside it.
  void Free(const SharedGroup& group) {
    if (group.size == 0) return;
    const Eigen::MatrixXd rows = D.middleRows(group.begin, group.size);
    const Eigen::MatrixXd own = rows.middleCols(group.begin, group.size);
    Eigen::MatrixXd steps(group.size, g.size());
    for (Eigen::Index c = 0; c < g.size(); ++c) {
      steps.col(c) = DeterminedStep<Eigen::VectorXd>(own, rows.col(c));
    }
    g += rows.transpose() * DeterminedStep<Eigen::VectorXd>(
                                own, g.segment(group.begin, group.size));
    D += rows.transpose() * steps;
  }

  Eigen::MatrixXd D;
  Eigen::VectorXd g;
};

// Eliminates the points and then the poses of frames from the normal equations
// with the columns of cameras. `length` is the unit in which centres move.
// Without columns if the poses cannot be eliminated.
GainSystem EliminatePoses(const Model& model, const PoseRows& rows,
                          const SharedColumns& shared, double length,
                          int num_threads);

// Finds cameras whose focal length, principal point, distortion or place in
// the rig is wrong: freeing it lowers the sum of squared errors of the camera's
// images by a tenth and more, and by more than noise explains.
//
// One step of bundle adjustment, to first order: with the errors e, and their
// derivatives F by all poses of frames and C by what cameras share, points
// eliminated from both, freeing columns C lowers e'e by
//
//   g' D^-1 g,  D = C'C - C'F (F'F)^-1 F'C,  g = C'e - C'F (F'F)^-1 F'e.
//
// What lowers it most goes first, and then the gain of all others beside it is
// found. In a model that is not adjusted cameras of one image are not judged.
// In one that is, where no camera is wrong so, those of several images in the
// models SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL and RADIAL are judged as OPENCV
// (kAspectRatio, kLens). If none of these is wrong either, and `errors_agree`,
// every image gets such a camera of its own (kSharing), of up to 500.
//
// Takes the observations that `noise` tests; noise.sigma_px must be known.
// Where nothing gains as much with the poses held, as in a model that was
// adjusted with all cameras free, the cost is O(observations), otherwise that
// of a step of bundle adjustment. The same bits at any number of threads.
std::vector<WrongCamera> FindWrongCameras(const Model& model,
                                          const ModelNoise& noise,
                                          bool is_adjusted, bool errors_agree,
                                          double false_alarm, int num_threads);

// Adds to check->cameras those of which all images, at least three, are wrong:
// that is no chance. Requires the images' verdicts. O(images).
void AddCamerasOfWrongImages(const Model& model, ModelCheck* check);

// As ModelCheck::still_points. O(observations).
std::vector<int32_t> FindStillPoints(const Model& model);

// As ModelCheck::same_photos. O(observations log(longest track)).
std::vector<std::array<int32_t, 2>> FindSamePhotos(const Model& model);

}  // namespace krot::internal
