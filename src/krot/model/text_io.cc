#include "krot/model/formats.h"

#include <optional>
#include <string_view>
#include <utility>

#include "krot/base/numbers.h"
#include "krot/camera/camera_model.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

SensorId ReadSensorId(TextReader* reader) {
  const std::string_view name = reader->Word("a sensor type");
  const std::optional<int32_t> type = SensorTypeFromName(name);
  if (!type) {
    reader->Fail("\"" + std::string(name) + "\"",
                 "a sensor type: CAMERA, IMU or INVALID");
  }
  return {*type, reader->Number<uint32_t>("a sensor id")};
}

Pose ReadPose(TextReader* reader) {
  Pose pose;
  for (double& value : pose.quaternion_wxyz) {
    value = reader->Number<double>("a number: QW, QX, QY, QZ of a pose");
  }
  for (int i = 0; i < 3; ++i) {
    pose.translation[i] =
        reader->Number<double>("a number: TX, TY, TZ of a pose");
  }
  return pose;
}

Camera ReadCamera(TextReader* reader) {
  Camera camera;
  camera.id = reader->Number<uint32_t>("a camera id");
  const std::string_view model_name = reader->Word("a camera model's name");
  const CameraModelInfo* info = FindCameraModel(model_name);
  if (info == nullptr) {
    reader->Fail("\"" + std::string(model_name) + "\"",
                 "the name of a camera model, such as PINHOLE");
  }
  camera.model_id = info->id;
  camera.width = reader->Number<uint64_t>("the width of a camera");
  camera.height = reader->Number<uint64_t>("the height of a camera");
  camera.params.resize(static_cast<size_t>(info->num_params));
  const std::string expected = "a number: the parameters " +
                               std::string(info->param_names) + " of " +
                               std::string(info->name);
  for (double& param : camera.params) {
    param = reader->Number<double>(expected.c_str());
  }
  reader->ExpectEndOfLine("the parameters of a camera");
  return camera;
}

Rig ReadRig(TextReader* reader) {
  Rig rig;
  rig.id = reader->Number<uint32_t>("a rig id");
  const auto num_sensors = reader->Number<uint32_t>("the number of sensors");
  if (num_sensors > 0) rig.ref_sensor_id = ReadSensorId(reader);
  for (uint32_t i = 1; i < num_sensors; ++i) {
    RigSensor sensor;
    sensor.sensor_id = ReadSensorId(reader);
    constexpr char kHasPose[] = "0 or 1: whether a sensor has a pose";
    const auto has_pose = reader->Number<uint8_t>(kHasPose);
    if (has_pose > 1) {
      reader->Fail("\"" + std::to_string(has_pose) + "\"", kHasPose);
    }
    if (has_pose == 1) sensor.sensor_from_rig = ReadPose(reader);
    rig.sensors.push_back(sensor);
  }
  reader->ExpectEndOfLine("the sensors of a rig");
  return rig;
}

Frame ReadFrame(TextReader* reader) {
  Frame frame;
  frame.id = reader->Number<uint32_t>("a frame id");
  frame.rig_id = reader->Number<uint32_t>("a rig id");
  frame.rig_from_world = ReadPose(reader);
  const auto num_data = reader->Number<uint32_t>("the number of data ids");
  for (uint32_t i = 0; i < num_data; ++i) {
    FrameData data;
    data.sensor_id = ReadSensorId(reader);
    data.data_id = reader->Number<uint64_t>("a data id");
    frame.data.push_back(data);
  }
  reader->ExpectEndOfLine("the data ids of a frame");
  return frame;
}

Point2D ReadPoint2D(TextReader* reader) {
  Point2D point;
  point.x = reader->Number<double>("a number: X of a 2D point");
  point.y = reader->Number<double>("a number: Y of a 2D point");
  const std::string_view id = reader->Word("the POINT3D_ID of a 2D point");
  if (TextReader::ParseNumber<int8_t>(id) == -1) return point;
  const auto value = TextReader::ParseNumber<uint64_t>(id);
  if (!value) {
    reader->Fail("\"" + std::string(id) + "\"",
                 "the POINT3D_ID of a 2D point, or -1");
  }
  point.point3D_id = *value;
  return point;
}

