#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "krot/analysis/noise.h"
#include "krot/base/numbers.h"
#include "krot/base/parallel_for.h"
#include "krot/camera/camera_model.h"
#include "krot/check.h"
#include "krot/geometry/transform.h"
#include "krot/model.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

// The right reading lowers the median error of a wrong model by more than this
// factor; so do some of the many wrong ones, by chance, but not to less than
// this share of the photo's size. Poses from a phone's sensors are as good.
constexpr double kClearly = 4;
constexpr double kFits = 0.01;
constexpr size_t kNumTracks = 200;  // that are asked, evenly spread
constexpr size_t kFewest =
    10;  // tracks, or observations of a sensor, that tell

struct Sight {
  int32_t image = -1;
  Eigen::Vector2d pixel;
  bool is_anchor = true;  // takes part in where its track's point is
  bool is_asked = true;   // its error counts
};

// What is asked of images of reference sensors (which are all, but for rigs
// with several sensors) and of others; none: to be left out.
struct Roles {
  struct Role {
    bool is_anchor = false, is_asked = false;
  };
  std::optional<Role> of_references, of_others;
};
constexpr Roles kReferencesAlone = {{{true, true}}, {}};
constexpr Roles kOthersAtReferences = {{{true, false}}, {{false, true}}};
constexpr Roles kOthers = {{{true, false}}, {{true, true}}};

// A sample of a model's tracks, or of a database's matches, seen by cameras in
// other conventions than the model's.
class TrackSample {
 public:
  // Takes matches if there are no tracks. Keeps references.
  TrackSample(const Model& model, const std::vector<ImageGeometry>& geometries,
              const Roles& roles, const Database* database)
      : model_(model), geometries_(geometries), roles_(roles) {
    TakeTracks();
    if (tracks_.empty() && database != nullptr) TakeMatches(*database);
  }

  size_t num_tracks() const { return tracks_.size(); }
  // The error below which a reading fits.
  double FitPx() const { return kFits * largest_px_; }

  double MedianErrorWhereSeen(const Conventions& from) const {
    return MedianErrorWhereSeen(from, LensesIn(from));
  }

  // With the model's points; where there are none, where they are seen.
  double MedianErrorWithPoints(const Conventions& from) const {
    if (places_.empty()) return MedianErrorWhereSeen(from);
    return MedianError(Cameras(from), Poses(from), [&](size_t k) {
      return std::optional(from.ToColmap(places_[k]));
    });
  }

  // Points may be right where poses are read wrongly.
  bool HasWrongPoints(const Conventions& from) const {
    return MedianErrorWithPoints(from) >
           std::max(kFilteredPx, kClearly * from.median_error_px);
  }

  // The simplest within a fifth of the lowest error; all have the same lenses.
  Conventions SimplestOfBest(std::vector<Conventions> all,
                             const Context& context) const {
    const Lenses lenses = LensesIn(all.front());
    ParallelForEach(
        static_cast<int64_t>(all.size()), context.num_threads,
        [&](int64_t n) {
          all[n].median_error_px = MedianErrorWhereSeen(all[n], lenses);
        },
        /*chunk_size=*/16);
    std::stable_sort(all.begin(), all.end(), [](const auto& a, const auto& b) {
      return a.median_error_px < b.median_error_px;
    });
    const Conventions* simplest = &all.front();
    for (const Conventions& one : all) {
      if (one.median_error_px > 1.2 * all.front().median_error_px) break;
      if (one.NumDifferences() < simplest->NumDifferences()) simplest = &one;
    }
    return *simplest;
  }

  // Adds to `all`, which have the same lenses, each with other translations of
  // its sensors: so much longer that, in the median, rays of other sensors pass
  // their points where references see them.
  void AddWithRigFactors(std::vector<Conventions>* all) const {
    const Lenses lenses = LensesIn(all->front());
    for (size_t n = all->size(); n-- > 0;) {
      Conventions one = (*all)[n];
      one.rig_factor = RigFactor(one, lenses);
      if (one.rig_factor != 1) all->push_back(one);
    }
  }

