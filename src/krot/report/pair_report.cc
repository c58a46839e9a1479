#include "krot/report/pair_report.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "krot/analysis/epipolar.h"
#include "krot/model/rigs.h"
#include "krot/report/text_table.h"

namespace krot::internal {
namespace {

const char* PairStateName(PairState state) {
  switch (state) {
    case PairState::kKept:
      return "kept";
    case PairState::kContradictory:
      return "contradictory";
    case PairState::kUndecided:
      return "undecided";
    case PairState::kNotChecked:
      break;
  }
  return "not checked";
}

const char* PoseFaultName(PoseFault fault) {
  switch (fault) {
    case PoseFault::kPosition:
      return "position";
    case PoseFault::kRotation:
      return "rotation";
    case PoseFault::kUnclear:
      return "unclear";
    case PoseFault::kNone:
      break;
  }
  return "none";
}

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
  std::stable_sort(wrong.begin(), wrong.end(),
                   [](const CheckedPair* a, const CheckedPair* b) {
                     return a->num_matches > b->num_matches;
                   });
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

Json ExplanationJson(const Explanation& explanation, const PairCheck& check) {
  Json images = Json::array();
  for (const int32_t i : explanation.images) {
    images.push_back(check.images[i].name);
  }
  return {{"images", images}, {"cost_matches", explanation.cost}};
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

Json PairJson(const PairCheck& check) {
  Json images = Json::array();
  for (const CheckedImage& image : check.images) {
    images.push_back(
        {{"image_id", image.image_id},
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
         {"is_rotation_proved_wrong", image.is_rotation_proved_wrong}});
  }
  Json pairs = Json::array();
  for (const CheckedPair& pair : check.pairs) {
    const bool is_contradictory = pair.state == PairState::kContradictory;
    pairs.push_back({{"image1", check.images[pair.image1].name},
                     {"image2", check.images[pair.image2].name},
                     {"state", PairStateName(pair.state)},
                     {"num_matches", pair.num_matches},
                     {"num_agreeing", pair.num_agreeing},
                     {"median_error_px", std::isfinite(pair.median_error_px)
                                             ? Json(pair.median_error_px)
                                             : Json()},
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

namespace {

// How many matches are shown of a kept pair, and of any other.
constexpr size_t kMatchesOfKept = 30;
constexpr size_t kMatchesOfOthers = 100;

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
    const size_t most =
        checked.state == PairState::kKept ? kMatchesOfKept : kMatchesOfOthers;
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

}  // namespace krot::internal
