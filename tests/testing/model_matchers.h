#pragma once

#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <optional>
#include <sstream>
#include <string>

#include <gmock/gmock.h>

#include "krot/base/write_file.h"
#include "krot/context.h"
#include "krot/model.h"
#include "tests/testing/temp_folder.h"

namespace krot::internal {

// What two models may differ in.
struct Ignoring {
  bool translations = false;  // of frames and images
  bool coordinates = false;   // of 3D points
  bool point_errors = false;
};

// Finds the first difference of two models, bit by bit: NaNs of the same bits
// are equal, 0 and -0 are not.
class ModelComparison {
 public:
  explicit ModelComparison(const Ignoring& ignoring) : ignoring_(ignoring) {}

  // "images[3].points2D[17].x: 1.5 and 2", or "" if there is none.
  std::string FirstDifference(const Model& a, const Model& b) {
    Value("stores_rigs", a.stores_rigs, b.stores_rigs);
    List("cameras", a.cameras, b.cameras);
    List("rigs", a.rigs, b.rigs);
    List("frames", a.frames, b.frames);
    List("images", a.images, b.images);
    List("points3D", a.points3D, b.points3D);
    List("track_elements", a.track_elements, b.track_elements);
    return difference_;
  }
  // The same of their rigs alone.
  std::string FirstDifferenceOfRigs(const Model& a, const Model& b) {
    List("rigs", a.rigs, b.rigs);
    return difference_;
  }

 private:
  template <typename T>
  void Value(const std::string& path, const T& a, const T& b) {
    if (a != b) Report(path, a, b);
  }
  void Value(const std::string& path, double a, double b) {
    if (std::memcmp(&a, &b, sizeof(double)) != 0) Report(path, a, b);
  }
  void Value(const std::string& path, uint8_t a, uint8_t b) {
    if (a != b) Report(path, int{a}, int{b});
  }

  template <typename T>
  void List(const std::string& path, const T& a, const T& b) {
    Value(path + ".size()", a.size(), b.size());
    if (a.size() != b.size()) return;
    for (size_t i = 0; i < a.size() && difference_.empty(); ++i) {
      Record(path + "[" + std::to_string(i) + "]", a[i], b[i]);
    }
  }