 private:
  struct Lenses {
    std::vector<Camera> cameras;
    // Of all tracks' pixels, in camera axes; none where the lens has none.
    std::vector<std::vector<std::optional<Vector3d>>> bearings;
  };

  // 1 if nothing tells it.
  double RigFactor(const Conventions& from, const Lenses& lenses) const {
    const std::vector<RigidTransform> poses = Poses(from);
    std::vector<double> factors;
    for (size_t k = 0; k < tracks_.size(); ++k) {
      const std::optional<Vector3d> place = PlaceOf(k, poses, lenses);
      if (!place) continue;
      for (size_t i = 0; i < tracks_[k].size(); ++i) {
        const Sight& sight = tracks_[k][i];
        const std::optional<Vector3d>& bearing = lenses.bearings[k][i];
        if (sight.is_anchor || !bearing) continue;
        // b x (R x + f t) = 0
        const Vector3d t = SensorOf(sight.image, from).translation;
        const Vector3d b_t = bearing->cross(t);
        const Vector3d b_R_x = bearing->cross(poses[sight.image] * *place - t);
        const double factor = -b_t.dot(b_R_x) / b_t.squaredNorm();
        if (factor > 0 && std::isfinite(factor)) factors.push_back(factor);
      }
    }
    return factors.empty() ? 1 : LowerMedian(std::move(factors));
  }