// Whether the line is the first line of an image: IMAGE_ID POSE CAMERA_ID NAME.
bool IsImage(TextReader reader) {
  try {
    reader.Number<uint32_t>("");
    ReadPose(&reader);
    reader.Number<uint32_t>("");
    return !reader.AtEnd() && !TextReader::ParseNumber<double>(reader.Word(""));
  } catch (const ModelError&) {
    return false;
  }
}

void ReadPoints2D(const Image& image, TextReader* reader,
                  std::vector<Point2D>* points2D) {
  const TextReader line = *reader;
  try {
    while (!reader->AtEnd()) points2D->push_back(ReadPoint2D(reader));
  } catch (const ModelError&) {
    if (!IsImage(line)) throw;
    line.Fail("the line of another image",
              "the 2D points of image " + std::to_string(image.id) + " (\"" +
                  image.name +
                  "\"): an image has two lines, of which the second may be "
                  "empty; put an empty line behind each");
  }
}

// Reads the image's own line and then the line of its 2D points. As in COLMAP,
// the second line may be empty, a comment (which counts as empty) or, at the
// end of the file, absent. `points2D` is scratch memory.
Image ReadImage(TextReader* reader, std::vector<Point2D>* points2D) {
  Image image;
  image.id = reader->Number<uint32_t>("an image id");
  image.cam_from_world = ReadPose(reader);
  image.camera_id = reader->Number<uint32_t>("a camera id");
  image.name = reader->Rest();
  points2D->clear();
  if (reader->NextLine() && !reader->IsComment()) {
    ReadPoints2D(image, reader, points2D);
  }
  image.points2D = *points2D;
  return image;
}

Point3D ReadPoint3D(TextReader* reader,
                    std::vector<TrackElement>* track_elements) {
  Point3D point;
  point.id = reader->Number<uint64_t>("a 3D point id");
  for (int i = 0; i < 3; ++i) {
    point.xyz[i] = reader->Number<double>("a number: X, Y, Z of a 3D point");
  }
  for (uint8_t& channel : point.color) {
    channel = reader->Number<uint8_t>("R, G, B of a 3D point");
  }
  point.error = reader->Number<double>("a number: ERROR of a 3D point");
  point.track_begin = track_elements->size();
  while (!reader->AtEnd()) {
    TrackElement element;
    element.image_id = reader->Number<uint32_t>("the IMAGE_ID of a track");
    element.point2D_idx =
        reader->Number<uint32_t>("the POINT2D_IDX of a track");
    track_elements->push_back(element);
  }
  point.track_end = track_elements->size();
  return point;
}

template <typename Read, typename Record>
void ReadRecords(const FileBytes& file, const Read& read,
                 std::vector<Record>* records) {
  records->clear();
  TextReader reader(file);
  while (reader.NextRecord()) records->push_back(read(&reader));
}

}  // namespace

void ParseCamerasText(const FileBytes& file, Model* model) {
  ReadRecords<Camera(TextReader*)>(file, ReadCamera, &model->cameras);
}

void ParseRigsText(const FileBytes& file, Model* model) {
  ReadRecords<Rig(TextReader*)>(file, ReadRig, &model->rigs);
}

void ParseFramesText(const FileBytes& file, Model* model) {
  ReadRecords<Frame(TextReader*)>(file, ReadFrame, &model->frames);
}

void ParseImagesText(const FileBytes& file, Model* model) {
  std::vector<Point2D> points2D;
  const auto read = [&](TextReader* reader) {
    return ReadImage(reader, &points2D);
  };
  ReadRecords(file, read, &model->images);
}

void ParsePoints3DText(const FileBytes& file, Model* model) {
  model->track_elements.clear();
  const auto read = [&](TextReader* reader) {
    return ReadPoint3D(reader, &model->track_elements);
  };
  ReadRecords(file, read, &model->points3D);
}

namespace {

// Each of the following writes a blank and then its words.

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

// Fails for names that a line cannot hold, or that would lose blanks at their
// ends.
void CheckNameFitsText(const Image& image) {
  const std::string& name = image.name;
  const bool fits = name.find_first_of("\r\n") == std::string::npos &&
                    (name.empty() || (!TextReader::IsBlank(name.front()) &&
                                      !TextReader::IsBlank(name.back())));
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
    for (const TrackElement& element : TrackOf(model, point)) {
      AppendWord(element.image_id, &text);
      AppendWord(element.point2D_idx, &text);
    }
    text.push_back('\n');
  }
  return text;
}

}  // namespace krot::internal
