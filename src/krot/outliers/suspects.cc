#include "krot/outliers/outlier_filter.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <unordered_set>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "krot/base/numbers.h"
#include "krot/camera/camera_model.h"
#include "krot/convert/reprojection.h"
#include "krot/geometry.h"
#include "krot/minimax/residual_set.h"
#include "krot/model.h"
#include "krot/model/rigs.h"
#include "krot/outliers/removal.h"

namespace krot::internal {
namespace {

// Counts observations, removals and conflicts of tracks, images or cameras.
class Counts {
 public:
  void Add(uint64_t id, bool is_removed, int64_t conflict) {
    Suspect& suspect = suspects_[id];
    suspect.id = id;
    ++suspect.num_observations;
    suspect.num_removed += is_removed;
    if (conflict >= 0) conflicts_[id].insert(conflict);
  }

  std::vector<Suspect> Ranked() {
    std::vector<Suspect> ranked;
    for (auto& [id, suspect] : suspects_) {
      suspect.num_conflicts = static_cast<int64_t>(conflicts_[id].size());
      if (suspect.num_removed > 0) ranked.push_back(std::move(suspect));
    }
    SortLargestFirst(&ranked, [](const Suspect& suspect) {
      return std::make_pair(suspect.num_removed, suspect.num_conflicts);
    });
    return ranked;
  }

 private:
  std::map<uint64_t, Suspect> suspects_;
  std::map<uint64_t, std::set<int64_t>> conflicts_;
};

// Fills in the tracks, images and cameras of a summary: which ones have removed
// observations, and how many.
void RankSuspects(const Model& model, const std::vector<char>& is_removed,
                  const std::vector<int64_t>& conflict_of,
                  OutlierFilterSummary* summary) {
  const std::vector<int32_t> image_of = ImagesOfElements(model);
  Counts tracks, images, cameras;
  for (const Point3D& point : model.points3D) {
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      const Image& image = model.images[image_of[e]];
      const bool is_gone = is_removed[e] != 0;
      tracks.Add(point.id, is_gone, conflict_of[e]);
      images.Add(image.id, is_gone, conflict_of[e]);
      cameras.Add(image.camera_id, is_gone, conflict_of[e]);
    }
  }
  summary->tracks = tracks.Ranked();
  summary->images = images.Ranked();
  summary->cameras = cameras.Ranked();
  const IdIndex<ImageId> index(model.images);
  for (Suspect& suspect : summary->images) {
    suspect.name =
        model.images[*index.Find(static_cast<ImageId>(suspect.id))].name;
  }
}

// The errors of the input's track elements with the result's cameras and
// points; NaN where the point was removed.
std::vector<double> ErrorsAfter(const Model& input, const Model& kept,
                                const Context& context) {
  Model model = input;
  model.frames = kept.frames;
  for (size_t n = 0; n < model.images.size(); ++n) {
    model.images[n].cam_from_world = kept.images[n].cam_from_world;
  }
  const IdIndex<Point3DId> kept_points(kept.points3D);
  for (Point3D& point : model.points3D) {
    const std::optional<int32_t> k = kept_points.Find(point.id);
    point.xyz = k ? kept.points3D[*k].xyz : Eigen::Vector3d::Constant(kNaN);
  }
  return PixelErrors(model, context.num_threads);
}

// The removed observations of `model`, largest error first, with their errors
// in `model` and with the cameras and points of `kept`, what is left of it.
std::vector<RemovedObservation> ListRemoved(
    const Model& model, const Model& kept,
    const std::vector<double>& errors_before,
    const std::vector<char>& is_removed,
    const std::vector<int64_t>& conflict_of, const Context& context,
    const std::vector<double>& w) {
  std::vector<RemovedObservation> list;
  const std::vector<double> errors_after = ErrorsAfter(model, kept, context);
  const std::vector<int32_t> image_of = ImagesOfElements(model);
  for (const Point3D& point : model.points3D) {
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      if (!is_removed[e]) continue;
      const TrackElement& element = model.track_elements[e];
      RemovedObservation removed;
      removed.image_id = element.image_id;
      removed.image_name = model.images[image_of[e]].name;
      removed.point2D_idx = element.point2D_idx;
      removed.point3D_id = point.id;
      removed.error_before_px = errors_before[e];
      removed.error_after_px = errors_after[e];
      if (conflict_of[e] >= 0) removed.conflict = conflict_of[e];
      if (!w.empty()) removed.w = w[e];
      list.push_back(std::move(removed));
    }
  }
  const auto key = [](const RemovedObservation& o) {
    return std::isnan(o.error_before_px) ? kInfinity : o.error_before_px;
  };
  SortLargestFirst(&list, key);
  return list;
}

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Vector6d = Eigen::Matrix<double, 6, 1>;

