#include "krot/report/reports.h"

#include <array>
#include <cmath>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "krot/base/numbers.h"
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

}  // namespace

std::string ReasonOf(const ModelCheck& check, const ImageCheck& image) {
  if (image.verdict == ImageVerdict::kWeaklyHeld) {
    return "its centre may move more than ten times as far as the median "
           "image's" +
           TextIf(image.num_wrong > image.num_tested / 10,
                  ", and " + std::to_string(image.num_wrong) +
                      " of its observations contradict: it may be misplaced");
  }
  switch (image.fault) {
    case ImageFault::kMatches:
      return "its matches contradict its " +
             PoseFaultWords(check.pairs->images[&image - check.images.data()]);
    case ImageFault::kLens:
      return "its own camera's focal length is " +
             Pixels(image.focal_length_px, 0) + ", the others' " +
             Pixels(image.others_focal_length_px, 0);
    case ImageFault::kContradicted:
      return "most of them contradict the others";
    case ImageFault::kMisplaced:
      return "another pose would halve its squared errors";
    case ImageFault::kChance:
      return "they fit no better than chance matches";
    case ImageFault::kUnsupported:
      return "too few of its 2D points agree with 3D points to hold its pose";
    case ImageFault::kNone:
      break;
  }
  return image.verdict == ImageVerdict::kNotJudged
             ? "has no 2D points: its pose cannot be checked"
             : "";
}

std::string PartsSentence(const ModelCheck& check) {
  const auto apart = PointersIf(check.parts, IsApart);
  auto weak = PointersIf(check.parts, std::not_fn(IsApart));
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
  SortLargestFirst(&weak, &ModelPart::relative_center_sigma);
  const ModelPart& weakest = *weak.front();
  const bool is_held = std::isfinite(weakest.relative_center_sigma);
  return text + (text.empty() ? "" : " ") +
         Counted(weakest.num_tracks, "track", "ties ", "tie ") +
         words(weakest) + " to the rest " +
         (is_held ? "so weakly that noise alone may have moved them, all "
                    "together, by " +
                        FormatNumber(100 * weakest.relative_center_sigma, 0) +
                        " % of the cameras' radius (standard deviation)"
                  : "and leave their common place, turn or scale open") +
         TextIf(weak.size() > 1,
                "; " + Counted(weak.size() - 1, "other part", "is", "are") +
                    " as loose") +
         ".";
}

std::string NotJudgedSentence(const ModelCheck& check) {
  std::vector<std::string> names;
  for (const ImageCheck& image : check.images) {
    if (image.verdict == ImageVerdict::kNotJudged) names.push_back(image.name);
  }
  const size_t count = names.size();
  return TextIf(
      count > 0,
      Counted(count, "image", "has", "have") +
          " no 2D points: " + (count == 1 ? "its pose" : "their poses") +
          " cannot be checked (" + ListText(std::move(names), 5) + ").\n");
}

std::string StillPointsSentence(const ModelCheck& check) {
  return Counted(check.still_points.size(), "3D point", "stays", "stay") +
         " at the same pixels while the cameras turn: a hood, a time stamp or "
         "the background of a turntable bends the model.";
}

std::string MaskSteps(const std::string& images) {
  return "  Make MASK.png, as large as the photos and black where they show "
         "what stays, and extract\n  features in a new database; then match "
         "and map anew:\n    colmap feature_extractor "
         "--ImageReader.camera_mask_path MASK.png --database_path NEW_DATABASE "
         "--image_path " +
         images + "\n";
}

std::string SamePhotosSentence(const ModelCheck& check) {
  if (check.same_photos.empty()) return "";
  const auto [first, second] = check.same_photos.front();
  const size_t num_more = check.same_photos.size() - 1;
  return check.images[first].name + " and " + check.images[second].name +
         " are the same photo" +
         TextIf(num_more > 0, ", as are " + Counted(num_more, "other pair")) +
         ": the observations count twice, so remove one of the two.\n";
}

std::string PartTable(const ModelCheck& check, size_t max_rows) {
  return TitledTable("Parts that tracks do not tie to the rest firmly: " +
                         Thousands(check.parts.size()),
                     {"images of the part", "tracks it shares", "cameras +-",
                      "% of the radius"},
                     check.parts, max_rows, [&](const ModelPart& part) -> Row {
                       return {
                           Thousands(part.images.size()) + " (" +
                               NameOfFirst(check, part) + ")",
                           part.num_tracks, SigmaText(part.center_sigma),
                           FormatNumber(100 * part.relative_center_sigma, 1)};
                     });
}

nlohmann::ordered_json PartsJson(const ModelCheck& check) {
  return ListJson(check.parts, [&](const ModelPart& part) {
    Json json =
        KROT_JSON_OF(part, num_tracks, center_sigma, relative_center_sigma);
    json["images"] =
        ListJson(part.images, [&](int32_t n) { return check.images[n].name; });
    return json;
  });
}

