#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "krot/base/context.h"
#include "krot/geometry.h"
#include "krot/model.h"
#include "krot/model/model_io.h"
#include "krot/model/rigs.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/problem/subset.h"
#include "krot/solve.h"

namespace krot::internal {

// Converts a COLMAP model to the known rotation problem, and an estimate of
// that back to a model.

// What to do with several observations of one image in the same track, of which
// at most one is right.
enum class SameImage {
  kKeep,
  kClosest,  // only the one with the smallest error at the model's own point is
             // kept
};

struct BuildProblemOptions {
  // Points with fewer usable observations take no part; >= 1. Two observations
  // of one image count as two.
  int min_track_length = 2;
  int num_threads = -1;  // -1: all; the result does not depend on it
  // Uses only rotations, rigs and rays of the model. Then no observation is
  // left out as `behind`, and as `no_pose` only if its rotation or rig is
  // unknown. `start` is whatever the model says and is no valid start.
  bool ignore_translations = false;
  // Must be kKeep if translations are ignored.
  SameImage same_image = SameImage::kKeep;
  FixedParts fixed = {};  // the parts of the model that must not move
  // Known positions in the model; those of parts that are fixed or have no
  // observation are ignored.
  std::vector<KnownPosition> positions = {};
  // Not null: the model is one rank's share of the points, with everything else
  // of the whole model; frames and views are then numbered as in the whole.
  Ranks* ranks = nullptr;
};

// Where a camera or a point is known to be; the problem has rows for it
// (reprojection.h).
struct BuiltPosition {
  KnownPosition::Of of = KnownPosition::Of::kImage;
  int32_t index = 0;  // of the view or the point, in the problem
  Ellipsoid region;
  Eigen::Matrix3d unit_from_world;  // region.UnitFromWorld()
};

// The problem, its start, and the place of each unknown in the model.
// Everything is in the order of the ids, and observations in the order of their
// tracks: the problem does not depend on the order of the model's records.
struct BuiltProblem {
  KnownRotationProblem problem;
  // The model's own translations and points; points that were behind a camera
  // are re-triangulated. All depths are positive, unless translations are
  // ignored.
  Estimate start;
  std::vector<int32_t> frame_of;    // problem frame -> index in model.frames
  std::vector<int32_t> image_of;    // problem view -> index in model.images
  std::vector<int32_t> point_of;    // problem point -> index in model.points3D
  std::vector<int32_t> point2D_of;  // observation -> index in image.points2D
  std::vector<Eigen::Vector2d> pixels;  // of the observations
  // For each observation, > 0: its row and error are divided by this, so a
  // bound of epsilon means epsilon * scale pixels for it. Empty: all are 1.
  std::vector<double> scales;
  // For each known position the problem has kRowsPerPosition further views,
  // behind those of the model, with one observation each that has no pixel. A
  // camera gets a fixed point, behind the model's points, which these views
  // see. A point is seen from a fixed frame, behind the model's frames. On the
  // boundary of the region, to first order, the residual of these rows is
  // `position_level` pixels.
  std::vector<BuiltPosition> positions;
  double position_level = 1;
  std::array<int64_t, kNumLeftOutReasons> left_out = {};
  int64_t num_retriangulated_points = 0;
  // Tracks with several usable observations of one image, whether or not they
  // are kept.
  int64_t num_same_image_tracks = 0;

