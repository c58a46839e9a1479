#include "krot/report/pair_report.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "krot/analysis/epipolar.h"
#include "krot/base/numbers.h"
#include "krot/model/rigs.h"
#include "krot/report/text_table.h"

namespace krot::internal {
namespace {

std::string PercentOf(int64_t part, int64_t of) {
  return of == 0 ? "-"
                 : FormatNumber(100.0 * static_cast<double>(part) /
                                    static_cast<double>(of),
                                0) +
                       " %";
}

std::vector<size_t> WronglyPosedImages(const PairCheck& check) {
  std::vector<size_t> wrong;
  for (size_t i = 0; i < check.images.size(); ++i) {
    if (check.images[i].is_wrong) wrong.push_back(i);
  }
  return wrong;
}

// Pairs with wrong matches, those with the most matches first.
std::vector<const CheckedPair*> WronglyMatchedPairs(const PairCheck& check) {
  std::vector<const CheckedPair*> wrong;
  for (const CheckedPair& pair : check.pairs) {
    if (pair.has_wrong_matches) wrong.push_back(&pair);
  }
  SortLargestFirst(&wrong, &CheckedPair::num_matches);
  return wrong;
}

std::string WrongImageTable(const PairCheck& check, size_t max_rows) {
  const std::vector<size_t> wrong = WronglyPosedImages(check);
  if (wrong.empty() || max_rows == 0) return "";
  TextTable table;
  table.AddRow({"image", "pairs kept", "contradictory",
                "what is wrong, to fit best", "matches that fit if moved",
                "if turned"});
  for (size_t n = 0; n < std::min(wrong.size(), max_rows); ++n) {
    const CheckedImage& image = check.images[wrong[n]];
    table.AddRow({image.name, std::to_string(image.num_kept),
                  std::to_string(image.num_contradictory),
                  PoseFaultWords(image),
                  PercentOf(image.num_agreeing_moved, image.num_matches),
                  PercentOf(image.num_agreeing_turned, image.num_matches)});
  }
  return "\nImages whose poses the matches contradict\n" + table.ToString();
}

std::string WrongPairTable(const PairCheck& check, size_t max_rows) {
  const std::vector<const CheckedPair*> wrong = WronglyMatchedPairs(check);
  if (wrong.empty() || max_rows == 0) return "";
  TextTable table;
  table.AddRow({"image", "and image", "matches", "agree with the poses"});
  for (size_t n = 0; n < std::min(wrong.size(), max_rows); ++n) {
    table.AddRow({check.images[wrong[n]->image1].name,
                  check.images[wrong[n]->image2].name,
                  std::to_string(wrong[n]->num_matches),
                  std::to_string(wrong[n]->num_agreeing)});
  }
  return "\nContradictory pairs of images that are not wrong: " +
         std::to_string(wrong.size()) + "\n" + table.ToString();
}

std::string GroupTable(const PairCheck& check, size_t max_rows) {
  if (check.groups.empty() || max_rows == 0) return "";
  TextTable table;
  table.AddRow({"images", "such as"});
  for (size_t n = 0; n < std::min(check.groups.size(), max_rows); ++n) {
    table.AddRow({std::to_string(check.groups[n].size()),
                  check.images[check.groups[n].front()].name});
  }
  return "\nGroups of images that agree inside and contradict each other\n" +
         table.ToString();
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
      " (tolerance " + FormatNumber(check.tolerance_px, 2) + " px)";
  const auto num_images =
      static_cast<int64_t>(WronglyPosedImages(check).size());
  if (check.num_contradictory == 0) {
    std::string sentence = "By the matches none of " +
                           std::to_string(num_checked) +
                           " pairs of images contradicts the poses" + tolerance;
    if (num_images > 0) {
      sentence +=
          ", but " + Counted(num_images, "image") +
          (num_images == 1 ? " is wrong and fits" : " are wrong and fit") +
          " the matches better moved or turned";
    }
    return sentence + ".";
  }
  const auto num_pairs =
      static_cast<int64_t>(WronglyMatchedPairs(check).size());
  const auto num_groups = static_cast<int64_t>(check.groups.size());
  std::string sentence = "By the matches " +
                         std::to_string(check.num_contradictory) + " of " +
                         pairs + " the poses" + tolerance + ": ";
  if (num_images > 0) {
    sentence += Counted(num_images, "image") +
                (num_images == 1 ? " is wrong" : " are wrong");
  } else {
    sentence += "no image is wrong";
  }
  if (num_pairs > 0) {
    sentence += ", and no image is to blame for " + Counted(num_pairs, "pair") +
                ", whose matches are wrong, or a lens is";
  }
  if (num_groups > 0) {
    sentence += "; " + std::to_string(num_groups) +
                " groups of images agree inside and contradict each other";
  }
  return sentence + ".";
}

std::string PairTable(const PairCheck& check, int max_rows) {
  const auto num_rows = static_cast<size_t>(max_rows);
  std::string text = PairSentence(check) + "\n";
  if (check.runner_up) {
    std::string names;
    for (const int32_t i : check.runner_up->images) {
      names += (names.empty() ? "" : ", ") + check.images[i].name;
    }
    text += "The matches cannot tell this from another explanation: " +
            (names.empty() ? "no image is wrong, their matches are"
                           : "wrong images are " + names) +
            ".\n";
  }
  text +=
      "What matches do not show: equal structures whose wrong matches agree "
      "with the poses, motion\nalong an image's epipolar lines, and changes "
      "within the noise.\n";
  return text + GroupTable(check, num_rows) + WrongImageTable(check, num_rows) +
         WrongPairTable(check, num_rows);
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
        geometries_(ImageGeometries(model)) {
    for (const ImageGeometry& geometry : geometries_) {
      const Camera& camera = model.cameras[geometry.camera];
      scales_.push_back(kPairViewSide / static_cast<double>(std::max<uint64_t>(
                                            {1, camera.width, camera.height})));
    }
  }

  Json Run() const {
    Json images = Json::array();
    for (size_t i = 0; i < model_.images.size(); ++i) {
      const Camera& camera = model_.cameras[geometries_[i].camera];
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
    std::vector<PixelRay> rays;
    for (const int side : {0, 1}) {
      const int32_t image = side == 0 ? pair.image1 : pair.image2;
      const auto ray = RayOf(model_.cameras[geometries_[image].camera],
                             database_.keypoints[image][match[side]]);
      if (!ray) return false;
      const Eigen::Matrix3d world_from_cam =
          geometries_[image].cam_from_world.rotation.transpose();
      rays.push_back(world_from_cam * *ray);
    }
    return EpipolarMatch(rays[0], rays[1]).ErrorPx(baseline) <=
           check_.tolerance_px;
  }

  Json MatchesOf(const VerifiedPair& pair, const CheckedPair& checked) const {
    const size_t most = checked.state == PairState::kKept ? 30 : 100;
    const size_t shown = std::min(most, pair.matches.size());
    const bool is_checked = checked.state != PairState::kNotChecked;
    const Eigen::Vector3d baseline =
        is_checked ? Center(geometries_[pair.image2].cam_from_world) -
                         Center(geometries_[pair.image1].cam_from_world)
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
  const std::vector<ImageGeometry> geometries_;
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
         FormatNumber(report.pixel_error.rms, 3) + " px.";
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
                     "triangulated " +
                         FormatNumber(report.seconds_triangulate, 2) + " s");
}

Json MatchesJson(const MatchTracksSummary& summary) {
  return {{"num_pairs", summary.num_pairs},
          {"num_contradictory_pairs", summary.num_contradictory_pairs},
          {"num_matches", summary.num_matches},
          {"num_disagreeing_matches", summary.num_disagreeing},
          {"num_components", summary.num_components},
          {"num_image_twice", summary.num_image_twice},
          {"num_in_conflict", summary.num_in_conflict},
          {"num_two_views", summary.num_two_views},
          {"num_narrow", summary.num_narrow}};
}

std::string MatchesSentence(const MatchTracksSummary& summary) {
  return "The points come from the matches of " +
         Counted(summary.num_pairs, "pair") + " of images" +
         (summary.num_contradictory_pairs > 0
              ? "; those of " +
                    Counted(summary.num_contradictory_pairs, "other pair") +
                    " contradict the positions and are not used"
              : std::string()) +
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
