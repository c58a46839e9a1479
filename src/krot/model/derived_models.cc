#include "krot/model/derived_models.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <unordered_set>
#include <utility>
#include <vector>

#include "krot/base/check.h"
#include "krot/base/numbers.h"
#include "krot/camera/camera_model.h"
#include "krot/geometry/transform.h"
#include "krot/model/rigs.h"

namespace krot::internal {

std::vector<std::vector<int32_t>> CutPoints(
    const std::vector<TrackLength>& tracks, int count) {
  std::vector<std::vector<int32_t>> cut(count);
  int64_t total = 0;
  for (const TrackLength& track : tracks) {
    total += static_cast<int64_t>(track.length);
  }
  // The number of observations in all shares up to and including this one.
  const auto end_of = [&](int share) { return total * (share + 1) / count; };
  int64_t sum = 0;
  int share = 0;
  for (const int32_t k : OrderOfIds(tracks)) {
    while (share + 1 < count && sum >= end_of(share)) ++share;
    cut[share].push_back(k);
    sum += static_cast<int64_t>(tracks[k].length);
  }
  for (std::vector<int32_t>& points : cut) {
    std::sort(points.begin(), points.end());
  }
  return cut;
}

std::vector<std::vector<int32_t>> CutPoints(const Model& whole, int count) {
  std::vector<TrackLength> tracks;
  tracks.reserve(whole.points3D.size());
  for (const Point3D& point : whole.points3D) {
    tracks.push_back({point.id, point.track_end - point.track_begin});
  }
  return CutPoints(tracks, count);
}

Model WithoutPoints(const Model& model) {
  Model result;
  result.stores_rigs = model.stores_rigs;
  result.cameras = model.cameras;
  result.rigs = model.rigs;
  result.frames = model.frames;
  for (const Image& image : model.images) {
    result.images.push_back(
        {image.id, image.cam_from_world, image.camera_id, image.name, {}});
  }
  return result;
}

ModelShare TakeShare(const Model& whole, const std::vector<int32_t>& points) {
  ModelShare share;
  Model& model = share.model;
  model = WithoutPoints(whole);
  const auto image_indices = ImageIndices(whole);
  share.point2D_of.resize(whole.images.size());
  model.points3D.reserve(points.size());
  for (const int32_t k : points) {
    Point3D point = whole.points3D[k];
    const uint64_t begin = model.track_elements.size();
    for (const TrackElement& element : TrackOf(whole, point)) {
      const int32_t n = image_indices.at(element.image_id);
      std::vector<uint32_t>& names = share.point2D_of[n];
      model.track_elements.push_back(
          {element.image_id, static_cast<uint32_t>(names.size())});
      names.push_back(element.point2D_idx);
      model.images[n].points2D.push_back(
          whole.images[n].points2D[element.point2D_idx]);
    }
    point.track_begin = begin;
    point.track_end = model.track_elements.size();
    model.points3D.push_back(point);
  }
  return share;
}

RemovedObservations RemoveObservations(const Model& model,
                                       const std::vector<char>& is_removed,
                                       bool drops_short) {
  CheckArgument(is_removed.size() == model.track_elements.size(),
                "is_removed.size()", is_removed.size(),
                "the number of track elements");
  RemovedObservations result;
  result.model = model;
  result.model.points3D.clear();
  result.model.track_elements.clear();
  const auto image_of = ImageIndices(model);
  const auto point2D_of = [&](const TrackElement& element) -> Point2D& {
    return result.model.images[image_of.at(element.image_id)]
        .points2D[element.point2D_idx];
  };
  for (const Point3D& point : model.points3D) {
    int64_t num_kept = 0;
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      num_kept += !is_removed[e];
    }
    const auto length =
        static_cast<int64_t>(point.track_end - point.track_begin);
    const bool goes = num_kept < 2 && (num_kept < length || drops_short);
    if (goes) {
      ++result.num_points;
      result.num_left_alone += num_kept;
    }
    // A track may hold a 2D point twice, and one of the two may stay.
    std::vector<Point2D*> named;
    std::vector<Point2D*> stay;
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      Point2D& point2D = point2D_of(model.track_elements[e]);
      if (point2D.point3D_id != point.id) continue;
      named.push_back(&point2D);
      if (!goes && !is_removed[e]) stay.push_back(&point2D);
    }
    for (Point2D* point2D : named) point2D->point3D_id = kInvalidPoint3DId;
    for (Point2D* point2D : stay) point2D->point3D_id = point.id;
    if (goes) continue;
    Point3D kept = point;
    kept.track_begin = result.model.track_elements.size();
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      if (!is_removed[e]) {
        result.model.track_elements.push_back(model.track_elements[e]);
        result.element_of.push_back(e);
      }
    }
    kept.track_end = result.model.track_elements.size();
    result.model.points3D.push_back(kept);
  }
  return result;
}

