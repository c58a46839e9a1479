#include "krot/report/camera_report.h"

#include <algorithm>

#include "krot/report/text_table.h"

namespace krot::internal {
namespace {

const char* CameraFaultName(CameraFault fault) {
  using Enum = CameraFault;
  return NameIn<Enum>({{Enum::kFocalLength, "focal length"},
                       {Enum::kPrincipalPoint, "principal point"},
                       {Enum::kDistortion, "distortion"},
                       {Enum::kPlaceInRig, "place in rig"}},
                      fault);
}

}  // namespace

std::string CameraFaultWords(const WrongCamera& camera) {
  const bool is_one = camera.num_images == 1;
  const std::string ask =
      (is_one ? std::string("its image asks")
              : "its " + Counted(camera.num_images, "image") + " ask") +
      " for ";
  switch (camera.fault) {
    case CameraFault::kFocalLength:
      return "its focal length is " + FormatNumber(camera.focal_length_px, 1) +
             " px, and " + ask + "about " +
             FormatNumber(camera.asked_focal_length_px, 1) + " px";
    case CameraFault::kPrincipalPoint:
      return ask + "another principal point, about " +
             FormatNumber(camera.offset_px, 1) + " px away";
    case CameraFault::kDistortion:
      return ask + "another distortion";
    case CameraFault::kPlaceInRig:
      return ask + "another place in its rig, turned by about " +
             FormatNumber(camera.turn_deg, 2) + " degrees and moved by about " +
             FormatLength(camera.shift);
  }
  return "";
}

std::string CamerasSentence(const ModelCheck& check) {
  const WrongCamera& first = check.cameras.front();
  const size_t count = check.cameras.size();
  const std::string name = "camera " + std::to_string(first.camera_id);
  return (count == 1 ? "C" + name.substr(1) + " is wrong: "
                     : Counted(static_cast<int64_t>(count), "camera") +
                           " are wrong, first of all " + name + ": ") +
         CameraFaultWords(first) +
         ". So adjust the model first, with all cameras free.";
}

std::string CameraTable(const ModelCheck& check, size_t max_rows) {
  if (check.cameras.empty() || max_rows == 0) return "";
  TextTable table;
  table.AddRow({"camera", "images", "squared errors that go, %", "why"});
  for (size_t n = 0; n < std::min(check.cameras.size(), max_rows); ++n) {
    const WrongCamera& camera = check.cameras[n];
    table.AddRow(
        {std::to_string(camera.camera_id), std::to_string(camera.num_images),
         FormatNumber(100 * camera.gain, 0), CameraFaultWords(camera)});
  }
  return "\nWrong cameras\n" + table.ToString();
}

nlohmann::ordered_json CamerasJson(const ModelCheck& check) {
  return ListJson(check.cameras, [&](const WrongCamera& camera) -> Json {
    const auto only = [&](CameraFault fault, double value) {
      return camera.fault == fault ? Json(value) : Json();
    };
    return {{"camera_id", camera.camera_id},
            {"fault", CameraFaultName(camera.fault)},
            {"reason", CameraFaultWords(camera)},
            {"num_images", camera.num_images},
            {"gain", camera.gain},
            {"focal_length_px",
             only(CameraFault::kFocalLength, camera.focal_length_px)},
            {"asked_focal_length_px",
             only(CameraFault::kFocalLength, camera.asked_focal_length_px)},
            {"offset_px", only(CameraFault::kPrincipalPoint, camera.offset_px)},
            {"turn_deg", only(CameraFault::kPlaceInRig, camera.turn_deg)},
            {"shift", only(CameraFault::kPlaceInRig, camera.shift)}};
  });
}

}  // namespace krot::internal
