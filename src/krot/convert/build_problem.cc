#include "krot/convert/build_problem.h"

#include <cstdint>
#include <optional>
#include <unordered_map>
#include <vector>

#include "krot/base/check.h"
#include "krot/base/parallel_for.h"
#include "krot/camera/camera_model.h"
#include "krot/convert/reprojection.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;
using LeftOutCounts = std::array<int64_t, kNumLeftOutReasons>;

// The model, and tables that are looked up for every observation.
struct Sources {
  const Model& model;
  std::vector<ImageGeometry> geometries;
  std::unordered_map<ImageId, int32_t> image_indices;
};

// What became of one point of the model.
struct PointOutcome {
  int32_t index = 0;   // in the model
  uint64_t slots = 0;  // where its slots begin
  RepairedPoint point;
  int num_kept = 0;
  bool has_image_twice = false;
};

// Where a point's usable observations are written, in the track's order; there
// is a slot for every element of the track. Until Compact renumbers them,
// `view` is the index of the image in the model and `point` that of the point.
struct Slots {
  Observation* observations;
  int32_t* point2D;
  Eigen::Vector2d* pixels;

  void Move(int from, int to) const {
    observations[to] = observations[from];
    point2D[to] = point2D[from];
    pixels[to] = pixels[from];
  }
};

// The row where the point projects; none if its depth may be rounding alone.
std::optional<Eigen::Matrix3d> RowAtPoint(const Sources& sources,
                                          const ImageGeometry& geometry,
                                          const Eigen::Vector2d& pixel,
                                          const Vector3d& xyz) {
  const Camera& camera = sources.model.cameras[geometry.camera];
  const Vector3d x_cam = geometry.cam_from_world * xyz;
  const auto row = RowAtProjection(camera, pixel, x_cam);
  const double rounding =
      1e-14 * (xyz.norm() + geometry.cam_from_world.translation.norm());
  if (!row || !(row->row(0).dot(x_cam) > rounding)) return std::nullopt;
  return row;
}

// The row at the pixel's own ray.
std::optional<Eigen::Matrix3d> RowAtPixel(const Sources& sources,
                                          const ImageGeometry& geometry,
                                          const Eigen::Vector2d& pixel) {
  const Camera& camera = sources.model.cameras[geometry.camera];
  const auto bearing = PixelBearing(camera, pixel);
  if (!bearing) return std::nullopt;
  return RowAtProjection(camera, pixel, *bearing);
}

// Fills the slots with the observations that have a pose and a row. The row is
// taken where the point projects or, if it does not or translations are
// ignored, at the pixel's ray. If one observation does not see the point, the
// rows of all others that have a ray are taken at their rays, too, for the
// re-triangulation.
int CollectRows(const Sources& sources, int32_t point,
                const BuildProblemOptions& options, Slots slots,
                LeftOutCounts* left_out) {
  const Point3D& point3D = sources.model.points3D[point];
  const bool only_rays = options.ignore_translations;
  const bool is_fixed = options.fixed.HasPoint(point);
  int num_kept = 0;
  bool is_seen_by_all = true;
  for (const TrackElement& element : TrackOf(sources.model, point3D)) {
    const int32_t image = sources.image_indices.at(element.image_id);
    const ImageGeometry& geometry = sources.geometries[image];
    if (!geometry.has_pose) {
      ++(*left_out)[static_cast<size_t>(LeftOut::kNoPose)];
      continue;
    }
    if (is_fixed && options.fixed.HasFrame(geometry.frame)) {
      ++(*left_out)[static_cast<size_t>(LeftOut::kFixed)];
      continue;
    }
    const Point2D& point2D =
        sources.model.images[image].points2D[element.point2D_idx];
    const Eigen::Vector2d pixel(point2D.x, point2D.y);
    std::optional<Eigen::Matrix3d> row;
    if (!only_rays) row = RowAtPoint(sources, geometry, pixel, point3D.xyz);
    if (!row) {
      is_seen_by_all = false;
      row = RowAtPixel(sources, geometry, pixel);
    }
    if (!row) {
      ++(*left_out)[static_cast<size_t>(LeftOut::kUndistortion)];
      continue;
    }
    slots.observations[num_kept] = {*row, image, point};
    slots.point2D[num_kept] = static_cast<int32_t>(element.point2D_idx);
    slots.pixels[num_kept++] = pixel;
  }
  for (int i = 0; i < num_kept && !is_seen_by_all && !only_rays; ++i) {
    Observation& observation = slots.observations[i];
    const auto row = RowAtPixel(sources, sources.geometries[observation.view],
                                slots.pixels[i]);
    if (row) observation.E = *row;
  }
  return num_kept;
}

