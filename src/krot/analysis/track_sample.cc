#include "krot/analysis/track_sample.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "krot/base/numbers.h"
#include "krot/base/parallel_for.h"
#include "krot/camera/camera_model.h"

namespace krot::internal {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr size_t kNumTracks = 200;  // that are asked, evenly spread
constexpr size_t kFewest = 10;      // tracks, or a sensor's observations

}  // namespace

TrackSample::TrackSample(const Model& model,
                         const std::vector<ImageGeometry>& geometries,
                         const Roles& roles, const Database* database)
    : model_(model), geometries_(geometries), roles_(roles) {
  TakeTracks();
  if (tracks_.empty() && database != nullptr) TakeMatches(*database);
}

void TrackSample::TakeTracks() {
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

void TrackSample::TakeMatches(const Database& database) {
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

bool TrackSample::HasEnough() const { return tracks_.size() >= kFewest; }

std::optional<Roles::Role> TrackSample::RoleOf(int32_t image) const {
  const ImageGeometry& geometry = geometries_[image];
  if (!geometry.has_pose) return std::nullopt;
  return geometry.sensor < 0 ? roles_.of_references : roles_.of_others;
}

bool TrackSample::TakeIfTells(std::vector<Sight> track) {
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

void TrackSample::AddSight(int32_t image, const Vector2d& pixel,
                           std::vector<Sight>* track) const {
  const auto role = RoleOf(image);
  if (role) {
    track->push_back({image, pixel, role->is_anchor, role->is_asked});
  }
}

RigidTransform TrackSample::SensorOf(int32_t image,
                                     const Conventions& from) const {
  const ImageGeometry& geometry = geometries_[image];
  const RigSensor& sensor = model_.rigs[geometry.rig].sensors[geometry.sensor];
  return from.SensorToColmap(*sensor.sensor_from_rig).Transform();
}

std::vector<RigidTransform> TrackSample::Poses(const Conventions& from) const {
  std::vector<RigidTransform> poses(geometries_.size());
  for (const int32_t n : images_) {
    const ImageGeometry& geometry = geometries_[n];
    poses[n] =
        from.ToColmap(model_.frames[geometry.frame].rig_from_world).Transform();
    if (geometry.sensor >= 0) poses[n] = SensorOf(n, from) * poses[n];
  }
  return poses;
}

std::vector<Camera> TrackSample::Cameras(const Conventions& from) const {
  std::vector<Camera> cameras;
  for (const Camera& camera : model_.cameras) {
    cameras.push_back(from.ToColmap(camera));
  }
  return cameras;
}

TrackSample::Lenses TrackSample::LensesIn(const Conventions& from) const {
  Lenses lenses = {Cameras(from), {}};
  for (const std::vector<Sight>& track : tracks_) {
    auto& bearings = lenses.bearings.emplace_back();
    for (const Sight& sight : track) {
      const Camera& camera = lenses.cameras[geometries_[sight.image].camera];
      bearings.push_back(
          PixelBearing(camera, from.ToColmap(sight.pixel, camera)));
    }
  }
  return lenses;
}

std::optional<Vector3d> TrackSample::PlaceOf(
    size_t k, const std::vector<RigidTransform>& poses,
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

template <typename PlaceOfTrack>
double TrackSample::MedianError(const Conventions& from,
                                const std::vector<Camera>& cameras,
                                const std::vector<RigidTransform>& poses,
                                const PlaceOfTrack& place_of) const {
  std::map<std::array<int32_t, 2>, std::vector<double>> errors;
  for (size_t k = 0; k < tracks_.size(); ++k) {
    const std::optional<Vector3d> place = place_of(k);
    for (const Sight& sight : tracks_[k]) {
      if (!sight.is_asked) continue;
      const ImageGeometry& geometry = geometries_[sight.image];
      const Camera& camera = cameras[geometry.camera];
      const auto pixel = place
                             ? ProjectPoint(camera, poses[sight.image] * *place)
                             : std::nullopt;
      const double error =
          pixel ? (*pixel - from.ToColmap(sight.pixel, camera)).norm()
                : kInfinity;
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

double TrackSample::MedianErrorWhereSeen(const Conventions& from,
                                         const Lenses& lenses) const {
  const std::vector<RigidTransform> poses = Poses(from);
  return MedianError(from, lenses.cameras, poses,
                     [&](size_t k) { return PlaceOf(k, poses, lenses); });
}

double TrackSample::MedianErrorWithPoints(const Conventions& from) const {
  if (!has_points()) return MedianErrorWhereSeen(from);
  return MedianError(from, Cameras(from), Poses(from), [&](size_t k) {
    return std::optional(from.ToColmap(places_[k]));
  });
}

// The map has the least sum of errors, by least squares that are weighted anew.
double TrackSample::MedianPlace(const Conventions& from) const {
  const std::vector<Camera> cameras = Cameras(from);
  std::array<std::vector<double>, 2> ratios;
  for (const std::vector<Sight>& track : tracks_) {
    for (const Sight& sight : track) {
      const Camera& camera = cameras[geometries_[sight.image].camera];
      const CameraModelInfo& info = *FindCameraModel(camera.model_id);
      if (!info.has_image_plane) continue;
      const int center = info.num_focal_lengths();
      for (const int i : {0, 1}) {
        ratios[i].push_back(sight.pixel[i] / camera.params[center + i]);
      }
    }
  }
  if (ratios[0].empty()) return 1;
  return std::sqrt(LowerMedian(std::move(ratios[0])) *
                   LowerMedian(std::move(ratios[1])));
}

void TrackSample::Measure(std::vector<Conventions>* all,
                          const Context& context) const {
  const Lenses lenses = LensesIn(all->front());
  ParallelForEach(
      static_cast<int64_t>(all->size()), context.num_threads,
      [&](int64_t n) {
        Conventions& one = (*all)[n];
        one.median_error_px = MedianErrorWhereSeen(one, lenses);
      },
      /*chunk_size=*/16);
}

double TrackSample::RigFactor(const Conventions& from,
                              const Lenses& lenses) const {
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

void TrackSample::AddWithRigFactors(std::vector<Conventions>* all) const {
  const Lenses lenses = LensesIn(all->front());
  for (size_t n = all->size(); n-- > 0;) {
    Conventions one = (*all)[n];
    one.rig_factor = RigFactor(one, lenses);
    if (one.rig_factor != 1) all->push_back(one);
  }
}

}  // namespace krot::internal
