#include <algorithm>
#include <cmath>
#include <vector>

#include "krot/analysis/epipolar.h"
#include "krot/base/numbers.h"
#include "krot/model/rigs.h"
#include "krot/report/html_page.h"
#include "krot/report/report_json.h"
#include "krot/report/reports.h"
#include "krot/report/text_table.h"

namespace krot::internal {
namespace {

std::string PercentOf(int64_t part, int64_t of) {
  if (of == 0) return "-";
  return FormatNumber(
             100.0 * static_cast<double>(part) / static_cast<double>(of), 0) +
         " %";
}

std::vector<const CheckedImage*> WronglyPosedImages(const PairCheck& check) {
  return PointersIf(check.images,
                    [](const CheckedImage& image) { return image.is_wrong; });
}

// Pairs with wrong matches, those with the most matches first.
std::vector<const CheckedPair*> WronglyMatchedPairs(const PairCheck& check) {
  auto wrong = PointersIf(check.pairs, [](const CheckedPair& pair) {
    return pair.has_wrong_matches;
  });
  SortLargestFirst(&wrong, &CheckedPair::num_matches);
  return wrong;
}

std::string WrongImageTable(const PairCheck& check, size_t max_rows) {
  return TitledTable(
      "Images whose poses the matches contradict",
      {"image", "pairs kept", "contradictory", "what is wrong, to fit best",
       "matches that fit if moved", "if turned"},
      WronglyPosedImages(check), max_rows,
      [](const CheckedImage* image) -> Row {
        return {image->name,
                image->num_kept,
                image->num_contradictory,
                PoseFaultWords(*image),
                PercentOf(image->num_agreeing_moved, image->num_matches),
                PercentOf(image->num_agreeing_turned, image->num_matches)};
      });
}

std::string WrongPairTable(const PairCheck& check, size_t max_rows) {
  const std::vector<const CheckedPair*> wrong = WronglyMatchedPairs(check);
  return TitledTable("Contradictory pairs of images that are not wrong: " +
                         std::to_string(wrong.size()),
                     {"image", "and image", "matches", "agree with the poses"},
                     wrong, max_rows, [&](const CheckedPair* pair) -> Row {
                       return {check.images[pair->image1].name,
                               check.images[pair->image2].name,
                               pair->num_matches, pair->num_agreeing};
                     });
}

std::string GroupTable(const PairCheck& check, size_t max_rows) {
  return TitledTable(
      "Groups of images that agree inside and contradict each other",
      {"images", "such as"}, check.groups, max_rows,
      [&](const std::vector<int32_t>& group) -> Row {
        return {group.size(), check.images[group.front()].name};
      });
}

}  // namespace

std::string PoseFaultWords(const CheckedImage& image) {
  switch (image.fault) {
    case PoseFault::kPosition:
      return "position: moved by " + FormatNumber(image.moved_by, 3);
    case PoseFault::kRotation:
      if (2 * image.num_agreeing_turned >= image.num_matches) {
        return "rotation: turned by " + FormatNumber(image.turned_by_deg, 2) +
               " degrees";
      }
      return "rotation, and perhaps position";
    case PoseFault::kUnclear:
      return "position or rotation";
    case PoseFault::kNone:
      break;
  }
  return "";
}

std::string PairSentence(const PairCheck& check) {
  const int64_t num_checked =
      check.num_kept + check.num_contradictory + check.num_undecided;
  if (num_checked == 0) {
    return "The matches say nothing of the poses: no pair of images that have "
           "poses has 15 of them.";
  }
  const std::string pairs =
      std::to_string(num_checked) + " pairs of images contradict";
  const std::string tolerance =
      " (tolerance " + Pixels(check.tolerance_px, 2) + ")";
  const auto num_images =
      static_cast<int64_t>(WronglyPosedImages(check).size());
  if (check.num_contradictory == 0) {
    return "By the matches none of " + std::to_string(num_checked) +
           " pairs of images contradicts the poses" + tolerance +
           TextIf(num_images > 0,
                  ", but " +
                      Counted(num_images, "image", "is wrong and fits",
                              "are wrong and fit") +
                      " the matches better moved or turned") +
           ".";
  }
  const auto num_pairs =
      static_cast<int64_t>(WronglyMatchedPairs(check).size());
  const auto num_groups = static_cast<int64_t>(check.groups.size());
  return "By the matches " + std::to_string(check.num_contradictory) + " of " +
         pairs + " the poses" + tolerance + ": " +
         (num_images > 0 ? Counted(num_images, "image", "is", "are")
                         : "no image is") +
         " wrong" +
         TextIf(num_pairs > 0, ", and no image is to blame for " +
                                   Counted(num_pairs, "pair") +
                                   ", whose matches are wrong, or a lens is") +
         TextIf(num_groups > 0,
                "; " + std::to_string(num_groups) +
                    " groups of images agree inside and contradict each "
                    "other") +
         ".";
}

std::string PairTable(const PairCheck& check, int max_rows) {
  const auto num_rows = static_cast<size_t>(max_rows);
  std::string text = PairSentence(check) + "\n";
  if (check.runner_up) {
    std::vector<std::string> names;
    for (const int32_t i : check.runner_up->images) {
      names.push_back(check.images[i].name);
    }
    text += "The matches cannot tell this from another explanation: " +
            (names.empty() ? "no image is wrong"
                           : "wrong images are " + ListText(names)) +
            ", and all other matches that contradict are wrong.\n";
  }
  text +=
      "What matches do not show: equal structures whose wrong matches agree "
      "with the poses, motion\nalong an image's epipolar lines, and changes "
      "within the noise.\n";
  return text + GroupTable(check, num_rows) + WrongImageTable(check, num_rows) +
         WrongPairTable(check, num_rows);
}

namespace {

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

Json NamesJson(const std::vector<int32_t>& images, const PairCheck& check) {
  return ListJson(images, [&](int32_t i) { return check.images[i].name; });
}

Json ExplanationJson(const Explanation& explanation, const PairCheck& check) {
  return {{"images", NamesJson(explanation.images, check)},
          {"cost_matches", explanation.cost}};
}

Json CheckedImageJson(const CheckedImage& image) {
  Json json = {{"image_id", image.image_id},
               {"image_name", image.name},
               {"num_kept_pairs", image.num_kept},
               {"num_contradictory_pairs", image.num_contradictory},
               {"num_undecided_pairs", image.num_undecided}};
  json.update(
      KROT_JSON_OF(image, kept_matches, contradictory_matches, is_wrong));
  json["fault"] = image.is_wrong ? Json(PoseFaultName(image.fault)) : Json();
  json.update(KROT_JSON_OF(image, num_matches, num_agreeing_moved,
                           num_agreeing_turned, moved_by, turned_by_deg,
                           is_rotation_proved_wrong));
  return json;
}

Json CheckedPairJson(const CheckedPair& pair, const PairCheck& check) {
  Json json = {{"image1", check.images[pair.image1].name},
               {"image2", check.images[pair.image2].name},
               {"state", PairStateName(pair.state)}};
  json.update(KROT_JSON_OF(pair, num_matches, num_agreeing, median_error_px));
  json.update(KnownIf(pair.state == PairState::kContradictory,
                      KROT_JSON_OF(pair, num_explained, most_explained)));
  json["has_wrong_matches"] = pair.has_wrong_matches;
  return json;
}

}  // namespace

Json PairJson(const PairCheck& check) {
  const auto explanation = [&](const Explanation& of) {
    return ExplanationJson(of, check);
  };
  Json json = {{"verdict", PairSentence(check)},
               {"noise_px", check.noise_px},
               {"tolerance_px", check.tolerance_px},
               {"num_kept_pairs", check.num_kept},
               {"num_contradictory_pairs", check.num_contradictory},
               {"num_undecided_pairs", check.num_undecided},
               {"num_not_checked_pairs", check.num_not_checked},
               {"num_without_ray", check.num_without_ray},
               {"cheapest", explanation(check.cheapest)},
               {"runner_up", JsonIf(check.runner_up, explanation)},
               {"is_cheapest_proved", check.is_cheapest_proved}};
  json["groups"] = ListJson(
      check.groups, [&](const auto& group) { return NamesJson(group, check); });
  json["images"] = ListJson(check.images, CheckedImageJson);
  json["pairs"] = ListJson(check.pairs, [&](const CheckedPair& pair) {
    return CheckedPairJson(pair, check);
  });
  return json;
}

namespace {

// The longer side of images on the report page, pixels.
constexpr int kPairViewSide = 480;

class PairView {
 public:
  PairView(const Model& model, const Database& database, const PairCheck& check)
      : model_(model),
        database_(database),
        check_(check),
        rays_(model, database) {
    for (const ImageGeometry& geometry : rays_.geometries) {
      const Camera& camera = model.cameras[geometry.camera];
      scales_.push_back(kPairViewSide / static_cast<double>(std::max<uint64_t>(
                                            {1, camera.width, camera.height})));
    }
  }