bool HasPanorama(const Model& model) {
  return std::any_of(
      model.cameras.begin(), model.cameras.end(), [](const Camera& camera) {
        return !FindCameraModel(camera.model_id)->has_image_plane;
      });
}

Model RemoveImages(const Model& model, const std::vector<char>& is_removed) {
  CheckArgument(is_removed.size() == model.images.size(), "is_removed.size()",
                is_removed.size(), "the number of images");
  Model result = model;
  result.images.clear();
  std::unordered_set<uint64_t> gone;
  for (size_t n = 0; n < model.images.size(); ++n) {
    if (is_removed[n]) {
      gone.insert(model.images[n].id);
    } else {
      result.images.push_back(model.images[n]);
    }
  }
  result.frames.clear();
  for (Frame frame : model.frames) {
    const size_t num_data = frame.data.size();
    frame.data.erase(std::remove_if(frame.data.begin(), frame.data.end(),
                                    [&](const FrameData& data) {
                                      return data.sensor_id.type ==
                                                 kSensorTypeCamera &&
                                             gone.count(data.data_id) > 0;
                                    }),
                     frame.data.end());
    const bool has_image = std::any_of(
        frame.data.begin(), frame.data.end(), [](const FrameData& data) {
          return data.sensor_id.type == kSensorTypeCamera;
        });
    if (has_image || frame.data.size() == num_data) {
      result.frames.push_back(std::move(frame));
    }
  }
  return result;
}

