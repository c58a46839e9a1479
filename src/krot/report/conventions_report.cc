#include "krot/report/reports.h"

#include <algorithm>
#include <cctype>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "krot/camera/camera_model.h"
#include "krot/report/report_json.h"

namespace krot::internal {

namespace {

// For example "x right, y down, z forward".
std::string AxesWords(const Eigen::MatrixXd& axes) {
  constexpr const char* kDirections[] = {"left", "right",    "up",
                                         "down", "backward", "forward"};
  std::vector<std::string> words;
  for (int j = 0; j < axes.cols(); ++j) {
    Eigen::Index i = 0;
    axes.col(j).cwiseAbs().maxCoeff(&i);
    words.push_back(std::string(1, "xyz"[j]) + " " +
                    kDirections[2 * i + (axes(i, j) > 0 ? 1 : 0)]);
  }
  return ListText(words);
}

std::string CameraAxesWords(const PoseConventions& conventions) {
  Eigen::Matrix3d axes = conventions.cam_from_file_axes;
  if (conventions.is_left_handed) axes.col(1) = -axes.col(1);
  return AxesWords(axes);
}

std::string PixelAxesWords(const Conventions& conventions) {
  return AxesWords(conventions.pixel_from_file_axes);
}

// For example "poses from camera to world".
std::vector<std::string> PoseWords(const PoseConventions& one,
                                   const std::string& world) {
  std::vector<std::string> words;
  if (one.has_w_last) words.push_back("quaternions with w last (x, y, z, w)");
  if (one.is_world_from_cam) {
    words.push_back((one.has_centers ? "poses" : "rotations") +
                    (" from camera to " + world));
  } else if (one.has_centers) {
    words.push_back("camera centres in place of translations");
  }
  if (one.is_left_handed || !one.cam_from_file_axes.isIdentity()) {
    words.push_back(std::string(one.is_left_handed ? "left-handed " : "") +
                    "camera axes (" + CameraAxesWords(one) + ")");
  }
  return words;
}

// What differs from COLMAP's conventions.
std::string ConventionWords(const Conventions& one) {
  std::vector<std::string> words = PoseWords(one.poses, "world");
  std::vector<std::string> of_sensors = PoseWords(one.sensors, "rig");
  if (one.rig_factor != 1) {
    of_sensors.push_back("translations that must be multiplied by " +
                         FormatNumber(one.rig_factor, 6));
  }
  if (!of_sensors.empty()) {
    words.push_back("sensors in rigs with " + ListText(std::move(of_sensors)));
  }
  if (one.intrinsics_factor != 1) {
    const bool is_larger = one.intrinsics_factor < 1;
    words.push_back(
        "intrinsics for photos " +
        FormatNumber(
            is_larger ? 1 / one.intrinsics_factor : one.intrinsics_factor, 0) +
        (is_larger ? " times as large" : " times smaller"));
  }
  if (one.has_central_principal_point) {
    words.push_back("principal points far from the middle of the photos");
  }
  if (!one.pixel_from_file_axes.isIdentity()) {
    words.push_back("2D points with other axes (" + PixelAxesWords(one) + ")");
  }
  if (one.has_wrong_points) {
    words.push_back("3D points that are not where the images see them");
  }
  return ListText(std::move(words));
}

// For example "its 50 images ask for the principal point (540.2, 959.8)".
std::string CameraWords(const PixelMap& map) {
  const Camera& camera = map.cameras.front();
  const auto center = static_cast<size_t>(
      FindCameraModel(camera.model_id)->num_focal_lengths());
  const auto pair = [&](size_t i) {
    return FormatNumber(camera.params[i], 1) + ", " +
           FormatNumber(camera.params[i + 1], 1);
  };
  const bool is_one = map.cameras.size() == 1;
  const Eigen::Vector2d scale = map.image_from_camera.leftCols<2>().diagonal();
  const Eigen::Vector2d center_now(camera.params[center],
                                   camera.params[center + 1]);
  const Eigen::Vector2d center_as_read =
      (center_now - map.image_from_camera.col(2)).cwiseQuotient(scale);
  std::string asked;
  if (scale != Eigen::Vector2d::Ones()) {
    asked = center == 1
                ? "a focal length of " + Pixels(camera.params.front(), 1)
                : "focal lengths of (" + pair(0) + ") px";
  }
  if ((center_now - center_as_read).norm() > 1 || asked.empty()) {
    asked += TextIf(!asked.empty(), " and ") + "the principal point (" +
             pair(center) + ") px";
  }
  const std::string images = map.images.size() == 1
                                 ? "image asks"
                                 : Counted(map.images.size(), "image") + " ask";
  return (is_one ? "camera " + std::to_string(camera.id) + " is wrong: its "
                 : Counted(map.cameras.size(), "camera") +
                       " are wrong, first of all camera " +
                       std::to_string(camera.id) + ": their ") +
         images + " for " + asked + TextIf(!is_one, " there");
}

// For example "the 2D points of 25 images (a.jpg, ...) are not those of their
// photos, but 0.5 times as large".
std::string PixelWords(const PixelMap& map) {
  const Eigen::Matrix2d A = map.image_from_camera.leftCols<2>();
  const Eigen::Vector2d scale = A.rowwise().norm();
  const Eigen::Matrix2d axes = scale.cwiseInverse().asDiagonal() * A;
  std::vector<std::string> differences;
  if (!axes.isIdentity()) {
    differences.push_back("with other axes (" + AxesWords(axes.transpose()) +
                          ")");
  }
  if (scale[0] != scale[1]) {
    differences.push_back(FormatLength(scale[0]) + " times as wide and " +
                          FormatLength(scale[1]) + " times as high");
  } else if (scale[0] != 1) {
    differences.push_back(FormatLength(scale[0]) + " times as large");
  }
  const Eigen::Vector2d shift = map.image_from_camera.col(2);
  if (axes.isIdentity() && !shift.isZero()) {
    differences.push_back("moved by (" + FormatNumber(shift.x(), 1) + ", " +
                          FormatNumber(shift.y(), 1) + ") px");
  }
  return "the 2D points of " + Counted(map.images.size(), "image") + " (" +
         map.image_names.front() + TextIf(map.images.size() > 1, ", ...") +
         ") are not those of their photos, but " +
         ListText(std::move(differences));
}

std::string MapsWords(const Conventions& one) {
  std::string text;
  for (const PixelMap& map : one.pixel_maps) {
    text += TextIf(!text.empty(), "; and ") +
            (map.cameras.empty() ? PixelWords(map) : CameraWords(map));
  }
  return text;
}

Json MapJson(const PixelMap& map) {
  const auto camera_json = [](const Camera& camera) {
    return Json{{"camera_id", camera.id}, {"params", camera.params}};
  };
  const auto row = [&](int i) {
    return VectorJson(map.image_from_camera.row(i).transpose());
  };
  return {{"images", map.image_names},
          {"cameras", ListJson(map.cameras, camera_json)},
          {"image_from_camera", {row(0), row(1)}}};
}

Json PoseJson(const PoseConventions& one) {
  Json json = KROT_JSON_OF(one, has_w_last, is_world_from_cam, has_centers,
                           is_left_handed);
  json["camera_axes"] = CameraAxesWords(one);
  return json;
}

}  // namespace

std::string DiscardedSentence(const std::vector<DiscardedCamera>& discarded) {
  if (discarded.empty()) return "";
  const DiscardedCamera& first = discarded.front();
  const bool is_short =
      first.focal_length_px < static_cast<double>(first.side_px);
  const size_t num_more = discarded.size() - 1;
  return "Camera " + std::to_string(first.camera_id) +
         ": its focal length of " + Pixels(first.focal_length_px, 2) + " is " +
         (is_short ? "below 0.1" : "above 10") +
         " of its photos' larger side, " + std::to_string(first.side_px) +
         " px: COLMAP's mapper would discard such a camera (--Mapper." +
         (is_short ? "min" : "max") + "_focal_length_ratio)" +
         TextIf(num_more > 0, ", and " + Counted(num_more, "other")) +
         ". Unless its lens is like that, write the true one into cameras.txt "
         "and adjust the model with it held (krot bundle_adjuster "
         "--BundleAdjustment.refine_focal_length 0).\n";
}

std::string ConventionsSentence(const Conventions& one) {
  const std::string falls = " median error falls from " +
                            FormatNumber(one.median_error_as_read_px, 2) +
                            " to " + Pixels(one.median_error_px, 2) + ".";
  if (!one.pixel_maps.empty()) {
    std::string maps = MapsWords(one);
    maps[0] = static_cast<char>(std::toupper(maps[0]));
    return maps + ". Put right, their" + falls;
  }
  const bool is_read_otherwise = one.NumDifferences() > 0;
  return (is_read_otherwise
              ? "The model is not in COLMAP's conventions, but has "
              : "The model has ") +
         ConventionWords(one) +
         (is_read_otherwise ? ": converted, its" : ": with others, the") +
         falls;
}

nlohmann::ordered_json ConventionsJson(const Conventions& one) {
  Json json = {{"words", one.pixel_maps.empty() ? ConventionWords(one)
                                                : MapsWords(one)}};
  json.update(PoseJson(one.poses));
  json["sensors"] = PoseJson(one.sensors);
  json["pixel_axes"] = PixelAxesWords(one);
  json["pixel_maps"] = ListJson(one.pixel_maps, MapJson);
  json.update(KROT_JSON_OF(one, rig_factor, intrinsics_factor,
                           has_central_principal_point, has_wrong_points,
                           median_error_as_read_px, median_error_px));
  return json;
}

namespace {

const char* CameraFaultName(CameraFault fault) {
  using Enum = CameraFault;
  return NameIn<Enum>({{Enum::kFocalLength, "focal length"},
                       {Enum::kPrincipalPoint, "principal point"},
                       {Enum::kDistortion, "distortion"},
                       {Enum::kPlaceInRig, "place in rig"},
                       {Enum::kAspectRatio, "aspect ratio"},
                       {Enum::kLens, "camera model"},
                       {Enum::kSharing, "sharing"},
                       {Enum::kImages, "images"}},
                      fault);
}

// For example "its focal length is 1,106.2 px, and its 15 images ask for
// 1,019.5 px".
std::string CameraFaultWords(const WrongCamera& camera) {
  const bool is_one = camera.num_images == 1;
  const std::string ask =
      "its " +
      (is_one ? "image asks" : Counted(camera.num_images, "image") + " ask") +
      " for ";
  switch (camera.fault) {
    case CameraFault::kFocalLength: {
      // What is asked for is known to first order.
      const double ratio =
          camera.asked_focal_length_px / camera.focal_length_px;
      const std::string asked =
          ratio > 1.2   ? "a far longer one"
          : ratio < 0.8 ? "a far shorter one"
                        : "about " + Pixels(camera.asked_focal_length_px, 1);
      const std::vector<double>& own = camera.focal_lengths_px;
      if (own.size() == 2 && own[0] != own[1]) {
        return "its focal lengths are " + FormatNumber(own[0], 1) + " and " +
               Pixels(own[1], 1) + ", and " + ask +
               (ratio > 1.2   ? "far longer ones"
                : ratio < 0.8 ? "far shorter ones"
                              : "others, " + asked + " in the mean");
      }
      return "its focal length is " + Pixels(camera.focal_length_px, 1) +
             ", and " + ask + asked;
    }
    case CameraFault::kPrincipalPoint:
      return ask + "another principal point, about " +
             FormatNumber(camera.offset_px, 1) + " px away";
    case CameraFault::kDistortion:
      return ask + "another distortion";
    case CameraFault::kPlaceInRig:
      return ask + "another place in its rig, turned by about " +
             FormatNumber(camera.turn_deg, 2) + " degrees and moved by about " +
             FormatLength(camera.shift);
    case CameraFault::kAspectRatio:
      return ask + "an fx that is not fy, and " + camera.model_name +
             " has one focal length";
    case CameraFault::kLens:
      return ask + "a distortion that " + camera.model_name + " does not have";
    case CameraFault::kSharing: {
      const size_t count = camera.image_names.size();
      return Counted(count, "image") + " of its " +
             Thousands(camera.num_images) + (count == 1 ? " asks" : " ask") +
             " for another lens (" + ListText(camera.image_names, 5) +
             "): they were zoomed, cropped or resized, or what they show moved";
    }
    case CameraFault::kImages:
      return "all of its " + Counted(camera.num_images, "image") +
             " are wrong, so its lens or its place in a rig may be";
  }
  return "";
}

}  // namespace

bool NeedsOtherCameras(const ModelCheck& check) {
  return std::any_of(check.cameras.begin(), check.cameras.end(),
                     [](const WrongCamera& camera) {
                       return camera.fault == CameraFault::kAspectRatio ||
                              camera.fault == CameraFault::kLens ||
                              camera.fault == CameraFault::kSharing;
                     });
}

std::string OtherCameraSteps(const ModelCheck& check, const std::string& input,
                             const std::string& images) {
  const bool is_shared =
      std::any_of(check.cameras.begin(), check.cameras.end(),
                  [](const WrongCamera& camera) {
                    return camera.fault == CameraFault::kSharing;
                  });
  if (is_shared || check.cameras.empty()) {
    return "  Give every image a camera of its own, in a new database; then "
           "match and map anew:\n    colmap feature_extractor "
           "--ImageReader.single_camera_per_image 1 "
           "--ImageReader.camera_model OPENCV --database_path NEW_DATABASE "
           "--image_path " +
           images + "\n";
  }
  return "  Give camera " + std::to_string(check.cameras.front().camera_id) +
         " the model OPENCV: in AS_TEXT/cameras.txt its parameters become fx "
         "fy cx cy k1\n  k2 p1 p2, 0 where nothing is known. Then adjust that "
         "model:\n"
         "    mkdir -p AS_TEXT\n    colmap model_converter --output_type TXT "
         "--input_path " +
         input +
         " --output_path AS_TEXT\n    krot bundle_adjuster "
         "--input_path AS_TEXT --output_path ADJUSTED\n";
}

std::string CamerasSentence(const ModelCheck& check) {
  const WrongCamera& first = check.cameras.front();
  const size_t count = check.cameras.size();
  const std::string name = "camera " + std::to_string(first.camera_id);
  return (count == 1 ? "C" + name.substr(1) + " is wrong: "
                     : Counted(static_cast<int64_t>(count), "camera") +
                           " are wrong, first of all " + name + ": ") +
         CameraFaultWords(first) + ". " +
         (NeedsOtherCameras(check)
              ? "No adjustment mends that: see what comes next."
              : "So adjust the model first, with all cameras free.");
}

std::string CameraTable(const ModelCheck& check, size_t max_rows) {
  return TitledTable(
      "Wrong cameras", {"camera", "images", "squared errors that go, %", "why"},
      check.cameras, max_rows, [](const WrongCamera& camera) -> Row {
        return {camera.camera_id, camera.num_images,
                camera.fault == CameraFault::kImages
                    ? ""
                    : FormatNumber(100 * camera.gain, 0),
                CameraFaultWords(camera)};
      });
}

nlohmann::ordered_json CamerasJson(const ModelCheck& check) {
  return ListJson(check.cameras, [](const WrongCamera& camera) {
    const auto only = [&](CameraFault fault, const Json& values) {
      return KnownIf(camera.fault == fault, values);
    };
    Json json = {
        {"camera_id", camera.camera_id},
        {"fault", CameraFaultName(camera.fault)},
        {"reason", CameraFaultWords(camera)},
        {"num_images", camera.num_images},
        {"gain",
         camera.fault == CameraFault::kImages ? Json() : Json(camera.gain)}};
    json.update(
        only(CameraFault::kFocalLength,
             KROT_JSON_OF(camera, focal_length_px, asked_focal_length_px)));
    json.update(
        only(CameraFault::kPrincipalPoint, KROT_JSON_OF(camera, offset_px)));
    json.update(only(CameraFault::kSharing, KROT_JSON_OF(camera, image_names)));
    json.update(
        only(CameraFault::kPlaceInRig, KROT_JSON_OF(camera, turn_deg, shift)));
    return json;
  });
}

}  // namespace krot::internal
