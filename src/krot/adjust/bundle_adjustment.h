#pragma once

#include <cstdint>
#include <optional>
#include <stdexcept>
#include <vector>

#include <Eigen/Core>

#include "krot/adjust.h"
#include "krot/base/context.h"
#include "krot/base/numbers.h"
#include "krot/model.h"

namespace krot::internal {

// How precise and how reliable an adjustment is, as photogrammetric protocols
// say it [Foerstner, Wrobel, Photogrammetric Computer Vision, 2016, Ch. 4].
//
// With J the derivatives of all errors by all u unknowns, at the least squares
// of n observations of two coordinates each and of m known positions and d
// known distances, whose errors are in pixels, too:
//
//   redundancy  r = 2 n + 3 m + d - rank J
//   sigma0^2    = sum |error|^2 / r
//   covariance  C = sigma0^2 S (J'J)^- S'
//   R           = I - J (J'J)^- J', whose trace is r: what shows of noise
//
// Where nothing holds place, rotation and scale, J has a defect of 7 per
// connected component (fewer where a part is fixed), and C depends on the
// datum, that is on what is said to have no errors: S takes them from any
// generalised inverse to that datum [Baarda 1973]. R and sigma0 do not.

enum class AdjustmentDatum {
  // The mean of the frames' centres, their RMS distance to it and their mean
  // rotation: what RestoreSimilarity holds.
  kCameras,
  kPoints,       // inner constraints over all points: least trace of theirs
  kFirstCamera,  // the first frame, and the coordinate of the frame farthest
                 // from it that differs most; kCameras where parts are fixed
};

struct ObservationPrecision {
  uint64_t element = 0;  // in Model::track_elements
  int32_t image = 0;     // in Model::images
  Eigen::Vector2d residual_px =
      Eigen::Vector2d::Zero();  // projected - measured
  // Redundancy numbers: the diagonal of R_ii, for x and y. NaN if unknown.
  Eigen::Vector2d redundancy = Eigen::Vector2d::Constant(kNaN);
  // e'(sigma0^2 R_ii)^-1 e over the directions that are controlled (check.h),
  // and how many are.
  double chi2 = 0;
  int num_controlled = 0;
};

struct ImagePrecision {
  int32_t image = 0;  // in Model::images
  int64_t num_observations = 0;
  Eigen::Vector2d rms_px = Eigen::Vector2d::Zero();  // of x and y
  double max_px = 0;
  // The covariance of the rotation about the camera's own axes x, y, z,
  // radians, and of the centre X, Y, Z, scene units. None if it is unknown, or
  // not determined.
  std::optional<Eigen::Matrix<double, 6, 6>> covariance;
};

struct CameraPrecision {
  int32_t camera = 0;       // in Model::cameras
  std::vector<int> params;  // that were refined
  // The covariance of these; none if it is unknown, or not determined.
  std::optional<Eigen::MatrixXd> covariance;
};

struct PointPrecision {
  int32_t point = 0;  // in Model::points3D
  int num_rays = 0;
  // The angle between two of its rays that is nearest to 90; degrees.
  double angle_deg = 0;
  double rms_px = 0;
  // Standard deviations of X, Y, Z; NaN if unknown, infinite if not determined.
  Eigen::Vector3d sigma = Eigen::Vector3d::Constant(kNaN);
};

struct DistancePrecision {
  int32_t distance = 0;  // in BundleAdjustmentOptions::distances
  double sigma = kNaN;   // of the length; infinite if it is not determined
  // Of a known distance: its redundancy number; NaN if unknown.
  double redundancy = kNaN;
  // The difference from the known length over its standard deviation.
  double w = kNaN;
};

struct AdjustmentPrecision {
  AdjustmentDatum datum = AdjustmentDatum::kCameras;
  // Whether what was adjusted is the least squares, without a loss or a cap.
  bool is_least_squares = true;
  int64_t num_positions = 0;  // known ones that took part
  int64_t num_distances = 0;  // known ones that took part
  int64_t num_unknowns = 0;
  int64_t datum_defect = 0;
  // Unknowns, beyond the datum, that no observation determines. Unknown without
  // covariances, and counted as 0.
  int64_t num_undetermined = 0;
  int64_t num_points_in_cameras = 0;  // that see them; left out of all this
  int64_t redundancy = 0;
  double sigma0_px = kNaN;  // NaN without redundancy
  bool has_covariances = false;
  std::vector<ObservationPrecision> observations;  // as in AdjustmentBlocks
  std::vector<ImagePrecision> images;        // with observations, ascending
  std::vector<CameraPrecision> cameras;      // with refined parameters
  std::vector<PointPrecision> points;        // with observations, ascending
  std::vector<DistancePrecision> distances;  // known and others
};

struct BundleAdjustmentResult {
  Model model;  // a copy of the input where nothing was adjusted
  BundleAdjustmentSummary summary;
};

// Minimises the cost from the model's own estimate. Everything that must not
// move or takes no part keeps its bits. The gauge is free during the solve.
// After it, every connected component without anything fixed is moved so that
// it has its former centroid of camera centres, their former RMS distance to it
// (unless a constant rig baseline fixes the scale) and its former mean
// rotation, unless that would raise the cost by rounding. Cameras that ran away
// do not count (krot/geometry/transform.h). Stored point errors are not
// updated.
//
// A step that takes a point behind a camera that sees it is rejected; with a
// cap, so is a step that takes an error to the cap. With a cap the result has
// the same bits at any number of threads. Without one, Ceres adds up in no
// fixed order on more than one thread, and the last digits differ from run to
// run.
//
// Requires a valid model (ValidateModel). Throws ModelError for cameras without
// an image plane, std::invalid_argument for options out of range and
// NoCeresError in a build without Ceres.
//
// If `precision` is not null it gets the precision of the result; none where
// nothing was adjusted.
BundleAdjustmentResult AdjustBundle(
    const Model& model, const BundleAdjustmentOptions& options,
    const Context& context = {},
    AdjustmentDatum datum = AdjustmentDatum::kCameras,
    std::optional<AdjustmentPrecision>* precision = nullptr);

// Thrown by a build without Ceres, which cannot adjust.
class NoCeresError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// Ceres warns on stderr, through glog, of steps that it could not take, which
// the summary tells as well. From now on, everything in this process that logs
// through glog only prints messages that end the process.
void SilenceCeres();

}  // namespace krot::internal