  Json Run() const {
    Json images = Json::array();
    for (size_t i = 0; i < scales_.size(); ++i) {
      const Camera& camera = model_.cameras[rays_.geometries[i].camera];
      const auto side = [&](uint64_t pixels) {
        return std::max(1L,
                        std::lround(scales_[i] * static_cast<double>(pixels)));
      };
      images.push_back({{"width", side(camera.width)},
                        {"height", side(camera.height)},
                        {"jpeg", nullptr}});
    }
    Json pairs = Json::array();
    for (size_t p = 0; p < check_.pairs.size(); ++p) {
      pairs.push_back(MatchesOf(database_.pairs[p], check_.pairs[p]));
    }
    return {{"images", images}, {"matches", pairs}};
  }

 private:
  bool Agrees(const VerifiedPair& pair, const std::array<uint32_t, 2>& match,
              const Eigen::Vector3d& baseline) const {
    const auto condition = rays_.ConditionOf(pair, match);
    return condition && condition->ErrorPx(baseline) <= check_.tolerance_px;
  }

  Json MatchesOf(const VerifiedPair& pair, const CheckedPair& checked) const {
    const size_t most = checked.state == PairState::kKept ? 30 : 100;
    const size_t shown = std::min(most, pair.matches.size());
    const bool is_checked = checked.state != PairState::kNotChecked;
    const Eigen::Vector3d baseline =
        is_checked ? Center(rays_.geometries[pair.image2].cam_from_world) -
                         Center(rays_.geometries[pair.image1].cam_from_world)
                   : Eigen::Vector3d(Eigen::Vector3d::Zero());
    Json matches = Json::array();
    for (size_t n = 0; n < shown; ++n) {
      const auto& match = pair.matches[n * pair.matches.size() / shown];
      Json entry = Json::array();
      for (const int side : {0, 1}) {
        const int32_t image = side == 0 ? pair.image1 : pair.image2;
        const Eigen::Vector2d& pixel = database_.keypoints[image][match[side]];
        entry.push_back(std::lround(scales_[image] * pixel.x()));
        entry.push_back(std::lround(scales_[image] * pixel.y()));
      }
      entry.push_back(is_checked && Agrees(pair, match, baseline) ? 1 : 0);
      matches.push_back(entry);
    }
    return matches;
  }

