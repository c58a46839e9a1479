#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "krot/adjust/bundle_adjustment.h"
#include "krot/base/context.h"
#include "krot/camera/camera_model.h"
#include "krot/linear/blocks.h"
#include "krot/model.h"
#include "krot/model/model_io.h"
#include "krot/model/rigs.h"

namespace krot::internal {

// qw qx qy qz tx ty tz, the quaternion of unit norm.
using PoseBlock = std::array<double, 7>;

PoseBlock ToBlock(const Pose& pose);
Pose ToPose(const PoseBlock& block);
Eigen::Matrix3d RotationOf(const PoseBlock& block);
Eigen::Map<const Eigen::Vector3d> TranslationOf(const PoseBlock& block);
Eigen::Vector3d CenterOf(const PoseBlock& block);

// One observation: the blocks that its reprojection error depends on, and the
// measured pixel.
struct AdjustmentObservation {
  int32_t frame = -1;   // in AdjustmentBlocks::frames
  int32_t sensor = -1;  // in sensors; -1: the rig's reference sensor
  int32_t camera = -1;  // in cameras
  int32_t point = -1;   // in points
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  uint64_t element = 0;  // in Model::track_elements
};

// The centre of a camera, or a point.
struct Place {
  int32_t frame = -1;   // in AdjustmentBlocks::frames; -1: a point
  int32_t sensor = -1;  // in sensors; -1: the rig's reference sensor
  int32_t point = -1;   // in points; -1: a camera
};

// A known position: an observation of three coordinates.
struct PositionObservation {
  Place of;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  // Turns a difference in the world into one that has the noise of pixels.
  Eigen::Matrix3d px_from_world = Eigen::Matrix3d::Identity();
};

// A distance: one observation if it is known, else only asked for.
struct DistanceObservation {
  int32_t index = 0;  // in BundleAdjustmentOptions::distances
  std::array<Place, 2> ends;
  double length = 0;
  // Turns a difference into one that has the noise of pixels; 0 if the length
  // is not known.
  double px_from_world = 0;
};

// The unknowns of bundle adjustment as flat blocks of doubles, in the order of
// the model's own records, and the observations that take part.
struct AdjustmentBlocks {
  std::vector<PoseBlock> frames;   // rig_from_world
  std::vector<PoseBlock> sensors;  // sensor_from_rig, rig by rig
  std::vector<std::vector<double>> cameras;
  std::vector<int> camera_models;  // their ids
  std::vector<Eigen::Vector3d> points;
  // The square of the cap on every error in a bounded adjustment, pixels^2. It
  // is an unknown where the cap is lowered.
  double cap2 = std::numeric_limits<double>::infinity();
  std::vector<AdjustmentObservation> observations;  // point by point
  std::vector<PositionObservation> positions;
  std::vector<DistanceObservation> distances;
  // Marks the blocks that must not move.
  std::vector<char> frame_is_fixed;
  std::vector<char> sensor_is_fixed;  // if a fixed frame sees through it
  std::vector<char> point_is_fixed;

  int64_t num_images = 0;  // with observations
  int64_t num_no_pose = 0;
  int64_t num_behind = 0;
  int64_t num_short_track = 0;
};

// Where the sensors of each rig begin in AdjustmentBlocks::sensors, and which
// of these is the image's; -1: the reference sensor.
std::vector<int32_t> SensorOffsets(const Model& model);
int32_t SensorBlock(const ImageGeometry& image,
                    const std::vector<int32_t>& offsets);

// Leaves out observations without a pose, behind their camera or without a
// finite projection, and then all observations of points that have fewer than
// `min_track_length` left and are not fixed. Throws ModelError if a camera
// without an image plane sees a point. O(observations).
AdjustmentBlocks MakeAdjustmentBlocks(const Model& model, int min_track_length,
                                      const FixedParts& fixed = {});

// Where each point's observations begin; num_points + 1 of them.
std::vector<int64_t> PointBegins(const AdjustmentBlocks& blocks);

// A copy of the model with the values of the blocks. Records whose blocks did
// not change since `before` keep their bits; the poses of images follow their
// frames.
Model ApplyBlocks(const Model& model, const AdjustmentBlocks& before,
                  const AdjustmentBlocks& after);

// The indices of the camera parameters that the options refine, in COLMAP's
// order. Each group is refined as a whole: focal length(s), principal point,
// others.
std::vector<int> RefinedParams(int camera_model,
                               const BundleAdjustmentOptions& options);

// The unknowns that move. Apart from the points they are in blocks of three
// columns, which are numbered in the order frames, sensors, cameras, points
// that are kept, cap. Nothing moves that is fixed, or that has no observation.
struct AdjustmentColumns {
  static constexpr int32_t kHeld = -1;
  // The blocks of theta and c, where x -> R exp([theta]x) (x - c).
  struct Pose {
    int32_t rotation = kHeld;
    int32_t center = kHeld;
  };
  // As many blocks as the refined parameters need. Unused columns of the last
  // block stand for nothing.
  struct Camera {
    int32_t first_block = kHeld;
    std::vector<int> params;