  void TakeTracks() {
    const std::vector<int32_t> image_of = ImagesOfElements(model_);
    const size_t num = model_.points3D.size();
    const size_t stride = num / kNumTracks + 1;
    for (size_t first = 0; first < std::min(stride, num); ++first) {
      for (size_t k = first; k < num; k += stride) {
        if (tracks_.size() == kNumTracks) return;
        const Point3D& point = model_.points3D[k];
        std::vector<Sight> track;
        for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
          const uint32_t i = model_.track_elements[e].point2D_idx;
          const Point2D& pixel = model_.images[image_of[e]].points2D[i];
          AddSight(image_of[e], {pixel.x, pixel.y}, &track);
        }
        if (TakeIfTells(std::move(track))) places_.push_back(point.xyz);
      }
    }
  }

  void TakeMatches(const Database& database) {
    int64_t num = 0, passed = 0;
    for (const VerifiedPair& pair : database.pairs) {
      num += static_cast<int64_t>(pair.matches.size());
    }
    const int64_t step = num / static_cast<int64_t>(kNumTracks) + 1;
    for (const VerifiedPair& pair : database.pairs) {
      for (const auto& match : pair.matches) {
        if (passed++ % step != 0) continue;
        std::vector<Sight> track;
        const auto& [i1, i2] = match;
        AddSight(pair.image1, database.keypoints[pair.image1][i1], &track);
        AddSight(pair.image2, database.keypoints[pair.image2][i2], &track);
        TakeIfTells(std::move(track));
      }
    }
  }

  std::optional<Roles::Role> RoleOf(int32_t image) const {
    const ImageGeometry& geometry = geometries_[image];
    if (!geometry.has_pose) return std::nullopt;
    return geometry.sensor < 0 ? roles_.of_references : roles_.of_others;
  }

  bool TakeIfTells(std::vector<Sight> track) {
    const auto is_anchor = [](const Sight& sight) { return sight.is_anchor; };
    const auto is_asked = [](const Sight& sight) { return sight.is_asked; };
    if (std::count_if(track.begin(), track.end(), is_anchor) < 2 ||
        std::none_of(track.begin(), track.end(), is_asked)) {
      return false;
    }
    for (const Sight& sight : track) {
      largest_px_ = std::fmax(largest_px_, sight.pixel.cwiseAbs().maxCoeff());
      images_.insert(sight.image);
    }
    tracks_.push_back(std::move(track));
    return true;
  }

  void AddSight(int32_t image, const Eigen::Vector2d& pixel,
                std::vector<Sight>* track) const {
    const auto role = RoleOf(image);
    if (role) {
      track->push_back({image, pixel, role->is_anchor, role->is_asked});
    }
  }

  // Of a sensor that is not its rig's reference.
  RigidTransform SensorOf(int32_t image, const Conventions& from) const {
    const ImageGeometry& geometry = geometries_[image];
    const RigSensor& sensor =
        model_.rigs[geometry.rig].sensors[geometry.sensor];
    return from.SensorToColmap(*sensor.sensor_from_rig).Transform();
  }

  // Of the images that see tracks; all others are left at the identity.
  std::vector<RigidTransform> Poses(const Conventions& from) const {
    std::vector<RigidTransform> poses(geometries_.size());
    for (const int32_t n : images_) {
      const ImageGeometry& geometry = geometries_[n];
      poses[n] = from.ToColmap(model_.frames[geometry.frame].rig_from_world)
                     .Transform();
      if (geometry.sensor >= 0) poses[n] = SensorOf(n, from) * poses[n];
    }
    return poses;
  }

  std::vector<Camera> Cameras(const Conventions& from) const {
    std::vector<Camera> cameras;
    for (const Camera& camera : model_.cameras) {
      cameras.push_back(from.ToColmap(camera));
    }
    return cameras;
  }

  Lenses LensesIn(const Conventions& from) const {
    Lenses lenses = {Cameras(from), {}};
    for (const std::vector<Sight>& track : tracks_) {
      auto& bearings = lenses.bearings.emplace_back();
      for (const Sight& sight : track) {
        bearings.push_back(PixelBearing(
            lenses.cameras[geometries_[sight.image].camera], sight.pixel));
      }
    }
    return lenses;
  }

  std::optional<Vector3d> PlaceOf(size_t k,
                                  const std::vector<RigidTransform>& poses,
                                  const Lenses& lenses) const {
    NearestPoint nearest;
    for (size_t i = 0; i < tracks_[k].size(); ++i) {
      const Sight& sight = tracks_[k][i];
      if (!sight.is_anchor) continue;
      const std::optional<Vector3d>& bearing = lenses.bearings[k][i];
      if (!bearing) return std::nullopt;
      const RigidTransform& pose = poses[sight.image];
      nearest.Add(Center(pose), pose.rotation.transpose() * *bearing, 1);
    }
    return nearest.Solve();
  }

  double MedianErrorWhereSeen(const Conventions& from,
                              const Lenses& lenses) const {
    const std::vector<RigidTransform> poses = Poses(from);
    return MedianError(lenses.cameras, poses,
                       [&](size_t k) { return PlaceOf(k, poses, lenses); });
  }

  // The median error of the sensor that has the largest; reference sensors are
  // taken together. No error counts more than the largest coordinate of a
  // pixel, and that of a point that is not in front of its camera as much.
  template <typename PlaceOfTrack>
  double MedianError(const std::vector<Camera>& cameras,
                     const std::vector<RigidTransform>& poses,
                     const PlaceOfTrack& place_of) const {
    std::map<std::array<int32_t, 2>, std::vector<double>> errors;
    for (size_t k = 0; k < tracks_.size(); ++k) {
      const std::optional<Vector3d> place = place_of(k);
      for (const Sight& sight : tracks_[k]) {
        if (!sight.is_asked) continue;
        const ImageGeometry& geometry = geometries_[sight.image];
        const auto pixel = place ? ProjectPoint(cameras[geometry.camera],
                                                poses[sight.image] * *place)
                                 : std::nullopt;
        const double error = pixel ? (*pixel - sight.pixel).norm() : kInfinity;
        errors[{geometry.sensor < 0 ? -1 : geometry.rig, geometry.sensor}]
            .push_back(std::fmin(error, largest_px_));
      }
    }
    double largest = 0;
    for (auto& [sensor, of_sensor] : errors) {
      if (of_sensor.size() < kFewest && errors.size() > 1) continue;
      largest = std::max(largest, LowerMedian(std::move(of_sensor)));
    }
    return largest;
  }

  const Model& model_;
  const std::vector<ImageGeometry>& geometries_;
  const Roles roles_;
  std::vector<std::vector<Sight>> tracks_;
  std::set<int32_t> images_;      // that see them
  double largest_px_ = 0;         // coordinate of a pixel
  std::vector<Vector3d> places_;  // the model's points; empty for matches
};