// An observation of the image, and its point in the camera as that stands now.
struct Sighting {
  Vector2d pixel;
  Vector3d x_cam;
};

// Fits the motion of the camera.
class TurnFit {
 public:
  TurnFit(const Intrinsics& source, const ErrorBound& bound,
          std::vector<Sighting> sightings)
      : source_(source), bound_(bound), sightings_(std::move(sightings)) {}

  // Fits the translation and, if asked to, the rotation.
  RigidTransform Fit(bool with_rotation) const {
    RigidTransform turn;
    for (int n = 0; n < 50; ++n) {
      const Vector6d step = Step(turn, with_rotation);
      if (!step.allFinite()) break;
      const Vector3d omega = step.head<3>();
      const double angle = omega.norm();
      if (angle > 0) {
        turn.rotation =
            Eigen::AngleAxisd(angle, omega / angle).toRotationMatrix() *
            turn.rotation;
      }
      turn.translation += step.tail<3>();
      if (with_rotation && angle < 1e-12) break;
    }
    return turn;
  }

  int64_t NumAbove(const RigidTransform& turn) const {
    return std::count_if(
        sightings_.begin(), sightings_.end(), [&](const Sighting& sighting) {
          const std::optional<Vector2d> e =
              ProjectionError(source_, sighting.pixel, turn * sighting.x_cam);
          return !e || !(NormOf(*e, bound_.norm) <= bound_.max_error);
        });
  }

 private:
  // A Gauss-Newton step, with rows taken at the projection: e = v / w.
  Vector6d Step(const RigidTransform& turn, bool with_rotation) const {
    Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
    Vector6d gradient = Vector6d::Zero();
    for (const Sighting& sighting : sightings_) {
      const Vector3d turned = turn.rotation * sighting.x_cam;
      const Vector3d x = turned + turn.translation;
      const std::optional<Matrix3d> row =
          RowAtProjection(source_, sighting.pixel, x);
      if (!row) continue;
      const Vector3d wv = *row * x;
      const Vector2d e = wv.tail<2>() / wv[0];
      const Eigen::Matrix<double, 2, 3> by_x =
          (row->bottomRows<2>() - e * row->row(0)) / wv[0];
      Eigen::Matrix<double, 2, 6> J;
      J.rightCols<3>() = by_x;
      J.leftCols<3>().setZero();
      if (with_rotation) {
        for (int k = 0; k < 3; ++k) {
          J.col(k) = by_x * Vector3d::Unit(k).cross(turned);
        }
      }
      const double weight =
          1 / (1 + e.squaredNorm() / (bound_.max_error * bound_.max_error));
      normal += weight * J.transpose() * J;
      gradient += weight * J.transpose() * e;
    }
    for (int k = 0; k < 6; ++k) {
      normal(k, k) = normal(k, k) > 0 ? normal(k, k) * (1 + 1e-9) : 1;
    }
    return -normal.ldlt().solve(gradient);
  }

  const Intrinsics source_;
  const ErrorBound bound_;
  const std::vector<Sighting> sightings_;
};

