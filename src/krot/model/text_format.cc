#include <optional>
#include <string_view>
#include <utility>

#include "krot/base/numbers.h"
#include "krot/base/write_file.h"
#include "krot/camera/camera_model.h"
#include "krot/model/sensor_type.h"
#include "krot/model/text_io.h"

namespace krot::internal {
namespace {

// Each of the following begins with the blank that separates it.

template <typename T>
void AppendWord(T value, std::string* text) {
  text->push_back(' ');
  AppendNumber(value, text);
}

void AppendPoseWords(const Pose& pose, std::string* text) {
  for (const double value : pose.quaternion_wxyz) AppendWord(value, text);
  for (const double value : pose.translation) AppendWord(value, text);
}

void AppendSensorId(const SensorId& sensor_id, std::string* text) {
  const std::optional<std::string_view> name = SensorTypeName(sensor_id.type);
  if (!name) {
    throw WriteError("found sensor type " + std::to_string(sensor_id.type) +
                     " (sensor " + std::to_string(sensor_id.id) +
                     "), expected -1, 0 or 1: text has names for these only");
  }
  text->append(" ").append(*name);
  AppendWord(sensor_id.id, text);
}

// Names that a line cannot hold or that would come back shorter.
void CheckNameFitsText(const Image& image) {
  constexpr std::string_view kBlanks = " \t\r";
  const std::string& name = image.name;
  const bool fits =
      name.find_first_of("\r\n") == std::string::npos &&
      (name.empty() || (kBlanks.find(name.front()) == std::string_view::npos &&
                        kBlanks.find(name.back()) == std::string_view::npos));
  if (fits) return;
  throw WriteError("image " + std::to_string(image.id) + ": found the name \"" +
                   name +
                   "\", expected no line break and no blank at either end: "
                   "text files cannot hold them");
}

}  // namespace

std::string FormatCamerasText(const Model& model) {
  std::string text =
      "# Cameras, one per line:\n"
      "#   CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n"
      "# Cameras in this file: " +
      std::to_string(model.cameras.size()) + "\n";
  for (const Camera& camera : model.cameras) {
    const CameraModelInfo* info = FindCameraModel(camera.model_id);
    if (info == nullptr) {
      throw WriteError("camera " + std::to_string(camera.id) +
                       ": found camera model id " +
                       std::to_string(camera.model_id) + ", expected 0 to " +
                       std::to_string(CameraModels().back().id));
    }
    AppendNumber(camera.id, &text);
    text.append(" ").append(info->name);
    AppendWord(camera.width, &text);
    AppendWord(camera.height, &text);
    for (const double param : camera.params) AppendWord(param, &text);
    text.push_back('\n');
  }
  return text;
}

std::string FormatRigsText(const Model& model) {
  std::string text =
      "# Rigs, one per line, the reference sensor first:\n"
      "#   RIG_ID NUM_SENSORS REF_TYPE REF_ID "
      "SENSORS[](TYPE ID HAS_POSE [QW QX QY QZ TX TY TZ])\n"
      "# Rigs in this file: " +
      std::to_string(model.rigs.size()) + "\n";
  for (const Rig& rig : model.rigs) {
    AppendNumber(rig.id, &text);
    if (rig.ref_sensor_id) {
      AppendWord(1 + rig.sensors.size(), &text);
      AppendSensorId(*rig.ref_sensor_id, &text);
      for (const RigSensor& sensor : rig.sensors) {
        AppendSensorId(sensor.sensor_id, &text);
        AppendWord(sensor.sensor_from_rig.has_value() ? 1 : 0, &text);
        if (sensor.sensor_from_rig)
          AppendPoseWords(*sensor.sensor_from_rig, &text);
      }
    } else {
      AppendWord(0, &text);
    }
    text.push_back('\n');
  }
  return text;
}

std::string FormatFramesText(const Model& model) {
  std::string text =
      "# Frames, one per line:\n"
      "#   FRAME_ID RIG_ID RIG_FROM_WORLD(QW QX QY QZ TX TY TZ) "
      "NUM_DATA DATA[](SENSOR_TYPE SENSOR_ID DATA_ID)\n"
      "# Frames in this file: " +
      std::to_string(model.frames.size()) + "\n";
  for (const Frame& frame : model.frames) {
    AppendNumber(frame.id, &text);
    AppendWord(frame.rig_id, &text);
    AppendPoseWords(frame.rig_from_world, &text);
    AppendWord(frame.data.size(), &text);
    for (const FrameData& data : frame.data) {
      AppendSensorId(data.sensor_id, &text);
      AppendWord(data.data_id, &text);
    }
    text.push_back('\n');
  }
  return text;
}

std::string FormatImagesText(const Model& model) {
  std::string text =
      "# Images, two lines each:\n"
      "#   IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME\n"
      "#   POINTS2D[](X Y POINT3D_ID), POINT3D_ID = -1 for none\n"
      "# Images in this file: " +
      std::to_string(model.images.size()) + "\n";
  for (const Image& image : model.images) {
    CheckNameFitsText(image);
    AppendNumber(image.id, &text);
    AppendPoseWords(image.cam_from_world, &text);
    AppendWord(image.camera_id, &text);
    text.append(" ").append(image.name).push_back('\n');
    const char* separator = "";
    for (const Point2D& point : image.points2D) {
      text.append(std::exchange(separator, " "));
      AppendNumber(point.x, &text);
      AppendWord(point.y, &text);
      if (point.point3D_id == kInvalidPoint3DId) {
        text.append(" -1");
      } else {
        AppendWord(point.point3D_id, &text);
      }
    }
    text.push_back('\n');
  }
  return text;
}

std::string FormatPoints3DText(const Model& model) {
  std::string text =
      "# 3D points, one per line:\n"
      "#   POINT3D_ID X Y Z R G B ERROR TRACK[](IMAGE_ID POINT2D_IDX)\n"
      "# 3D points in this file: " +
      std::to_string(model.points3D.size()) + "\n";
  for (const Point3D& point : model.points3D) {
    AppendNumber(point.id, &text);
    for (const double value : point.xyz) AppendWord(value, &text);
    for (const uint8_t channel : point.color) AppendWord(channel, &text);
    AppendWord(point.error, &text);
    for (uint64_t i = point.track_begin; i < point.track_end; ++i) {
      AppendWord(model.track_elements[i].image_id, &text);
      AppendWord(model.track_elements[i].point2D_idx, &text);
    }
    text.push_back('\n');
  }
  return text;
}

}  // namespace krot::internal
