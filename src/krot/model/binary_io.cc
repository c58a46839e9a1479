#include "krot/model/formats.h"

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <type_traits>

#include "krot/camera/camera_model.h"

namespace krot::internal {
namespace {

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__,
              "COLMAP's binary files are read and written as they lie in "
              "memory, which must be little endian");

// These records have the same layout in memory as in the file.
static_assert(sizeof(Point2D) == 24 && std::is_trivially_copyable_v<Point2D>);
static_assert(sizeof(TrackElement) == 8 &&
              std::has_unique_object_representations_v<TrackElement>);
static_assert(sizeof(FrameData) == 16 &&
              std::has_unique_object_representations_v<FrameData>);
static_assert(sizeof(SensorId) == 8 &&
              std::has_unique_object_representations_v<SensorId>);

Pose ReadPose(BinaryReader* reader, const char* what) {
  double values[7];
  reader->ReadArray(values, 7, what);
  Pose pose;
  pose.quaternion_wxyz = {values[0], values[1], values[2], values[3]};
  pose.translation = {values[4], values[5], values[6]};
  return pose;
}

Camera ReadCamera(BinaryReader* reader) {
  Camera camera;
  camera.id = reader->Read<uint32_t>("a camera id");
  const size_t model_offset = reader->offset();
  camera.model_id = reader->Read<int32_t>("a camera model id");
  const CameraModelInfo* info = FindCameraModel(camera.model_id);
  if (info == nullptr) {
    reader->Fail(model_offset,
                 "camera model id " + std::to_string(camera.model_id) +
                     " (camera " + std::to_string(camera.id) + ")",
                 "0 to " + std::to_string(CameraModels().back().id));
  }
  camera.width = reader->Read<uint64_t>("the width of a camera");
  camera.height = reader->Read<uint64_t>("the height of a camera");
  camera.params.resize(static_cast<size_t>(info->num_params));
  reader->ReadArray(camera.params.data(), camera.params.size(),
                    "the parameters of a camera");
  return camera;
}

RigSensor ReadRigSensor(BinaryReader* reader) {
  RigSensor sensor;
  sensor.sensor_id = reader->Read<SensorId>("a sensor of a rig");
  const size_t flag_offset = reader->offset();
  const auto has_pose = reader->Read<uint8_t>("whether a sensor has a pose");
  if (has_pose > 1) {
    reader->Fail(flag_offset,
                 "pose flag " + std::to_string(int{has_pose}) + " of a sensor",
                 "0 or 1");
  }
  if (has_pose == 1) {
    sensor.sensor_from_rig = ReadPose(reader, "the pose of a sensor");
  }
  return sensor;
}

Rig ReadRig(BinaryReader* reader) {
  Rig rig;
  rig.id = reader->Read<uint32_t>("a rig id");
  const size_t num_sensors =
      reader->ReadCount<uint32_t>(sizeof(SensorId), "number of sensors");
  if (num_sensors == 0) return rig;
  rig.ref_sensor_id = reader->Read<SensorId>("the reference sensor of a rig");
  rig.sensors.resize(num_sensors - 1);
  for (RigSensor& sensor : rig.sensors) sensor = ReadRigSensor(reader);
  return rig;
}

void ReadFrame(BinaryReader* reader, Frame* frame) {
  frame->id = reader->Read<uint32_t>("a frame id");
  frame->rig_id = reader->Read<uint32_t>("the rig id of a frame");
  frame->rig_from_world = ReadPose(reader, "the pose of a frame");
  frame->data.resize(
      reader->ReadCount<uint32_t>(sizeof(FrameData), "number of data ids"));
  reader->ReadArray(frame->data.data(), frame->data.size(),
                    "the data ids of a frame");
}

template <typename T>
void Append(const T* values, size_t count, std::string* bytes) {
  static_assert(std::is_trivially_copyable_v<T>);
  bytes->append(reinterpret_cast<const char*>(values), count * sizeof(T));
}

template <typename Stored, typename T>
void AppendAs(const T& value, std::string* bytes) {
  const auto stored = static_cast<Stored>(value);
  Append(&stored, 1, bytes);
}

void AppendPose(const Pose& pose, std::string* bytes) {
  Append(pose.quaternion_wxyz.data(), 4, bytes);
  Append(pose.translation.data(), 3, bytes);
}

}  // namespace