// For each view the number of conflicts that it has observations in.
std::vector<int64_t> ConflictsOfViews(const KnownRotationProblem& problem,
                                      const std::vector<Conflict>& conflicts) {
  std::vector<int64_t> counts(problem.views.size(), 0);
  for (const Conflict& conflict : conflicts) {
    std::vector<int32_t> views;
    for (const int64_t i : conflict.observations) {
      views.push_back(problem.observations[i].view);
    }
    SortUnique(&views);
    for (const int32_t v : views) ++counts[v];
  }
  return counts;
}

// Of the views in most conflicts the one with most observations removed. (A
// conflict of two images accuses both alike.)
std::optional<int32_t> SuspectedView(const KnownRotationProblem& problem,
                                     const std::vector<int64_t>& counts,
                                     size_t num_conflicts,
                                     const Removal& removal) {
  std::vector<int64_t> num_removed(problem.views.size(), 0);
  for (const int64_t i : removal.observations) {
    ++num_removed[problem.observations[i].view];
  }
  std::optional<int32_t> suspected;
  for (size_t v = 0; v < counts.size(); ++v) {
    const bool is_in_most =
        counts[v] >= 3 && 2 * counts[v] >= static_cast<int64_t>(num_conflicts);
    if (!is_in_most) continue;
    if (!suspected || num_removed[v] > num_removed[*suspected]) {
      suspected = static_cast<int32_t>(v);
    }
  }
  return suspected;
}

// The view's observations of points that have two observations in other views.
std::vector<Sighting> SightingsOf(const BuiltProblem& built,
                                  const Reprojection& reprojection,
                                  const std::vector<int64_t>& observations,
                                  const Estimate& estimate) {
  const KnownRotationProblem& problem = built.problem;
  std::vector<Sighting> sightings;
  for (const int64_t i : observations) {
    const int32_t k = problem.observations[i].point;
    int64_t num_others = 0;
    for (const int64_t j : problem.OfPoint(k)) {
      num_others +=
          problem.observations[j].view != problem.observations[i].view;
    }
    if (num_others < 2) continue;
    sightings.push_back({built.pixels[i], reprojection.InCamera(estimate, i)});
  }
  return sightings;
}

}  // namespace

void ColorSuspects(const OutlierFilterSummary& summary, Model* model) {
  std::unordered_set<Point3DId> removed, in_conflict;
  for (const RemovedObservation& o : summary.removed) {
    removed.insert(o.point3D_id);
  }
  if (summary.conflicts) {
    for (const ConflictFile::Conflict& conflict :
         summary.conflicts->conflicts) {
      for (const CertificateFile::SupportObservation& o :
           conflict.observations) {
        in_conflict.insert(o.point3D_id);
      }
    }
  }
  for (Point3D& point : model->points3D) {
    point.color = removed.count(point.id) > 0       ? kRemovedColor
                  : in_conflict.count(point.id) > 0 ? kConflictColor
                                                    : kUnsuspectedColor;
  }
}

Filtering::Filtering(const Model& model, const OutlierFilterOptions& options,
                     const Context& context)
    : model_(model),
      options_(options),
      context_(context),
      errors_before_(PixelErrors(model, context.num_threads)),
      is_removed_(model.track_elements.size(), 0),
      conflict_of_(model.track_elements.size(), -1) {
  summary_.method = options.method;
  summary_.norm = options.solve.norm;
  summary_.num_observations = static_cast<int64_t>(model.track_elements.size());
  summary_.num_points = static_cast<int64_t>(model.points3D.size());
  summary_.pixel_error_before = Summarize(errors_before_);
}

void Filtering::RemoveMore(const std::vector<char>& is_gone) {
  RemovedObservations rest =
      RemoveObservations(kept_.model, is_gone, /*drops_short=*/false);
  for (uint64_t& e : rest.element_of) e = kept_.element_of[e];
  rest.num_left_alone += kept_.num_left_alone;
  rest.num_points += kept_.num_points;
  kept_ = std::move(rest);
}