  const Model& model_;
  const Database& database_;
  const PairCheck& check_;
  const MatchRays rays_;
  std::vector<double> scales_;  // pixels on the page per pixel of the image
};

}  // namespace

Json PairViewJson(const Model& model, const Database& database,
                  const PairCheck& check) {
  return PairView(model, database, check).Run();
}

namespace {

double MeanTrackLength(const TrackReport& report) {
  return report.num_points == 0 ? 0
                                : static_cast<double>(report.num_observations) /
                                      static_cast<double>(report.num_points);
}

}  // namespace

std::string TrackSentence(const TrackReport& report) {
  return Thousands(report.num_points) + " points with " +
         Thousands(report.num_observations) + " observations: tracks of " +
         FormatNumber(MeanTrackLength(report), 2) +
         " images, root mean square error " +
         Pixels(report.pixel_error.rms, 3) + ".";
}

std::string TrackTable(const TrackReport& report) {
  const MatchTracksSummary& summary = report.summary;
  std::string text = TrackSentence(report) + "\n\n";
  TextTable table;
  const auto add = [&](const char* what, int64_t count) {
    table.AddRow({what, Thousands(count)});
  };
  add("pairs of images whose matches are used", summary.num_pairs);
  add("their matches", summary.num_matches);
  add("of these, that contradict the poses", summary.num_disagreeing);
  add("tracks that the others join", summary.num_components);
  add("of these, with an image twice", summary.num_image_twice);
  add("divided, as no point fits all", summary.num_in_conflict);
  add("left out, as they are a single match", summary.num_two_views);
  add("left out, as their rays are too narrow", summary.num_narrow);
  text += table.ToString();
  if (summary.num_contradictory_pairs > 0) {
    text += "\nThe matches of " +
            Counted(summary.num_contradictory_pairs, "other pair") +
            " contradict the poses and are not used; krot model_checker "
            "--database_path\nsays whether images are wrong or matches.\n";
  }
  return text + "\n" +
         RunSentence(report.run,
                     "triangulated " + Seconds(report.seconds_triangulate));
}

Json MatchesJson(const MatchTracksSummary& summary) {
  Json json =
      KROT_JSON_OF(summary, num_pairs, num_contradictory_pairs, num_matches);
  json["num_disagreeing_matches"] = summary.num_disagreeing;
  json.update(KROT_JSON_OF(summary, num_components, num_image_twice,
                           num_in_conflict, num_two_views, num_narrow));
  return json;
}

std::string MatchesSentence(const MatchTracksSummary& summary) {
  return "The points come from the matches of " +
         Counted(summary.num_pairs, "pair") + " of images" +
         TextIf(summary.num_contradictory_pairs > 0,
                "; those of " +
                    Counted(summary.num_contradictory_pairs, "other pair") +
                    " contradict the positions and are not used") +
         ".\n";
}

std::string TrackJson(const TrackReport& report) {
  Json json = {
      {"version", report.run.version},
      {"command", "point_triangulator"},
      {"verdict", TrackSentence(report)},
      {"num_points", report.num_points},
      {"num_observations", report.num_observations},
      {"mean_track_length", MeanTrackLength(report)},
      {"pixel_error", ErrorJson(report.pixel_error)},
  };
  json.update(MatchesJson(report.summary));
  return ReportText(json, report.run,
                    {{"triangulate", report.seconds_triangulate}});
}

}  // namespace krot::internal
