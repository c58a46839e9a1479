// Copyright (c) KROT contributors.
// SPDX-License-Identifier: BSD-3-Clause

#include "colmap/estimators/krot_model.h"

#include <set>
#include <utility>
#include <vector>

#include <krot/model.h>

namespace colmap {
namespace {

krot::Pose ToPose(const Rigid3d& transform) {
  const auto q = transform.rotation();
  return {{q.w(), q.x(), q.y(), q.z()}, transform.translation()};
}

krot::SensorId ToSensorId(const sensor_t& sensor) {
  return {static_cast<int32_t>(sensor.type), sensor.id};
}

// The ids of a map's records, ascending.
template <typename Map>
auto SortedIds(const Map& records) {
  std::set<typename Map::key_type> ids;
  for (const auto& [id, _] : records) ids.insert(id);
  return ids;
}

void AppendRigs(const Reconstruction& reconstruction, krot::Model& model) {
  for (const rig_t rig_id : SortedIds(reconstruction.Rigs())) {
    const Rig& rig = reconstruction.Rig(rig_id);
    krot::Rig added;
    added.id = rig_id;
    if (rig.NumSensors() > 0)
      added.ref_sensor_id = ToSensorId(rig.RefSensorId());
    for (const auto& [sensor, sensor_from_rig] : rig.NonRefSensors()) {
      added.sensors.push_back({ToSensorId(sensor), std::nullopt});
      if (sensor_from_rig) {
        added.sensors.back().sensor_from_rig = ToPose(*sensor_from_rig);
      }
    }
    model.rigs.push_back(std::move(added));
  }
}

// Frames without a pose stay outside, and their images with them.
void AppendFramesAndImages(const Reconstruction& reconstruction,
                           krot::Model& model) {
  std::set<image_t> image_ids;
  const std::vector<frame_t>& reg_frame_ids = reconstruction.RegFrameIds();
  for (const frame_t frame_id :
       std::set<frame_t>(reg_frame_ids.begin(), reg_frame_ids.end())) {
    const Frame& frame = reconstruction.Frame(frame_id);
    krot::Frame added{
        frame_id, frame.RigId(), ToPose(frame.RigFromWorld()), {}};
    for (const data_t& data : frame.DataIds()) {
      added.data.push_back({ToSensorId(data.sensor_id), data.id});
      if (data.sensor_id.type == SensorType::CAMERA) {
        image_ids.insert(static_cast<image_t>(data.id));
      }
    }
    model.frames.push_back(std::move(added));
  }
  for (const image_t image_id : image_ids) {
    const Image& image = reconstruction.Image(image_id);
    krot::Image added;
    added.id = image_id;
    added.cam_from_world = ToPose(image.CamFromWorld());
    added.camera_id = image.CameraId();
    added.name = image.Name();
    for (const Point2D& point2D : image.Points2D()) {
      added.points2D.push_back({point2D.xy(0), point2D.xy(1),
                                point2D.HasPoint3D()
                                    ? point2D.point3D_id
                                    : krot::kInvalidPoint3DId});
    }
    model.images.push_back(std::move(added));
  }
}

void AppendPoints3D(const Reconstruction& reconstruction,
                    const int min_track_length, krot::Model& model) {
  for (const point3D_t point3D_id : SortedIds(reconstruction.Points3D())) {
    const Point3D& point3D = reconstruction.Point3D(point3D_id);
    if (static_cast<int>(point3D.track.Length()) < min_track_length) continue;
    krot::Point3D added;
    added.id = point3D_id;
    added.xyz = point3D.xyz;
    added.color = {point3D.color(0), point3D.color(1), point3D.color(2)};
    added.error = point3D.error;
    added.track_begin = model.track_elements.size();
    for (const TrackElement& element : point3D.track.Elements()) {
      if (!reconstruction.Image(element.image_id).HasPose()) continue;
      model.track_elements.push_back({element.image_id, element.point2D_idx});
    }
    added.track_end = model.track_elements.size();
    model.points3D.push_back(added);
  }
}

// Deletes what the model no longer has of a point that it has.
void DeleteMissingObservations(const krot::Model& model,
                               const krot::Point3D& point,
                               Reconstruction& reconstruction) {
  std::set<std::pair<image_t, point2D_t>> kept;
  for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
    const krot::TrackElement& element = model.track_elements[e];
    kept.emplace(element.image_id, element.point2D_idx);
  }
  const std::vector<TrackElement> elements =
      reconstruction.Point3D(point.id).track.Elements();
  for (const TrackElement& element : elements) {
    if (kept.count({element.image_id, element.point2D_idx}) > 0 ||
        !reconstruction.Image(element.image_id).HasPose()) {
      continue;
    }
    reconstruction.DeleteObservation(element.image_id, element.point2D_idx);
  }
}

}  // namespace

krot::Model ToKrotModel(const Reconstruction& reconstruction,
                        const int min_track_length) {
  krot::Model model;
  model.stores_rigs = true;
  for (const camera_t camera_id : SortedIds(reconstruction.Cameras())) {
    const Camera& camera = reconstruction.Camera(camera_id);
    model.cameras.push_back({camera_id, static_cast<int>(camera.model_id),
                             camera.width, camera.height, camera.params});
  }
  AppendRigs(reconstruction, model);
  AppendFramesAndImages(reconstruction, model);
  AppendPoints3D(reconstruction, min_track_length, model);
  krot::ValidateModel(model);
  return model;
}

void UpdateFromKrotModel(const krot::Model& model,
                         Reconstruction& reconstruction) {
  for (const krot::Frame& frame : model.frames) {
    reconstruction.Frame(frame.id).RigFromWorld().translation() =
        frame.rig_from_world.translation;
  }
  std::set<point3D_t> kept;
  for (const krot::Point3D& point : model.points3D) kept.insert(point.id);
  for (const point3D_t point3D_id : reconstruction.Point3DIds()) {
    if (kept.count(point3D_id) == 0) reconstruction.DeletePoint3D(point3D_id);
  }
  for (const krot::Point3D& point : model.points3D) {
    DeleteMissingObservations(model, point, reconstruction);
    Point3D& point3D = reconstruction.Point3D(point.id);
    point3D.xyz = point.xyz;
    point3D.error = point.error;
  }
}

}  // namespace colmap