  // Whether an observation is one of the model, not a row of a known position.
  bool HasPixel(int64_t observation) const {
    return problem.observations[observation].view <
           static_cast<int32_t>(image_of.size());
  }
  double ScaleOf(int64_t observation) const {
    return scales.empty() ? 1 : scales[observation];
  }
  int64_t NumPixels() const {
    return static_cast<int64_t>(problem.observations.size()) -
           static_cast<int64_t>(problem.views.size() - image_of.size());
  }
};

// Builds the problem of all observations that can be used. Unknowns are the
// frames and points that have any. Every image of such a frame is a view, even
// if it sees no point, because the gauge needs all cameras.
//
// What options.fixed marks is a constant of the problem; a fixed point takes
// part if it has one usable observation. options.positions add rows.
//
// An observation is left out for the first of these reasons that applies: its
// image has no pose; neither its frame nor its point may move; its point does
// not project and its pixel has no trustworthy ray (PixelBearing); it does not
// see its point, even if that is re-triangulated from all its rays (of the two
// positions of the point the one that fewer observations fail to see counts);
// options.same_image prefers another observation of its image and track; its
// point has too few usable observations. Rows are taken where the points
// project (RowAtProjection).
//
// Requires a valid model (ValidateModel). Throws std::invalid_argument for bad
// options. A problem without observations is not an error. O(observations +
// points log points); 100 bytes each.
BuiltProblem BuildProblem(const Model& model,
                          const BuildProblemOptions& options);

// Sets the scale of each observation. Requires a problem without scales and
// positions.
void ScaleObservations(std::vector<double> scales, BuiltProblem* built);

// The model's own translations and points as an estimate of a problem that was
// built from it. Nothing is re-triangulated, so depths may have any sign.
Estimate OwnEstimate(const Model& model, const BuiltProblem& built);

// A copy of `model` with the estimate's translations and points; rotations and
// everything else do not change. The pose of an image becomes that of its
// sensor in its frame, as COLMAP reads it: its translation is computed from the
// frame's, and its quaternion is replaced only if it differs as a rotation from
// what frame and rig imply. Whatever the estimate does not move keeps its bits.
// Throws std::invalid_argument if the estimate has not the size of the problem.
Model ApplyEstimate(const Model& model, const BuiltProblem& built,
                    const Estimate& estimate);

// A subset of built.problem as a built problem of its own, which starts from
// `start`, an estimate of the whole. Its counts of what was left out are zero.
// O(subset).
BuiltProblem BuiltPart(const BuiltProblem& built, const ProblemSubset& subset,
                       const Estimate& start);

// Moves points that took no part in the optimisation along with frames that
// have moved, so that they do not get worse. A point is moved if its largest
// error has risen above both its old value and `level`, pixels; errors that
// were not finite before do not count. It gets the shift of that image of its
// track which gives it the smallest error, and stays where it is if none helps.
// Fixed points stay. A point with one observation keeps its error up to
// rounding. `errors_px` are PixelErrors of `before` in the norm. O(observations
// of such points).
void CarryLeftOutPoints(const Model& before,
                        const std::vector<double>& errors_px, Norm norm,
                        const BuiltProblem& built, const FixedParts& fixed,
                        double level, Model* after);

// ---- The steps of BuildProblem ----

// Numbers the frames that have observations, and their images as views. Before,
// the `view` of an observation is the index of its image in the model;
// afterwards it is that of the view.
void AddFramesAndViews(const Model& model,
                       const std::vector<ImageGeometry>& geometries,
                       Ranks* ranks, BuiltProblem* built);

// Fixes the marked parts of the model at their positions in the problem's
// start.
void FixPositions(const FixedParts& fixed, BuiltProblem* built);

// ---- Observations of one image in the same track ----
//
// A point that was matched to two places of one image has at least one wrong
// observation.

// Whether two of a point's observations are from one image. O(count^2).
bool HasImageTwice(const Observation* observations, int count);

// For each of a point's observations, whether it has the smallest error at
// `xyz` among those of its image; the first one counts if several have the
// same. Requires rows that were taken there; `view` is the index of the image
// in `images`. O(count^2).
std::vector<char> ClosestOfImages(const std::vector<ImageGeometry>& images,
                                  const Observation* observations, int count,
                                  const Eigen::Vector3d& xyz);

// How a track element takes part in a built problem.
enum class Role : char {
  kOut,   // it takes no part
  kIn,    // it is an observation of the problem
  kTwin,  // it takes no part, because kClosest prefers another observation of
          // its image and track
};

// The role of each of the model's track elements in a problem that was built
// with `same_image`. O(observations).
std::vector<Role> RolesOf(const Model& model, const BuiltProblem& built,
                          SameImage same_image);

// The half-line from a camera's centre through an observation, in the world.
struct Ray {
  Eigen::Vector3d centre;
  Eigen::Vector3d direction;  // of unit length
};

// The point with the smallest sum of squared distances to the lines of the
// rays: the x of sum_i (I - d_i d_i') (x - C_i) = 0. None if the lines are
// parallel up to rounding. O(rays).
std::optional<Eigen::Vector3d> RetriangulateMidpoint(
    const std::vector<Ray>& rays);

// ---- Points behind their cameras ----

struct RepairedPoint {
  Eigen::Vector3d xyz = Eigen::Vector3d::Zero();
  bool is_retriangulated = false;
};

// Keeps the point where it is if all its images see it, or if re-triangulation
// from all its rays (where v = 0) does not lower the number of images that do
// not. `is_seen` says whether the i-th observation sees a position. Requires
// observations with poses, whose `view` is the image's index in `images`.
// O(count); allocates only if some image does not see the point.
RepairedPoint RepairPoint(
    const std::vector<ImageGeometry>& images, const Observation* observations,
    int count, const Eigen::Vector3d& xyz,
    const std::function<bool(int, const Eigen::Vector3d&)>& is_seen);

}  // namespace krot::internal