// How the images of reference sensors are written. None if they fit in no way,
// and the default if they fit as they are.
std::optional<Conventions> FindPoses(const TrackSample& sample,
                                     const Context& context) {
  const double as_read = sample.MedianErrorWithPoints({});
  if (as_read <= kFilteredPx) return Conventions();
  const double seen = sample.MedianErrorWhereSeen({});
  for (const double factor : {1.0, 0.5, 2.0, 0.25, 4.0, 0.125, 8.0}) {
    for (const bool is_central : {false, true}) {
      std::vector<Conventions> all;
      for (const PoseConventions& poses : PoseConventions::All()) {
        Conventions& one = all.emplace_back();
        one.poses = poses;
        one.intrinsics_factor = factor;
        one.has_central_principal_point = is_central;
      }
      Conventions best = sample.SimplestOfBest(std::move(all), context);
      // If points alone are wrong, the poses are as good as COLMAP's.
      const double limit = best.NumDifferences() == 0
                               ? kFilteredPx
                               : std::min(sample.FitPx(), seen / kClearly);
      if (best.median_error_px <= std::min(limit, as_read / kClearly)) {
        best.median_error_as_read_px = as_read;
        best.has_wrong_points = sample.HasWrongPoints(best);
        return best;
      }
      if (seen <= sample.FitPx()) return std::nullopt;  // others do worse
    }
  }
  return std::nullopt;
}

// How sensors of rigs are written, all else being `known`, which is returned if
// they fit as they are, or in no way.
Conventions FindSensors(const TrackSample& sample, const Conventions& known,
                        const Context& context) {
  const double seen = sample.MedianErrorWhereSeen(known);
  if (seen <= kFilteredPx) return known;
  std::vector<Conventions> all;
  for (const PoseConventions& sensors : PoseConventions::All()) {
    all.emplace_back(known).sensors = sensors;
  }
  sample.AddWithRigFactors(&all);
  Conventions best = sample.SimplestOfBest(std::move(all), context);
  if (best.median_error_px > std::min(sample.FitPx(), seen / kClearly)) {
    return known;
  }
  best.median_error_as_read_px =
      std::max(known.median_error_as_read_px, sample.MedianErrorWithPoints({}));
  best.has_wrong_points = known.has_wrong_points || sample.HasWrongPoints(best);
  return best;
}

}  // namespace
}  // namespace krot::internal

namespace krot {

using namespace internal;

std::optional<Conventions> FindConventions(const Model& model,
                                           const Database* database,
                                           const Context& context) {
  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  const bool is_in_one_place = std::all_of(
      geometries.begin(), geometries.end(), [](const ImageGeometry& one) {
        return !one.has_pose || one.cam_from_world.translation.isZero();
      });
  if (is_in_one_place) return std::nullopt;
  auto found =
      FindPoses({model, geometries, kReferencesAlone, database}, context);
  if (!found) return std::nullopt;
  if (std::any_of(geometries.begin(), geometries.end(),
                  [](const ImageGeometry& one) { return one.sensor >= 0; })) {
    TrackSample others(model, geometries, kOthersAtReferences, nullptr);
    found = others.num_tracks() < kFewest
                ? FindSensors({model, geometries, kOthers, database}, *found,
                              context)
                : FindSensors(others, *found, context);
  }
  const bool differs = found->NumDifferences() > 0 || found->has_wrong_points;
  return differs ? found : std::nullopt;
}

}  // namespace krot
