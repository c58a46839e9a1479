#include <cstdint>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "krot/bridge/bridge.h"
#include "krot/finish/robust_least_squares.h"
#include "krot/geometry.h"
#include "krot/model/image_geometry.h"
#include "krot/model/local_frame.h"
#include "krot/outliers/match_tracks.h"
#include "krot/outliers/removal_start.h"
#include "krot/problem/gauge.h"

namespace krot::internal {
namespace {

// The first of tracks that the robust start's positions divide, the second of
// those that their own positions do.
constexpr int kTriangulations = 2;

// Without positions, points and tracks.
Model RotationsOf(const Model& model) {
  Model rotations = model;
  for (Frame& frame : rotations.frames) {
    if (!HasRotation(frame.rig_from_world.quaternion_wxyz)) continue;
    frame.rig_from_world.translation.setZero();
  }
  return rotations;
}

// Moves the frames of the problem to the estimate, in the model's place and
// scale, and leaves no tracks.
Model PosesAt(const Model& model, const BuiltProblem& built, Estimate estimate,
              const Context& context) {
  RestoreGaugeIfHarmless(built.problem, OwnEstimate(model, built), Norm::L2(),
                         context, &estimate);
  return ApplyEstimate(model, built, estimate);
}

PlacedMatches PlaceInFrame(const Model& poses, const Database& database,
                           const MatchTracksOptions& options,
                           const Context& context) {
  PlacedMatches placed;
  OutlierFilterOptions from_nothing;
  from_nothing.max_error = options.max_error_px;
  from_nothing.solve.init = SolveInit::kFeasible;
  context.Stage("baselines of " + std::to_string(database.pairs.size()) +
                " pairs");
  // Of what is left out on the way nothing is to be said.
  Context quiet = context;
  quiet.on_note = {};
  const Model rotations = RotationsOf(poses);
  Model tracks =
      TracksFromRotations(rotations, database, options.max_error_px, context);
  for (size_t f = 0; f < poses.frames.size(); ++f) {
    tracks.frames[f].rig_from_world = poses.frames[f].rig_from_world;
  }
  if (tracks.points3D.empty()) return {poses, {}, 0};
  RemovalStart start = FindRemovalStart(tracks, from_nothing, context);
  const std::set<int32_t> held(start.built.image_of.begin(),
                               start.built.image_of.end());
  const std::vector<ImageGeometry> geometries = ImageGeometries(rotations);
  for (size_t i = 0; i < geometries.size(); ++i) {
    placed.num_unplaced +=
        geometries[i].has_pose && held.count(static_cast<int32_t>(i)) == 0;
  }
  placed.model = PosesAt(tracks, start.built, start.built.start, context);
  for (int n = 0; n < kTriangulations && !context.IsCancelled(); ++n) {
    MatchTracksResult made =
        TriangulateMatches(placed.model, database, options, quiet);
    placed.summary = made.summary;
    placed.model = std::move(made.model);
    if (n + 1 == kTriangulations) break;
    if (placed.model.points3D.empty()) break;
    const BuiltProblem built = BuildProblem(placed.model, {});
    Estimate estimate = built.start;
    MinimizeRobustly(built.problem, context, &estimate);
    placed.model = PosesAt(placed.model, built, std::move(estimate), context);
  }
  return placed;
}

}  // namespace

PlacedMatches PlaceMatches(const Model& model, const Database& database,
                           const MatchTracksOptions& options,
                           const Context& context) {
  Model poses = model;
  poses.points3D.clear();
  poses.track_elements.clear();
  for (Image& image : poses.images) {
    for (Point2D& point : image.points2D) point.point3D_id = kInvalidPoint3DId;
  }
  return InLocalFrame(LocalFrame(poses), poses, [&](const Model& local) {
    return PlaceInFrame(local, database, options, context);
  });
}

}  // namespace krot::internal