// Removes the observations in which the point does not project, and takes the
// rows of the others where it does.
int RemoveBehind(const Sources& sources, const Vector3d& xyz, int count,
                 Slots slots) {
  int num_kept = 0;
  for (int i = 0; i < count; ++i) {
    const Observation& observation = slots.observations[i];
    const auto row = RowAtPoint(sources, sources.geometries[observation.view],
                                slots.pixels[i], xyz);
    if (!row) continue;
    slots.Move(i, num_kept);
    slots.observations[num_kept++].E = *row;
  }
  return num_kept;
}

// Keeps only the observation closest to the point among those of each image.
void KeepClosest(const Sources& sources, const Vector3d& xyz, Slots slots,
                 int* count, LeftOutCounts* left_out) {
  const std::vector<char> is_closest =
      ClosestOfImages(sources.geometries, slots.observations, *count, xyz);
  int num_kept = 0;
  for (int i = 0; i < *count; ++i) {
    if (is_closest[i]) slots.Move(i, num_kept++);
  }
  (*left_out)[static_cast<size_t>(LeftOut::kSameImage)] += *count - num_kept;
  *count = num_kept;
}

void ProcessPoint(const Sources& sources, const BuildProblemOptions& options,
                  Slots slots, PointOutcome* outcome, LeftOutCounts* left_out) {
  const int32_t point = outcome->index;
  const bool is_fixed = options.fixed.HasPoint(point);
  const int num_rays = CollectRows(sources, point, options, slots, left_out);
  const Vector3d& xyz = sources.model.points3D[point].xyz;
  outcome->has_image_twice = HasImageTwice(slots.observations, num_rays);
  if (options.ignore_translations) {
    outcome->point.xyz = xyz;
    outcome->num_kept = num_rays;
  } else {
    const auto is_seen = [&](int i, const Vector3d& position) {
      return RowAtPoint(sources, sources.geometries[slots.observations[i].view],
                        slots.pixels[i], position)
          .has_value();
    };
    outcome->point = {xyz, /*is_retriangulated=*/false};
    if (!is_fixed) {
      outcome->point = RepairPoint(sources.geometries, slots.observations,
                                   num_rays, xyz, is_seen);
    }
    outcome->num_kept =
        RemoveBehind(sources, outcome->point.xyz, num_rays, slots);
    (*left_out)[static_cast<size_t>(LeftOut::kBehind)] +=
        num_rays - outcome->num_kept;
    if (outcome->has_image_twice && options.same_image == SameImage::kClosest) {
      KeepClosest(sources, outcome->point.xyz, slots, &outcome->num_kept,
                  left_out);
    }
  }
  if (!is_fixed && outcome->num_kept < options.min_track_length) {
    (*left_out)[static_cast<size_t>(LeftOut::kShortTrack)] += outcome->num_kept;
    outcome->num_kept = 0;
  }
}

// Processes all points in parallel, each in slots of its own.
std::vector<PointOutcome> ProcessPoints(const Sources& sources,
                                        const BuildProblemOptions& options,
                                        BuiltProblem* built) {
  const Model& model = sources.model;
  built->problem.observations.resize(model.track_elements.size());
  built->point2D_of.resize(model.track_elements.size());
  built->pixels.resize(model.track_elements.size());

  std::vector<PointOutcome> outcomes;
  outcomes.reserve(model.points3D.size());
  uint64_t num_slots = 0;
  for (const int32_t k : OrderOfIds(model.points3D)) {
    outcomes.push_back({k, num_slots, {}, 0, false});
    num_slots += model.points3D[k].track_end - model.points3D[k].track_begin;
  }
  const int64_t count = static_cast<int64_t>(outcomes.size());
  std::vector<LeftOutCounts> chunk_left_out(NumChunks(count, kItemsPerChunk),
                                            LeftOutCounts{});
  ParallelFor(count, kItemsPerChunk, options.num_threads,
              [&](int64_t begin, int64_t end, int) {
                for (int64_t n = begin; n < end; ++n) {
                  const uint64_t first = outcomes[n].slots;
                  ProcessPoint(sources, options,
                               {built->problem.observations.data() + first,
                                built->point2D_of.data() + first,
                                built->pixels.data() + first},
                               &outcomes[n],
                               &chunk_left_out[begin / kItemsPerChunk]);
                }
              });
  for (const LeftOutCounts& counts : chunk_left_out) {
    for (int r = 0; r < kNumLeftOutReasons; ++r)
      built->left_out[r] += counts[r];
  }
  return outcomes;
}