BinaryReader::BinaryReader(const std::filesystem::path& path)
    : path_(path.string()) {
  file_.emplace(path, FileDescriptor::Use::kRead);
  const std::optional<int64_t> size =
      file_->is_open() ? file_->RegularSize() : std::nullopt;
  if (!size) throw ModelError(path_ + ": cannot be read");
  size_ = static_cast<size_t>(*size);
}

void BinaryReader::MoveWindow(size_t num_bytes) {
  begin_ = offset_;
  const size_t size =
      std::min(BytesLeft(), std::max<size_t>(num_bytes, 1 << 20));
  if (!file_->ReadAt(static_cast<int64_t>(begin_), size, &memory_) ||
      memory_.size() != size) {
    throw ModelError(path_ + ": cannot be read");
  }
  window_ = memory_;
}

std::string BinaryReader::ReadString(const char* what) {
  const size_t start = offset_;
  std::string text;
  while (BytesLeft() > 0) {
    const char c = Read<char>(what);
    if (c == '\0') return text;
    text += c;
  }
  Fail(start, "no zero byte before the end of the file",
       std::string("one that ends ") + what);
}

void BinaryReader::ExpectEnd() const {
  if (BytesLeft() == 0) return;
  Fail(offset_,
       std::to_string(BytesLeft()) + " more bytes after the last record",
       "the end of the file");
}

void BinaryReader::Fail(size_t offset, const std::string& found,
                        const std::string& expected) const {
  throw ModelError(path_ + ", byte " + std::to_string(offset) + ": found " +
                   found + ", expected " + expected);
}

void BinaryReader::FailTruncated(size_t num_bytes, const char* what) const {
  Fail(offset_,
       "the end of the file after " + std::to_string(BytesLeft()) +
           " more bytes",
       std::to_string(num_bytes) + " bytes: " + what);
}

void ReadImageHead(BinaryReader* reader, Image* image) {
  image->id = reader->Read<uint32_t>("an image id");
  image->cam_from_world = ReadPose(reader, "the pose of an image");
  image->camera_id = reader->Read<uint32_t>("the camera id of an image");
  image->name = reader->ReadString("the name of an image");
}

void ReadPoints2D(BinaryReader* reader, std::vector<Point2D>* points2D) {
  points2D->resize(
      reader->ReadCount<uint64_t>(sizeof(Point2D), "number of 2D points"));
  reader->ReadArray(points2D->data(), points2D->size(),
                    "the 2D points of an image");
}

void ReadPoint3D(BinaryReader* reader, Point3D* point,
                 std::vector<TrackElement>* track_elements) {
  point->id = reader->Read<uint64_t>("a 3D point id");
  reader->ReadArray(point->xyz.data(), 3, "the coordinates of a 3D point");
  reader->ReadArray(point->color.data(), 3, "the colour of a 3D point");
  point->error = reader->Read<double>("the error of a 3D point");
  const size_t length =
      reader->ReadCount<uint64_t>(sizeof(TrackElement), "track length");
  point->track_begin = track_elements->size();
  point->track_end = point->track_begin + length;
  track_elements->resize(point->track_end);
  reader->ReadArray(track_elements->data() + point->track_begin, length,
                    "the track of a 3D point");
}

void ParseCamerasBinary(const FileBytes& file, Model* model) {
  BinaryReader reader(file);
  model->cameras.resize(
      reader.ReadCount<uint64_t>(4 + 4 + 8 + 8, "number of cameras"));
  for (Camera& camera : model->cameras) camera = ReadCamera(&reader);
  reader.ExpectEnd();
}

void ParseRigsBinary(const FileBytes& file, Model* model) {
  BinaryReader reader(file);
  model->rigs.resize(reader.ReadCount<uint64_t>(4 + 4, "number of rigs"));
  for (Rig& rig : model->rigs) rig = ReadRig(&reader);
  reader.ExpectEnd();
}

void ParseFramesBinary(const FileBytes& file, Model* model) {
  BinaryReader reader(file);
  model->frames.resize(
      reader.ReadCount<uint64_t>(4 + 4 + kPoseBytes + 4, "number of frames"));
  for (Frame& frame : model->frames) ReadFrame(&reader, &frame);
  reader.ExpectEnd();
}

void ParseImagesBinary(const FileBytes& file, Model* model) {
  BinaryReader reader(file);
  model->images.resize(
      reader.ReadCount<uint64_t>(kImageBytes, "number of images"));
  for (Image& image : model->images) {
    ReadImageHead(&reader, &image);
    ReadPoints2D(&reader, &image.points2D);
  }
  reader.ExpectEnd();
}