    int32_t num_blocks() const {
      return static_cast<int32_t>(params.size() + 2) / 3;
    }
  };

  AdjustmentColumns(const BundleAdjustmentOptions& options,
                    const AdjustmentBlocks& blocks);

  std::vector<char> point_moves;  // as AdjustmentBlocks::points
  // For each point kHeld, or its block: a point at which a distance ends is not
  // eliminated, because the distance ties it to others.
  std::vector<int32_t> kept_points;
  std::vector<Pose> frames;   // as AdjustmentBlocks::frames
  std::vector<Pose> sensors;  // as sensors
  std::vector<Camera> cameras;
  int32_t cap = kHeld;  // one column
  int32_t num_blocks = 0;
  int64_t num_unknowns = 0;  // including points, without the cap

  void AddCap() { cap = num_blocks++; }
  void Keep(int32_t point) {
    if (kept_points[point] == kHeld && point_moves[point] != 0) {
      kept_points[point] = num_blocks++;
    }
  }
  bool IsEliminated(int64_t point) const {
    return point_moves[point] != 0 && kept_points[point] == kHeld;
  }
};

// Replaces the blocks' positions and distances by those of the options: the
// known positions of what moves, and the distances both of whose ends take
// part, in one component, and whose length is not the same however they move.
// Keeps the points at which these end. Throws std::invalid_argument if a point
// has two positions.
void AddSurvey(const Model& model, const BundleAdjustmentOptions& options,
               AdjustmentColumns* columns, AdjustmentBlocks* blocks);

// Where the blocks have it.
Eigen::Vector3d PositionOf(const Place& place, const AdjustmentBlocks& blocks);

double LengthOf(const DistanceObservation& distance,
                const AdjustmentBlocks& blocks);
// The difference from the known length, in pixels.
double ErrorPx(const DistanceObservation& distance,
               const AdjustmentBlocks& blocks);

// Half the sum of the squared differences from all known positions and
// distances, pixels^2.
double HalfSquaredSurvey(const AdjustmentBlocks& blocks);

// Derivatives by blocks of columns, which may come more than once: J has 3
// columns for each.
struct BlockJacobian {
  std::vector<int32_t> blocks;
  Eigen::MatrixXd J;
};
// Of a camera's rotation, about its own axes, and of its centre: 6 rows.
BlockJacobian DifferentiatePose(const AdjustmentColumns& columns,
                                const AdjustmentBlocks& blocks, int32_t frame,
                                int32_t sensor);
// Of a position, 3 rows, and of the length between two, one row. A point must
// not be eliminated.
BlockJacobian DifferentiatePosition(const AdjustmentColumns& columns,
                                    const AdjustmentBlocks& blocks,
                                    const Place& place);
BlockJacobian DifferentiateLength(const AdjustmentColumns& columns,
                                  const AdjustmentBlocks& blocks,
                                  const std::array<Place, 2>& ends);

// Sets the unknowns of `*to` to those of `from`, moved by `step` along a
// direction of points and blocks. Unknowns that do not move keep their bits.
// Both are blocks of the same model.
void MoveAlong(const AdjustmentColumns& columns, const AdjustmentBlocks& from,
               const BlockVector& direction, double step, AdjustmentBlocks* to);

// A connected component: its frames, refined sensors and points, as indices of
// AdjustmentBlocks. Only what takes part is in one.
struct AdjustmentComponent {
  std::vector<size_t> frames;  // as the others, ascending
  std::vector<size_t> sensors;
  std::vector<size_t> points;
  // Whether a sensor that is not refined has a translation, or a distance is
  // known.
  bool has_fixed_scale = false;
  bool is_held = false;  // something in it is fixed, or has a known position
};

// All components, in the order of their first frames. O(observations).
std::vector<AdjustmentComponent> FindComponents(const AdjustmentBlocks& blocks,
                                                bool refine_sensors);

// Moves every connected component of `after` by a similarity, so that the
// centroid of its camera centres, their RMS distance to it and the mean
// rotation are those of `before`. Only cameras that keep their place among the
// others count (krot/geometry/transform.h). Errors change only by rounding. The
// scale stays if a constant sensor_from_rig with a translation fixes it, and
// the rotation if rotations are constant. Nothing is done if frames or points
// are constant, or to a component with anything fixed. O(observations).
void RestoreSimilarity(const BundleAdjustmentOptions& options,
                       const AdjustmentBlocks& before, AdjustmentBlocks* after);

// For each frame the median distance, from its centre, of the points of these
// observations.
std::vector<double> TypicalDistances(
    const AdjustmentBlocks& blocks,
    const std::vector<AdjustmentObservation>& of);

// The error and the depth of an observation.
struct ProjectedError {
  Eigen::Vector2d r;  // projected minus measured, pixels
  double w;           // depth, > 0
};

// The errors of all observations. None if a point is not in front of its
// camera, or if an error is not below `max_error`. O(observations).
std::optional<std::vector<ProjectedError>> ProjectErrors(
    const AdjustmentBlocks& blocks, double max_error, int num_threads);

// Half the sum of the squared errors.
double HalfSquaredNorm(const std::vector<ProjectedError>& errors);

// The norm of the largest error; 0 if there are no errors.
double LargestError(const std::vector<ProjectedError>& errors);

// The pixel of a ray (u, v, 1) and its derivatives by (u, v).
struct DifferentiatedPixel {
  Eigen::Vector2d pixel;
  Eigen::Matrix2d J_ray;
};

// Differentiates forwards through lens and distortion, and in closed form by
// focal lengths and principal point, in which the pixel is affine. If
// `J_params` is not null it gets the derivatives by the camera's parameters, 2
// x num_params, row by row. Throws as ProjectRay does; not finite where its
// pixel is not.
DifferentiatedPixel DifferentiatePixel(Intrinsics intrinsics,
                                       const Eigen::Vector2d& ray,
                                       double* J_params);

// The derivatives D of (error x, error y, depth) of every observation, 3x3 by
// its point and by each block of columns that it depends on:
//
//   x_cam = R_s d_s,  d_s = x_rig - c_s,  x_rig = R_f d_f,  d_f = x - c_f
//
// with R exp([theta]x) in place of R (AdjustmentColumns::Pose).
class ErrorJacobians {
 public:
  // Keeps a reference to `columns`. Reads only the observations of the blocks.
  ErrorJacobians(const AdjustmentColumns& columns,
                 const AdjustmentBlocks& blocks);

