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

const char* PairStateName(PairState state) {
  using Enum = PairState;
  return NameIn<Enum>({{Enum::kNotChecked, "not checked"},
                       {Enum::kKept, "kept"},
                       {Enum::kContradictory, "contradictory"},
                       {Enum::kUndecided, "undecided"}},
                      state);
}

const char* PoseFaultName(PoseFault fault) {
  using Enum = PoseFault;
  return NameIn<Enum>({{Enum::kNone, "none"},
                       {Enum::kPosition, "position"},
                       {Enum::kRotation, "rotation"},
                       {Enum::kUnclear, "unclear"}},
                      fault);
}

Json ExplanationJson(const Explanation& explanation, const PairCheck& check) {
  Json images = Json::array();
  for (const int32_t i : explanation.images) {
    images.push_back(check.images[i].name);
  }
  return {{"images", images}, {"cost_matches", explanation.cost}};
}

}  // namespace

Json PairJson(const PairCheck& check) {
  Json images = ListJson(check.images, [&](const CheckedImage& image) -> Json {
    return {
        {"image_id", image.image_id},
        {"image_name", image.name},
        {"num_kept_pairs", image.num_kept},
        {"num_contradictory_pairs", image.num_contradictory},
        {"num_undecided_pairs", image.num_undecided},
        {"kept_matches", image.kept_matches},
        {"contradictory_matches", image.contradictory_matches},
        {"is_wrong", image.is_wrong},
        {"fault", image.is_wrong ? Json(PoseFaultName(image.fault)) : Json()},
        {"num_matches", image.num_matches},
        {"num_agreeing_moved", image.num_agreeing_moved},
        {"num_agreeing_turned", image.num_agreeing_turned},
        {"moved_by", image.moved_by},
        {"turned_by_deg", image.turned_by_deg},
        {"is_rotation_proved_wrong", image.is_rotation_proved_wrong}};
  });
  Json pairs = Json::array();
  for (const CheckedPair& pair : check.pairs) {
    const bool is_contradictory = pair.state == PairState::kContradictory;
    pairs.push_back({{"image1", check.images[pair.image1].name},
                     {"image2", check.images[pair.image2].name},
                     {"state", PairStateName(pair.state)},
                     {"num_matches", pair.num_matches},
                     {"num_agreeing", pair.num_agreeing},
                     {"median_error_px", FiniteOrNull(pair.median_error_px)},
                     {"num_explained",
                      is_contradictory ? Json(pair.num_explained) : Json()},
                     {"most_explained",
                      is_contradictory ? Json(pair.most_explained) : Json()},
                     {"has_wrong_matches", pair.has_wrong_matches}});
  }
  Json groups = Json::array();
  for (const std::vector<int32_t>& group : check.groups) {
    Json names = Json::array();
    for (const int32_t i : group) names.push_back(check.images[i].name);
    groups.push_back(names);
  }
  return {{"verdict", PairSentence(check)},
          {"noise_px", check.noise_px},
          {"tolerance_px", check.tolerance_px},
          {"num_kept_pairs", check.num_kept},
          {"num_contradictory_pairs", check.num_contradictory},
          {"num_undecided_pairs", check.num_undecided},
          {"num_not_checked_pairs", check.num_not_checked},
          {"num_without_ray", check.num_without_ray},
          {"cheapest", ExplanationJson(check.cheapest, check)},
          {"runner_up",
           check.runner_up ? ExplanationJson(*check.runner_up, check) : Json()},
          {"is_cheapest_proved", check.is_cheapest_proved},
          {"groups", groups},
          {"images", images},
          {"pairs", pairs}};
}

std::string CheckJson(const CheckReport& report) {
  const ModelCheck& check = report.check;
  Json images = ListJson(check.images, [&](const ImageCheck& image) -> Json {
    return ImageJson(check, image);
  });
  Json observations =
      ListJson(check.observations, [&](const WrongObservation& one) -> Json {
        return ObservationJson(one, {{"w", FiniteOrNull(one.w)},
                                     {"error_px", FiniteOrNull(one.error_px)},
                                     {"is_of_two", one.is_of_two}});
      });
  Json tracks = ListJson(check.tracks, [&](const TwoPointTrack& track) -> Json {
    return {{"point3D_id", track.point3D_id},
            {"num_first", track.num_first},
            {"num_second", track.num_second},
            {"second", VectorJson(track.second)}};
  });
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
      {"cameras", CamerasJson(check)},
      {"images", images},
      {"observations", observations},
      {"tracks", tracks},
      {"parts_sentence", PartsSentence(check)},
      {"parts", PartsJson(check)},
  };
  return ReportText(json, report.run, {{"check", report.seconds_check}});
}

}  // namespace krot::internal
