#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "krot/base/context.h"
#include "krot/math/norm.h"
#include "krot/model.h"
#include "krot/model/model_io.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/problem/subset.h"
#include "krot/solve.h"

namespace krot::internal {

// Between a COLMAP model and the known rotation problem.

// What becomes of several observations of one image in the same track, of
// which one at most is right.
enum class SameImage {
  kKeep,
  kClosest,  // the one with the smallest error at the model's own point stays
};

struct BuildProblemOptions {
  // Usable observations that a point needs to be optimised; >= 1. Two of one
  // image are two.
  int min_track_length = 2;
  int num_threads = -1;  // -1: all; the result does not depend on it
  // Takes nothing from the model but rotations, rigs and rays: no observation
  // is left out as `behind`, and as `no_pose` only where rotation or rig are
  // unknown. No start then: `start` is what the model says, whatever that is.
  bool ignore_translations = false;
  SameImage same_image = SameImage::kKeep;  // kKeep if translations are ignored
  FixedParts fixed = {};                    // what must not move, of that model
  // Of that model; what is fixed, or has no observation, needs none.
  std::vector<KnownPosition> positions = {};
  // The model is one rank's share of the points, with all of the rest: frames
  // and views are those of the whole. Null: it is the whole.
  Ranks* ranks = nullptr;
};

// Where a view's camera or a point is known to be, as rows of the problem
// (reprojection.h).
struct BuiltPosition {
  KnownPosition::Of of = KnownPosition::Of::kImage;
  int32_t index = 0;  // of the view or the point in the problem
  Ellipsoid region;
  Eigen::Matrix3d unit_from_world;  // region.UnitFromWorld()
};

// The problem, its start, and where each unknown lives in the model. All stand
// in the order of their ids, observations in that of their tracks: the same
// whatever order the records of the model have.
struct BuiltProblem {
  KnownRotationProblem problem;
  // The model's own translations and points, with the points re-triangulated
  // that were behind a camera. All depths are positive (unless translations
  // are ignored).
  Estimate start;
  std::vector<int32_t> frame_of;    // problem frame -> index in model.frames
  std::vector<int32_t> image_of;    // problem view -> index in model.images
  std::vector<int32_t> point_of;    // problem point -> index in model.points3D
  std::vector<int32_t> point2D_of;  // observation -> index in image.points2D
  std::vector<Eigen::Vector2d> pixels;  // of the observations
  // Of the observations, > 0: their rows and errors are divided by it, so that
  // a bound of epsilon is one of epsilon * scale pixels for each. Empty: 1.
  std::vector<double> scales;
  // Behind what the model has, the problem holds kRowsPerPosition views for
  // each of these, each with an observation that has no pixel: of a fixed point
  // behind the model's, one for each camera, or from a fixed frame behind the
  // model's, of a point. Where a region ends the residual of its rows is
  // `position_level`, pixels.
  std::vector<BuiltPosition> positions;
  double position_level = 1;
  std::array<int64_t, kNumLeftOutReasons> left_out = {};
  int64_t num_retriangulated_points = 0;
  // Tracks with several usable observations of one image, whatever becomes of
  // them.
  int64_t num_same_image_tracks = 0;

  // Whether an observation is one of the model, and not a position's row.
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

// The problem of all observations that can be used: the unknowns are the
// frames and points that have any. Every image of such a frame is a view,
// whether or not it sees a point, so that the gauge knows all cameras.
//
// What options.fixed marks stands still in the problem, and a fixed point is
// part of it for one usable observation. options.positions add rows.
//
// An observation is left out for the first of these reasons: its image has no
// pose; neither that nor its point may move; its point does not project and its
// pixel has no trustworthy ray (PixelBearing); it does not see its point, and
// re-triangulating that from all its rays does not bring it into sight of all
// (then the fewest are left out); options.same_image prefers another of its
// image and track; its point has too few usable observations. Rows are taken
// where the points project (RowAtProjection).
//
// Requires a valid model (ValidateModel). Throws std::invalid_argument for bad
// options. A problem without observations is no error. O(observations
// + points log points); 100 bytes each.
BuiltProblem BuildProblem(const Model& model,
                          const BuildProblemOptions& options);

// Gives the observations scales, one each. Requires a problem without any, and
// without positions.
void ScaleObservations(std::vector<double> scales, BuiltProblem* built);

// The model's own translations and points as an estimate of a problem that was
// built from it, wherever they are: nothing is re-triangulated, and depths may
// be of any sign.
Estimate OwnEstimate(const Model& model, const BuiltProblem& built);

// A copy of `model` with the estimate's translations and points; rotations and
// everything else are unchanged. An image's pose becomes that of its sensor in
// its frame, as COLMAP reads it: translations are composed anew, and the
// quaternion of an image is replaced only if it is another rotation than its
// frame and rig imply. What the estimate leaves where it is keeps its bits.
// Throws std::invalid_argument where the estimate does not have the size of the
// problem.
Model ApplyEstimate(const Model& model, const BuiltProblem& built,
                    const Estimate& estimate);

// The subset of built.problem as a built problem of its own, from `start`, an
// estimate of the whole; what was left out is not counted. O(subset).
BuiltProblem BuiltPart(const BuiltProblem& built, const ProblemSubset& subset,
                       const Estimate& start);

// Points that took no part in the optimisation, in a model whose frames have
// moved: where the largest error of such a point, finite before, has risen
// above both its own old one and `level`, pixels, the point moves along with
// the image, of those of its track, that serves it best, and stays where it is
// if none does. What is fixed stays. A point of one observation keeps its error
// exactly to rounding. `errors_px` are PixelErrors of `before` in the norm.
// O(observations of such points).
void CarryLeftOutPoints(const Model& before,
                        const std::vector<double>& errors_px, Norm norm,
                        const BuiltProblem& built, const FixedParts& fixed,
                        double level, Model* after);

}  // namespace krot::internal
