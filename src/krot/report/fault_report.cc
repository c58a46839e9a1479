#include "krot/report/reports.h"

#include <algorithm>
#include <cmath>

#include "krot/report/report_json.h"
#include "krot/report/text_table.h"

namespace krot::internal {

std::string SigmaText(double sigma) {
  if (!std::isfinite(sigma)) return "anywhere";
  return sigma < 1e-3 ? Scientific(sigma) : FormatNumber(sigma, 3);
}

namespace {

std::string NameOfFirst(const ModelCheck& check, const ModelPart& part) {
  return check.images[part.images.front()].name +
         (part.images.size() > 1 ? ", ..." : "");
}

bool IsApart(const ModelPart& part) { return part.num_tracks == 0; }

const char* CameraFaultName(CameraFault fault) {
  using Enum = CameraFault;
  return NameIn<Enum>({{Enum::kFocalLength, "focal length"},
                       {Enum::kPrincipalPoint, "principal point"},
                       {Enum::kDistortion, "distortion"},
                       {Enum::kPlaceInRig, "place in rig"}},
                      fault);
}

// For example "its focal length is 1,106.2 px, and its 15 images ask for
// 1,019.5 px".
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

}  // namespace

std::string PartsSentence(const ModelCheck& check) {
  std::vector<const ModelPart*> apart, weak;
  for (const ModelPart& part : check.parts) {
    (IsApart(part) ? apart : weak).push_back(&part);
  }
  const auto words = [&](const ModelPart& part) {
    return Counted(part.images.size(), "image") + " (" +
           NameOfFirst(check, part) + ")";
  };
  std::string text;
  if (!apart.empty()) {
    text = "The model falls into " + Counted(apart.size() + 1, "part") +
           " that share no track, so none tells where " +
           words(*apart.front()) +
           (apart.size() > 1 ? " and the other small parts" : "") +
           (apart.size() > 1 || apart.front()->images.size() > 1 ? " stand"
                                                                 : " stands") +
           " relative to the rest, nor in which scale.";
  }
  if (weak.empty()) return text;
  const ModelPart& weakest = **std::max_element(
      weak.begin(), weak.end(), [](const ModelPart* a, const ModelPart* b) {
        return a->relative_center_sigma < b->relative_center_sigma;
      });
  const bool is_held = std::isfinite(weakest.relative_center_sigma);
  return text + (text.empty() ? "" : " ") +
         Counted(weakest.num_tracks, "track") +
         (weakest.num_tracks == 1 ? " ties " : " tie ") + words(weakest) +
         " to the rest " +
         (is_held ? "so weakly that noise alone may have moved them, all "
                    "together, by " +
                        FormatNumber(100 * weakest.relative_center_sigma, 0) +
                        " % of the cameras' radius (standard deviation)"
                  : "and leave their common place, turn or scale open") +
         (weak.size() > 1 ? "; " + Counted(weak.size() - 1, "other part") +
                                (weak.size() > 2 ? " are" : " is") + " as loose"
                          : "") +
         ".";
}

std::string PartTable(const ModelCheck& check, size_t max_rows) {
  if (check.parts.empty() || max_rows == 0) return "";
  TextTable table;
  table.AddRow({"images of the part", "tracks it shares", "cameras +-",
                "% of the radius"});
  for (size_t n = 0; n < std::min(check.parts.size(), max_rows); ++n) {
    const ModelPart& part = check.parts[n];
    table.AddRow(
        {Thousands(part.images.size()) + " (" + NameOfFirst(check, part) + ")",
         std::to_string(part.num_tracks), SigmaText(part.center_sigma),
         std::isfinite(part.relative_center_sigma)
             ? FormatNumber(100 * part.relative_center_sigma, 1)
             : "-"});
  }
  return "\nParts that tracks do not tie to the rest firmly: " +
         Thousands(check.parts.size()) + "\n" + table.ToString();
}

nlohmann::ordered_json PartsJson(const ModelCheck& check) {
  return ListJson(check.parts, [&](const ModelPart& part) -> Json {
    Json names = Json::array();
    for (const int32_t n : part.images) names.push_back(check.images[n].name);
    return {{"num_tracks", part.num_tracks},
            {"center_sigma", FiniteOrNull(part.center_sigma)},
            {"relative_center_sigma", FiniteOrNull(part.relative_center_sigma)},
            {"images", names}};
  });
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

std::string LastingFaultLines(const LastingFaults& faults) {
  std::string text;
  if (faults.num_in_camera > 0) {
    text += Counted(faults.num_in_camera, "observation") +
            (faults.num_in_camera == 1 ? " sees a point that lies"
                                       : " see points that lie") +
            " in the camera itself, which no adjustment mends: krot "
            "model_checker --output_path, or krot outlier_filter, removes " +
            (faults.num_in_camera == 1 ? "it" : "them") + ".\n";
  }
  if (faults.num_parts > 1) {
    text +=
        "The model falls into " + Counted(faults.num_parts, "part") +
        " that share no track (" + Thousands(faults.num_images_outside) +
        " of " + Counted(faults.num_images, "image") +
        " are outside the largest), so none tells where they stand relative "
        "to each other, nor in which scale; krot model_checker lists "
        "them.\n";
  }
  return text;
}

}  // namespace krot::internal