  // Evaluates at blocks with the same observations, whose points are in front
  // of their cameras.
  void Evaluate(const AdjustmentBlocks& blocks, int num_threads);

  const Eigen::Matrix3d& by_point(int64_t i) const { return D_[begin_[i]]; }
  // By the block blocks(i)[n]. For the cap, which is the last, it is 0.
  const Eigen::Matrix3d& by_block(int64_t i, int n) const {
    return D_[begin_[i] + 1 + n];
  }
  // Ascending.
  const int32_t* blocks(int64_t i) const {
    return blocks_.data() + begin_[i] + 1;
  }
  int num_blocks(int64_t i) const {
    return static_cast<int>(begin_[i + 1] - begin_[i] - 1);
  }
  // The blocks of observations begin, ..., end - 1, each once and ascending.
  std::vector<int32_t> BlocksOf(int64_t begin, int64_t end) const;

 private:
  const AdjustmentColumns& columns_;
  std::vector<int64_t> begin_;   // num_observations + 1
  std::vector<int32_t> blocks_;  // kHeld for a point
  std::vector<Eigen::Matrix3d> D_;
};

// Minimises the squared errors below the cap blocks->cap2, by following the
// minima of barrier problems. All errors of the start must be below the cap;
// those of every iterate are. Sets termination, num_iterations, stationarity,
// duality_gap, num_active and linear_solver of the summary.
void AdjustBelowCap(const BundleAdjustmentOptions& options,
                    const Context& context, const AdjustmentColumns& columns,
                    AdjustmentBlocks* blocks, BundleAdjustmentSummary* summary);

// Moves nearly to a local minimum of the largest error: the cap becomes an
// unknown, with a weight beside which the squared errors hardly count. Counts
// iterations in the summary and sets its lowest_max_error, which is that of the
// start if it cannot be lowered, is_lowest_max_error_converged, and
// blocks->cap2, for a cap 5e-4 above that. In the end all errors are below this
// cap.
void LowerMaxError(const BundleAdjustmentOptions& options,
                   const Context& context, const AdjustmentColumns& columns,
                   AdjustmentBlocks* blocks, BundleAdjustmentSummary* summary);

}  // namespace krot::internal