namespace {

using Eigen::Vector3d;
using Real = long double;

// The median of each coordinate; none without positions.
std::optional<Vector3d> MedianPosition(const std::vector<Vector3d>& positions) {
  if (positions.empty()) return std::nullopt;
  Vector3d median;
  std::vector<double> values(positions.size());
  for (int axis = 0; axis < 3; ++axis) {
    for (size_t n = 0; n < values.size(); ++n) values[n] = positions[n][axis];
    median[axis] = Median(values);
  }
  return median;
}

// Centres of the frames' rigs, for all frames or those that are wanted.
std::vector<Vector3d> Centres(const Model& model,
                              const std::vector<char>& is_wanted) {
  std::vector<Vector3d> centres;
  for (size_t f = 0; f < model.frames.size(); ++f) {
    const RigidTransform rig_from_world =
        model.frames[f].rig_from_world.Transform();
    if (!rig_from_world.translation.allFinite() ||
        !rig_from_world.rotation.allFinite()) {
      continue;
    }
    if (!is_wanted.empty() && !is_wanted[f]) continue;
    centres.push_back(Center(rig_from_world));
  }
  return centres;
}

std::vector<Vector3d> Points(const Model& model,
                             const std::vector<char>& is_wanted) {
  std::vector<Vector3d> points;
  for (size_t k = 0; k < model.points3D.size(); ++k) {
    if (is_wanted.empty() || is_wanted[k]) {
      points.push_back(model.points3D[k].xyz);
    }
  }
  return points;
}

std::vector<Vector3d> Positions(const Model& model, const FixedParts& fixed,
                                const std::vector<KnownPosition>& known) {
  std::vector<Vector3d> positions;
  if (!fixed.frames.empty()) positions = Centres(model, fixed.frames);
  if (!fixed.points3D.empty()) {
    const std::vector<Vector3d> points = Points(model, fixed.points3D);
    positions.insert(positions.end(), points.begin(), points.end());
  }
  for (const KnownPosition& position : known) {
    positions.push_back(position.region.centre);
  }
  if (positions.empty()) positions = Centres(model, {});
  if (positions.empty()) positions = Points(model, {});
  return positions;
}

// t + R `shift`, rounded once; a pose without a rotation does not change.
void Shift(const Vector3d& shift, Pose* pose) {
  if (!HasRotation(pose->quaternion_wxyz)) return;
  pose->translation = (pose->translation.cast<Real>() +
                       pose->Rotation().cast<Real>() * shift.cast<Real>())
                          .cast<double>();
}

bool IsSame(const Pose& a, const Pose& b) {
  return a.quaternion_wxyz == b.quaternion_wxyz &&
         (a.translation == b.translation || !b.translation.allFinite());
}

// Undoes Shift(origin): `pose` began as `was` after that shift, and becomes
// `was` again to the bit if it has not changed.
void ShiftBack(const Vector3d& origin, const Pose& was, Pose* pose) {
  Pose local = was;
  Shift(origin, &local);
  if (IsSame(local, *pose)) {
    *pose = was;
  } else {
    Shift(-origin, pose);
  }
}

}  // namespace

LocalFrame::LocalFrame(const Model& model, const FixedParts& fixed,
                       const std::vector<KnownPosition>& known) {
  const std::vector<Vector3d> positions = Positions(model, fixed, known);
  const std::optional<Vector3d> middle = MedianPosition(positions);
  if (!middle) return;
  double extent = MedianDistance(positions, *middle);
  if (extent == 0) extent = MedianDistance(Points(model, {}), *middle);
  // Far out, coordinates lose digits, and adjustments need more steps: four
  // times as many at a hundred extents, where turning a camera moves it about
  // the origin.
  if (!(extent > 0) || !(middle->norm() > 10 * extent)) return;
  // Rounds to a power of two beyond the extent, so that differences are exact.
  const double unit = std::exp2(std::ceil(std::log2(extent)));
  origin_ = (*middle / unit).array().round() * unit;
}

Model LocalFrame::ToLocal(const Model& model) const {
  Model local = model;
  if (IsModels()) return local;
  for (Frame& frame : local.frames) Shift(origin_, &frame.rig_from_world);
  for (Image& image : local.images) Shift(origin_, &image.cam_from_world);
  for (Point3D& point : local.points3D) point.xyz -= origin_;
  return local;
}

std::vector<KnownPosition> LocalFrame::ToLocal(
    std::vector<KnownPosition> known) const {
  for (KnownPosition& position : known) position.region.centre -= origin_;
  return known;
}

Model LocalFrame::FromLocal(const Model& before, const Model& local) const {
  Model model = local;
  if (IsModels()) return model;
  for (size_t f = 0; f < model.frames.size(); ++f) {
    ShiftBack(origin_, before.frames[f].rig_from_world,
              &model.frames[f].rig_from_world);
  }
  for (size_t n = 0; n < model.images.size(); ++n) {
    ShiftBack(origin_, before.images[n].cam_from_world,
              &model.images[n].cam_from_world);
  }
  const IdIndex<Point3DId> index(before.points3D);
  for (Point3D& point : model.points3D) {
    const std::optional<int32_t> k = index.Find(point.id);
    const bool stays = k && before.points3D[*k].xyz - origin_ == point.xyz;
    point.xyz = stays ? before.points3D[*k].xyz : point.xyz + origin_;
  }
  return model;
}

}  // namespace krot::internal