void Filtering::TakeConflicts(const BuiltProblem& built,
                              const std::vector<uint64_t>& elements,
                              const ErrorBound& bound,
                              std::vector<Conflict> conflicts) {
  std::vector<PixelCertificate> proofs;
  for (Conflict& conflict : conflicts) {
    for (const int64_t i : conflict.observations) {
      conflict_of_[elements[i]] = summary_.num_proved;
    }
    ++summary_.num_proved;
    summary_.num_irreducible += conflict.is_irreducible;
    proofs.push_back(std::move(conflict.proof));
  }
  summary_.conflicts =
      DescribeConflicts(model_, built, bound.norm, bound.max_error, proofs);
}

std::vector<double> Filtering::Describe() {
  std::vector<double> errors = PixelErrors(kept_.model, context_.num_threads);
  summary_.pixel_error_after = Summarize(errors);
  summary_.num_left_alone = kept_.num_left_alone;
  summary_.num_points_removed = kept_.num_points;
  summary_.removed = ListRemoved(model_, kept_.model, errors_before_,
                                 is_removed_, conflict_of_, context_, w_);
  RankSuspects(model_, is_removed_, conflict_of_, &summary_);
  return errors;
}

std::optional<RotationSuspect> FindRotationSuspect(
    const Model& model, const BuiltProblem& built, const ErrorBound& bound,
    const std::vector<Conflict>& conflicts, const Removal& removal,
    const Context& context) {
  const std::vector<int64_t> counts =
      ConflictsOfViews(built.problem, conflicts);
  const std::optional<int32_t> view =
      SuspectedView(built.problem, counts, conflicts.size(), removal);
  if (!view) return std::nullopt;
  const auto is_of_view = [&](int64_t i) {
    return built.problem.observations[i].view == *view;
  };
  const std::vector<int64_t> observations =
      IndicesWhere(SignedSize(built.problem.observations), is_of_view);
  std::vector<int64_t> observations_and_removed;
  std::set_union(observations.begin(), observations.end(),
                 removal.observations.begin(), removal.observations.end(),
                 std::back_inserter(observations_and_removed));
  const Context within = context.Within("asking whether a rotation is wrong");
  const auto solve = [&](const std::vector<int64_t>& removed,
                         const Estimate& start) {
    return SolveWithout(model, built, removed, start, bound.norm, within);
  };
  const OptimumWithout with = solve({}, built.start);
  const OptimumWithout without = solve(observations, built.start);
  const OptimumWithout placed =
      solve(observations_and_removed, removal.estimate);
  const Reprojection reprojection(model, built);
  std::vector<Sighting> sightings =
      SightingsOf(built, reprojection, observations, placed.estimate);
  if (context.IsCancelled() || sightings.size() < 6) return std::nullopt;
  RotationSuspect suspect;
  const Image& image = model.images[built.image_of[*view]];
  suspect.image_id = image.id;
  suspect.image_name = image.name;
  suspect.num_conflicts = counts[*view];
  suspect.lower_bound_with = with.lower_bound;
  suspect.max_error_without = without.max_error;
  suspect.num_observations = static_cast<int64_t>(sightings.size());
  const TurnFit fit(reprojection.SourceOf(observations[0]), bound,
                    std::move(sightings));
  const RigidTransform turn = fit.Fit(/*with_rotation=*/true);
  suspect.num_above = fit.NumAbove(fit.Fit(/*with_rotation=*/false));
  suspect.num_above_turned = fit.NumAbove(turn);
  const Eigen::AngleAxisd angle_axis(turn.rotation);
  suspect.angle_deg = angle_axis.angle() * kDegreesPerRadian;
  suspect.axis_in_cam = angle_axis.axis();
  return suspect;
}

}  // namespace krot::internal