  void Record(const std::string& path, double a, double b) {
    Value(path, a, b);
  }
  void Record(const std::string& path, uint8_t a, uint8_t b) {
    Value(path, a, b);
  }
  void Record(const std::string& path, const Pose& a, const Pose& b) {
    List(path + ".quaternion_wxyz", a.quaternion_wxyz, b.quaternion_wxyz);
    for (int i = 0; i < 3 && !ignoring_.translations; ++i) {
      Value(path + ".translation[" + std::to_string(i) + "]", a.translation[i],
            b.translation[i]);
    }
  }
  void Record(const std::string& path, const Camera& a, const Camera& b) {
    Value(path + ".id", a.id, b.id);
    Value(path + ".model_id", a.model_id, b.model_id);
    Value(path + ".width", a.width, b.width);
    Value(path + ".height", a.height, b.height);
    List(path + ".params", a.params, b.params);
  }
  void Record(const std::string& path, const SensorId& a, const SensorId& b) {
    Value(path + ".type", a.type, b.type);
    Value(path + ".id", a.id, b.id);
  }
  void Record(const std::string& path, const RigSensor& a, const RigSensor& b) {
    Record(path + ".sensor_id", a.sensor_id, b.sensor_id);
    Value(path + ".sensor_from_rig.has_value()", a.sensor_from_rig.has_value(),
          b.sensor_from_rig.has_value());
    if (!a.sensor_from_rig || !b.sensor_from_rig) return;
    // A rig's calibration is never free to differ.
    ModelComparison strict{Ignoring()};
    strict.Record(path + ".sensor_from_rig", *a.sensor_from_rig,
                  *b.sensor_from_rig);
    if (difference_.empty()) difference_ = strict.difference_;
  }
  void Record(const std::string& path, const Rig& a, const Rig& b) {
    Value(path + ".id", a.id, b.id);
    Value(path + ".ref_sensor_id.has_value()", a.ref_sensor_id.has_value(),
          b.ref_sensor_id.has_value());
    if (a.ref_sensor_id && b.ref_sensor_id) {
      Record(path + ".ref_sensor_id", *a.ref_sensor_id, *b.ref_sensor_id);
    }
    List(path + ".sensors", a.sensors, b.sensors);
  }
  void Record(const std::string& path, const FrameData& a, const FrameData& b) {
    Record(path + ".sensor_id", a.sensor_id, b.sensor_id);
    Value(path + ".data_id", a.data_id, b.data_id);
  }
  void Record(const std::string& path, const Frame& a, const Frame& b) {
    Value(path + ".id", a.id, b.id);
    Value(path + ".rig_id", a.rig_id, b.rig_id);
    Record(path + ".rig_from_world", a.rig_from_world, b.rig_from_world);
    List(path + ".data", a.data, b.data);
  }
  void Record(const std::string& path, const Point2D& a, const Point2D& b) {
    Value(path + ".x", a.x, b.x);
    Value(path + ".y", a.y, b.y);
    Value(path + ".point3D_id", a.point3D_id, b.point3D_id);
  }
  void Record(const std::string& path, const Image& a, const Image& b) {
    Value(path + ".id", a.id, b.id);
    Record(path + ".cam_from_world", a.cam_from_world, b.cam_from_world);
    Value(path + ".camera_id", a.camera_id, b.camera_id);
    Value(path + ".name", a.name, b.name);
    List(path + ".points2D", a.points2D, b.points2D);
  }
  void Record(const std::string& path, const TrackElement& a,
              const TrackElement& b) {
    Value(path + ".image_id", a.image_id, b.image_id);
    Value(path + ".point2D_idx", a.point2D_idx, b.point2D_idx);
  }
  void Record(const std::string& path, const Point3D& a, const Point3D& b) {
    Value(path + ".id", a.id, b.id);
    for (int i = 0; i < 3 && !ignoring_.coordinates; ++i) {
      Value(path + ".xyz[" + std::to_string(i) + "]", a.xyz[i], b.xyz[i]);
    }
    List(path + ".color", a.color, b.color);
    if (!ignoring_.point_errors) Value(path + ".error", a.error, b.error);
    Value(path + ".track_begin", a.track_begin, b.track_begin);
    Value(path + ".track_end", a.track_end, b.track_end);
  }

  template <typename T>
  void Report(const std::string& path, const T& a, const T& b) {
    if (!difference_.empty()) return;
    std::ostringstream text;
    text.precision(17);
    text << path << ": " << a << " and " << b;
    difference_ = text.str();
  }

  Ignoring ignoring_;
  std::string difference_;
};

// EXPECT_THAT(model, IsModel(expected)): the same bits everywhere but in what
// is ignored; otherwise says where they differ first.
MATCHER_P2(IsModel, expected, ignoring, "equals the expected model") {
  const std::string difference =
      ModelComparison(ignoring).FirstDifference(arg, expected);
  *result_listener << difference;
  return difference.empty();
}
inline auto IsModel(const Model& expected) {
  return IsModel(expected, Ignoring());
}

// The same of what is calibrated: EXPECT_THAT(model, HasRigsOf(expected)).
MATCHER_P(HasRigsOf, expected, "has the expected model's rigs") {
  const std::string difference =
      ModelComparison(Ignoring()).FirstDifferenceOfRigs(arg, expected);
  *result_listener << difference;
  return difference.empty();
}

// The message of the Error that `action` throws; "" if it throws none.
template <typename Error, typename Action>
std::string MessageOf(const Action& action) {
  try {
    action();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}
template <typename Action>
std::string ModelErrorOf(const Action& action) {
  return MessageOf<ModelError>(action);
}
template <typename Action>
std::string WriteErrorOf(const Action& action) {
  return MessageOf<WriteError>(action);
}

// The folder of real models that the environment names in KROT_REAL_MODELS,
// one subfolder each; none if it is unset: skip the test then.
inline std::optional<std::filesystem::path> RealModels() {
  const char* folder = std::getenv("KROT_REAL_MODELS");
  if (folder == nullptr || *folder == '\0') return std::nullopt;
  return folder;
}

}  // namespace krot::internal
