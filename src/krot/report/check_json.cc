#include "krot/report/pair_report.h"
#include "krot/report/report_json.h"
#include "krot/report/reports.h"

namespace krot::internal {
namespace {

const char* VerdictName(ImageVerdict verdict) {
  constexpr const char* kNames[] = {"fine", "weakly held", "wrong"};
  return kNames[static_cast<size_t>(verdict)];
}

// The name in report.json of the reason why an image is wrong.
const char* FaultName(ImageFault fault) {
  switch (fault) {
    case ImageFault::kMatches:
      return "matches";
    case ImageFault::kLens:
      return "lens";
    case ImageFault::kContradicted:
      return "contradicted";
    case ImageFault::kMisplaced:
      return "misplaced";
    case ImageFault::kChance:
      return "chance";
    case ImageFault::kUnsupported:
      return "unsupported";
    case ImageFault::kNone:
      break;
  }
  return "none";
}

Json ImageJson(const ModelCheck& check, const ImageCheck& image) {
  return {{"image_id", image.image_id},
          {"image_name", image.name},
          {"verdict", VerdictName(image.verdict)},
          {"fault", image.fault == ImageFault::kNone
                        ? Json()
                        : Json(FaultName(image.fault))},
          {"reason", ReasonOf(check, image)},
          {"num_observations", image.num_observations},
          {"num_tested", image.num_tested},
          {"num_wrong", image.num_wrong},
          {"center_sigma", FiniteOrNull(image.center_sigma)},
          {"relative_center_sigma", FiniteOrNull(image.relative_center_sigma)},
          {"turn_sigma_deg", FiniteOrNull(image.turn_sigma_deg)},
          {"turn_deg", image.turn_deg},
          {"shift", image.shift}};
}

}  // namespace

std::string CheckJson(const CheckReport& report) {
  const ModelCheck& check = report.check;
  Json images = Json::array();
  for (const ImageCheck& image : check.images) {
    images.push_back(ImageJson(check, image));
  }
  Json observations = Json::array();
  for (const WrongObservation& one : check.observations) {
    observations.push_back({{"image_id", one.image_id},
                            {"image_name", one.image_name},
                            {"point2D_idx", one.point2D_idx},
                            {"point3D_id", one.point3D_id},
                            {"w", FiniteOrNull(one.w)},
                            {"error_px", FiniteOrNull(one.error_px)},
                            {"is_of_two", one.is_of_two}});
  }
  Json tracks = Json::array();
  for (const TwoPointTrack& track : check.tracks) {
    tracks.push_back({{"point3D_id", track.point3D_id},
                      {"num_first", track.num_first},
                      {"num_second", track.num_second},
                      {"second", VectorJson(track.second)}});
  }
  const Json json = {
      {"version", report.run.version},
      {"command", "model_checker"},
      {"verdict", CheckSentence(report)},
      {"is_anything_wrong", check.IsAnythingWrong()},
      {"is_adjusted", check.is_adjusted},
      {"num_images", check.images.size()},
      {"num_wrong_images", check.NumImages(ImageVerdict::kWrong)},
      {"num_weakly_held_images", check.NumImages(ImageVerdict::kWeaklyHeld)},
      {"num_observations", report.num_observations},
      {"num_tested", check.num_tested},
      {"num_wrong_observations", check.observations.size()},
      {"sigma_px", NumberOrNull(check.sigma_px)},
      {"cauchy_scale_px", NumberOrNull(check.cauchy_scale_px)},
      {"median_scale_px", NumberOrNull(check.median_scale_px)},
      {"critical_w", check.critical_w},
      {"pixel_error",
       {{"before", ErrorJson(report.pixel_error_before)},
        {"after", ErrorJson(report.pixel_error_after)}}},
      {"database", check.pairs ? PairJson(*check.pairs) : Json()},
      {"moved_images", report.moved},
      {"images", images},
      {"observations", observations},
      {"tracks", tracks},
  };
  return ReportText(json, report.run, {{"check", report.seconds_check}});
}

}  // namespace krot::internal