// Moves the kept observations together, and numbers the points that have any.
void Compact(const std::vector<PointOutcome>& outcomes, BuiltProblem* built) {
  std::vector<Observation>& observations = built->problem.observations;
  size_t num_kept = 0;
  for (const PointOutcome& outcome : outcomes) {
    built->num_same_image_tracks += outcome.has_image_twice;
    if (outcome.num_kept == 0) continue;
    const int32_t point = static_cast<int32_t>(built->point_of.size());
    built->point_of.push_back(outcome.index);
    built->start.points.push_back(outcome.point.xyz);
    built->num_retriangulated_points += outcome.point.is_retriangulated;

    const size_t end = outcome.slots + outcome.num_kept;
    for (size_t i = outcome.slots; i < end; ++i, ++num_kept) {
      observations[num_kept] = observations[i];
      observations[num_kept].point = point;
      built->point2D_of[num_kept] = built->point2D_of[i];
      built->pixels[num_kept] = built->pixels[i];
    }
  }
  observations.resize(num_kept);
  built->point2D_of.resize(num_kept);
  built->pixels.resize(num_kept);
  built->problem.num_points = static_cast<int32_t>(built->point_of.size());
}

// With translations ignored, an image has a pose if its rotation and its pose
// in the rig are known.
void PlaceByRotations(std::vector<ImageGeometry>* geometries) {
  for (ImageGeometry& image : *geometries) {
    image.has_pose = image.frame >= 0 &&
                     image.cam_from_rig.translation.allFinite() &&
                     image.rig_from_world.rotation.allFinite();
  }
}

}  // namespace

BuiltProblem BuildProblem(const Model& model,
                          const BuildProblemOptions& options) {
  CheckAtLeast(1, options.min_track_length, "options.min_track_length");
  Sources sources{model, ImageGeometries(model), ImageIndices(model)};
  if (options.ignore_translations) PlaceByRotations(&sources.geometries);
  BuiltProblem built;
  Compact(ProcessPoints(sources, options, &built), &built);
  AddFramesAndViews(model, sources.geometries, options.ranks, &built);
  FixPositions(options.fixed, &built);
  AddPositions(options.positions, &built);
  IndexObservations(&built.problem);
  return built;
}

void ScaleObservations(std::vector<double> scales, BuiltProblem* built) {
  for (size_t i = 0; i < scales.size(); ++i) {
    built->problem.observations[i].E.bottomRows<2>() /= scales[i];
  }
  built->scales = std::move(scales);
}

BuiltProblem BuiltPart(const BuiltProblem& built, const ProblemSubset& subset,
                       const Estimate& start) {
  BuiltProblem part;
  part.problem = subset.problem();
  part.start = subset.Restrict(start);
  part.frame_of.resize(part.problem.num_frames);
  part.image_of.resize(part.problem.views.size());
  part.point_of.resize(part.problem.num_points);
  for (size_t n = 0; n < part.problem.observations.size(); ++n) {
    const int64_t i = subset.InWhole(static_cast<int64_t>(n));
    const Observation& own = part.problem.observations[n];
    const Observation& in_whole = built.problem.observations[i];
    part.frame_of[part.problem.views[own.view].frame] =
        built.frame_of[built.problem.views[in_whole.view].frame];
    part.image_of[own.view] = built.image_of[in_whole.view];
    part.point_of[own.point] = built.point_of[in_whole.point];
    part.point2D_of.push_back(built.point2D_of[i]);
    part.pixels.push_back(built.pixels[i]);
    if (!built.scales.empty()) part.scales.push_back(built.scales[i]);
  }
  return part;
}

}  // namespace krot::internal

namespace krot {

using namespace internal;

const char* LeftOutName(LeftOut reason) {
  switch (reason) {
    case LeftOut::kBehind:
      return "behind";
    case LeftOut::kUndistortion:
      return "undistortion";
    case LeftOut::kShortTrack:
      return "short_track";
    case LeftOut::kNoPose:
      return "no_pose";
    case LeftOut::kSameImage:
      return "same_image";
    case LeftOut::kFixed:
      return "fixed";
  }
  return "unknown";
}

}  // namespace krot
