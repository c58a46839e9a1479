#include "tests/convert/model_difference.h"

#include <cstring>
#include <vector>

namespace krot::internal {
namespace {

// Writes a model out as words, so that two can be compared bit by bit.
class Transcript {
 public:
  explicit Transcript(bool ignore_geometry)
      : ignore_geometry_(ignore_geometry) {}

  void Add(const std::string& what, uint64_t value) {
    lines_.push_back(what + " = " + std::to_string(value));
  }
  void Add(const std::string& what, double value) {
    uint64_t bits;
    std::memcpy(&bits, &value, sizeof(bits));
    lines_.push_back(what + " = " + std::to_string(value) + " (bits " +
                     std::to_string(bits) + ")");
  }
  void AddGeometry(const std::string& what, const Eigen::Vector3d& x) {
    if (ignore_geometry_) return;
    for (int i = 0; i < 3; ++i) Add(what, x[i]);
  }
  void Add(const std::string& what, const Pose& pose) {
    for (const double q : pose.quaternion_wxyz) Add(what + " quaternion", q);
    AddGeometry(what + " translation", pose.translation);
  }
  void Add(const Model& model);

  const std::vector<std::string>& lines() const { return lines_; }

 private:
  bool ignore_geometry_;
  std::vector<std::string> lines_;
};

void Transcript::Add(const Model& model) {
  Add("stores_rigs", uint64_t{model.stores_rigs});
  for (const Camera& camera : model.cameras) {
    const std::string name = "camera " + std::to_string(camera.id);
    Add(name + " model", static_cast<uint64_t>(camera.model_id));
    Add(name + " width", camera.width);
    Add(name + " height", camera.height);
    for (const double p : camera.params) Add(name + " param", p);
  }
  for (const Rig& rig : model.rigs) {
    const std::string name = "rig " + std::to_string(rig.id);
    Add(name + " reference",
        uint64_t{rig.ref_sensor_id ? rig.ref_sensor_id->id : 0});
    for (const RigSensor& sensor : rig.sensors) {
      const std::string sensor_name =
          name + " sensor " + std::to_string(sensor.sensor_id.id);
      Add(sensor_name, uint64_t{sensor.sensor_from_rig.has_value()});
      if (!sensor.sensor_from_rig) continue;
      Add(sensor_name, *sensor.sensor_from_rig);
      for (int i = 0; i < 3; ++i) {
        Add(sensor_name + " baseline", sensor.sensor_from_rig->translation[i]);
      }
    }
  }
  for (const Frame& frame : model.frames) {
    const std::string name = "frame " + std::to_string(frame.id);
    Add(name + " rig", uint64_t{frame.rig_id});
    Add(name, frame.rig_from_world);
    for (const FrameData& data : frame.data) Add(name + " data", data.data_id);
  }
  for (const Image& image : model.images) {
    const std::string name = "image " + std::to_string(image.id);
    lines_.push_back(name + " is " + image.name);
    Add(name + " camera", uint64_t{image.camera_id});
    Add(name, image.cam_from_world);
    for (const Point2D& point2D : image.points2D) {
      Add(name + " x", point2D.x);
      Add(name + " y", point2D.y);
      Add(name + " point", point2D.point3D_id);
    }
  }
  for (const Point3D& point : model.points3D) {
    const std::string name = "point " + std::to_string(point.id);
    AddGeometry(name, point.xyz);
    for (const uint8_t c : point.color) Add(name + " colour", uint64_t{c});
    Add(name + " error", point.error);
    Add(name + " track begin", point.track_begin);
    Add(name + " track end", point.track_end);
  }
  for (const TrackElement& element : model.track_elements) {
    Add("track image", uint64_t{element.image_id});
    Add("track point2D", uint64_t{element.point2D_idx});
  }
}

}  // namespace

std::string ModelDifference(const Model& a, const Model& b,
                            bool ignore_geometry) {
  Transcript transcript_a(ignore_geometry), transcript_b(ignore_geometry);
  transcript_a.Add(a);
  transcript_b.Add(b);
  const std::vector<std::string>& lines_a = transcript_a.lines();
  const std::vector<std::string>& lines_b = transcript_b.lines();
  for (size_t n = 0; n < lines_a.size() && n < lines_b.size(); ++n) {
    if (lines_a[n] != lines_b[n]) return lines_a[n] + " but " + lines_b[n];
  }
  return lines_a.size() == lines_b.size() ? "" : "one model has more records";
}

}  // namespace krot::internal