std::string ObservationTable(const ModelCheck& check, size_t max_rows) {
  return TitledTable(
      "Wrong observations, of images that are not wrong: w, the error over "
      "what noise makes of it, is above " +
          FormatNumber(check.critical_w, 2),
      {"image", "2D point", "3D point", "w", "px off the rest", ""},
      check.observations, max_rows, [](const WrongObservation& one) -> Row {
        return {one.image_name,
                one.point2D_idx,
                one.point3D_id,
                std::isfinite(one.w) ? FormatNumber(one.w, 1) : "not in front",
                FormatNumber(one.error_px, 2),
                one.is_of_two ? "this or the other one" : ""};
      });
}

std::string TrackTable(const ModelCheck& check, size_t max_rows) {
  return TitledTable(
      "Tracks that are two points: " + Thousands(check.tracks.size()),
      {"3D point", "observations that agree", "that agree on another",
       "which is at"},
      check.tracks, max_rows, [](const TwoPointTrack& track) -> Row {
        return {track.point3D_id, track.num_first, track.num_second,
                FormatNumber(track.second.x(), 3) + " " +
                    FormatNumber(track.second.y(), 3) + " " +
                    FormatNumber(track.second.z(), 3)};
      });
}

std::string LastingFaultLines(const LastingFaults& faults) {
  std::string text;
  if (faults.num_in_camera > 0) {
    text += Counted(faults.num_in_camera, "observation",
                    "sees a point that lies", "see points that lie") +
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

namespace {

const char* VerdictName(ImageVerdict verdict) {
  constexpr const char* kNames[] = {"fine", "weakly held", "wrong",
                                    "not judged"};
  return kNames[static_cast<size_t>(verdict)];
}

// The name in report.json of the reason why an image is wrong.
const char* FaultName(ImageFault fault) {
  using Enum = ImageFault;
  return NameIn<Enum>({{Enum::kNone, "none"},
                       {Enum::kMatches, "matches"},
                       {Enum::kLens, "lens"},
                       {Enum::kContradicted, "contradicted"},
                       {Enum::kMisplaced, "misplaced"},
                       {Enum::kChance, "chance"},
                       {Enum::kUnsupported, "unsupported"}},
                      fault);
}

Json ImageJson(const ModelCheck& check, const ImageCheck& image) {
  Json json = {{"image_id", image.image_id},
               {"image_name", image.name},
               {"verdict", VerdictName(image.verdict)},
               {"fault", image.fault == ImageFault::kNone
                             ? Json()
                             : Json(FaultName(image.fault))},
               {"reason", ReasonOf(check, image)}};
  json.update(KROT_JSON_OF(image, num_observations, num_tested, num_wrong,
                           center_sigma, relative_center_sigma, turn_sigma_deg,
                           turn_deg, shift));
  return json;
}

Json TwoPointsJson(const TwoPointTrack& track) {
  return Joined(KROT_JSON_OF(track, point3D_id, num_first, num_second),
                {{"second", VectorJson(track.second)}});
}

}  // namespace

std::string CheckJson(const CheckReport& report) {
  const ModelCheck& check = report.check;
  const auto of_image = [&](const ImageCheck& image) {
    return ImageJson(check, image);
  };
  const auto of_observation = [](const WrongObservation& one) {
    return ObservationJson(one, KROT_JSON_OF(one, w, error_px, is_of_two));
  };
  const Json json = {
      {"version", report.run.version},
      {"command", "model_checker"},
      {"verdict", CheckSentence(report)},
      {"is_anything_wrong", check.IsAnythingWrong()},
      {"is_adjusted", check.is_adjusted},
      {"fits", check.fits},
      {"num_misplaced_points", check.misplaced_points.size()},
      {"num_still_points", check.still_points.size()},
      {"conventions", JsonIf(check.conventions, ConventionsJson)},
      {"num_images", check.images.size()},
      {"num_wrong_images", check.NumImages(ImageVerdict::kWrong)},
      {"num_weakly_held_images", check.NumImages(ImageVerdict::kWeaklyHeld)},
      {"num_images_not_judged", check.NumImages(ImageVerdict::kNotJudged)},
      {"num_observations", report.num_observations},
      {"num_tested", check.num_tested},
      {"num_wrong_observations", check.observations.size()},
      {"sigma_px", check.sigma_px},
      {"cauchy_scale_px", check.cauchy_scale_px},
      {"median_scale_px", check.median_scale_px},
      {"critical_w", check.critical_w},
      {"pixel_error",
       BeforeAfterJson(report.pixel_error_before, report.pixel_error_after)},
      {"database", JsonIf(check.pairs, PairJson)},
      {"moved_images", report.moved},
      {"error_correlation", check.error_correlation},
      {"cameras", CamerasJson(check)},
      {"discarded_cameras",
       ListJson(report.discarded,
                [](const DiscardedCamera& one) -> Json {
                  return KROT_JSON_OF(one, camera_id, focal_length_px, side_px);
                })},
      {"images", ListJson(check.images, of_image)},
      {"observations", ListJson(check.observations, of_observation)},
      {"tracks", ListJson(check.tracks, TwoPointsJson)},
      {"same_photos", ListJson(check.same_photos,
                               [&](const std::array<int32_t, 2>& pair) {
                                 return ListJson(pair, [&](int32_t n) {
                                   return check.images[n].name;
                                 });
                               })},
      {"parts_sentence", PartsSentence(check)},
      {"parts", PartsJson(check)},
  };
  return ReportText(json, report.run, {{"check", report.seconds_check}});
}

}  // namespace krot::internal