void ParsePoints3DBinary(const FileBytes& file, Model* model) {
  BinaryReader reader(file);
  model->points3D.resize(
      reader.ReadCount<uint64_t>(kPoint3DBytes, "number of 3D points"));
  // Everything in the file beyond the fixed part of each record is tracks.
  const size_t track_bytes =
      reader.BytesLeft() - model->points3D.size() * kPoint3DBytes;
  model->track_elements.clear();
  model->track_elements.reserve(track_bytes / sizeof(TrackElement));
  for (Point3D& point : model->points3D) {
    ReadPoint3D(&reader, &point, &model->track_elements);
  }
  reader.ExpectEnd();
}

std::string FormatCamerasBinary(const Model& model) {
  std::string bytes;
  AppendAs<uint64_t>(model.cameras.size(), &bytes);
  for (const Camera& camera : model.cameras) {
    AppendAs<uint32_t>(camera.id, &bytes);
    AppendAs<int32_t>(camera.model_id, &bytes);
    AppendAs<uint64_t>(camera.width, &bytes);
    AppendAs<uint64_t>(camera.height, &bytes);
    Append(camera.params.data(), camera.params.size(), &bytes);
  }
  return bytes;
}

std::string FormatRigsBinary(const Model& model) {
  std::string bytes;
  AppendAs<uint64_t>(model.rigs.size(), &bytes);
  for (const Rig& rig : model.rigs) {
    AppendAs<uint32_t>(rig.id, &bytes);
    if (!rig.ref_sensor_id) {
      AppendAs<uint32_t>(0, &bytes);
      continue;
    }
    AppendAs<uint32_t>(1 + rig.sensors.size(), &bytes);
    Append(&*rig.ref_sensor_id, 1, &bytes);
    for (const RigSensor& sensor : rig.sensors) {
      Append(&sensor.sensor_id, 1, &bytes);
      AppendAs<uint8_t>(sensor.sensor_from_rig.has_value(), &bytes);
      if (sensor.sensor_from_rig) AppendPose(*sensor.sensor_from_rig, &bytes);
    }
  }
  return bytes;
}

std::string FormatFramesBinary(const Model& model) {
  std::string bytes;
  AppendAs<uint64_t>(model.frames.size(), &bytes);
  for (const Frame& frame : model.frames) {
    AppendAs<uint32_t>(frame.id, &bytes);
    AppendAs<uint32_t>(frame.rig_id, &bytes);
    AppendPose(frame.rig_from_world, &bytes);
    AppendAs<uint32_t>(frame.data.size(), &bytes);
    Append(frame.data.data(), frame.data.size(), &bytes);
  }
  return bytes;
}

std::string FormatImagesBinary(const Model& model) {
  size_t num_bytes = sizeof(uint64_t);
  for (const Image& image : model.images) {
    num_bytes += kImageBytes + image.name.size() +
                 image.points2D.size() * sizeof(Point2D);
  }
  std::string bytes;
  bytes.reserve(num_bytes);
  AppendAs<uint64_t>(model.images.size(), &bytes);
  for (const Image& image : model.images) {
    AppendAs<uint32_t>(image.id, &bytes);
    AppendPose(image.cam_from_world, &bytes);
    AppendAs<uint32_t>(image.camera_id, &bytes);
    bytes.append(image.name).push_back('\0');
    AppendAs<uint64_t>(image.points2D.size(), &bytes);
    Append(image.points2D.data(), image.points2D.size(), &bytes);
  }
  return bytes;
}

std::string FormatPoints3DBinary(const Model& model) {
  std::string bytes;
  bytes.reserve(sizeof(uint64_t) + model.points3D.size() * kPoint3DBytes +
                model.track_elements.size() * sizeof(TrackElement));
  AppendAs<uint64_t>(model.points3D.size(), &bytes);
  for (const Point3D& point : model.points3D) {
    const uint64_t length = point.track_end - point.track_begin;
    AppendAs<uint64_t>(point.id, &bytes);
    Append(point.xyz.data(), 3, &bytes);
    Append(point.color.data(), 3, &bytes);
    AppendAs<double>(point.error, &bytes);
    AppendAs<uint64_t>(length, &bytes);
    Append(model.track_elements.data() + point.track_begin, length, &bytes);
  }
  return bytes;
}

}  // namespace krot::internal
