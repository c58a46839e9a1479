#include "krot/report/reports.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <vector>

#include "krot/base/numbers.h"
#include "krot/report/text_table.h"

namespace krot::internal {
namespace {

std::string NoiseWords(const ModelCheck& check) {
  if (!check.sigma_px) return "noise";
  return "noise of " + Pixels(*check.sigma_px, 3) + " per axis" +
         TextIf(check.median_scale_px.has_value(),
                " at the median keypoint scale");
}

// The images with this verdict: wrong ones by the number of their wrong
// observations, weakly held ones by how weakly they are held.
std::vector<const ImageCheck*> ImagesOf(const ModelCheck& check,
                                        ImageVerdict verdict) {
  auto images = PointersIf(check.images, [&](const ImageCheck& image) {
    return image.verdict == verdict;
  });
  if (verdict == ImageVerdict::kWeaklyHeld) {
    SortLargestFirst(&images, &ImageCheck::relative_center_sigma);
  } else {
    SortLargestFirst(&images, &ImageCheck::num_wrong);
  }
  return images;
}

std::string ImageTable(const ModelCheck& check, ImageVerdict verdict,
                       size_t max_rows) {
  const std::vector<const ImageCheck*> images = ImagesOf(check, verdict);
  if (images.empty()) return "";
  const bool is_wrong = verdict == ImageVerdict::kWrong;
  Row head = {"image", "observations", "checked", "more than noise"};
  for (const char* more :
       is_wrong ? std::vector<const char*>{"why"}
                : std::vector<const char*>{"centre +-", "median image's x",
                                           "turn +-, degrees"}) {
    head.push_back(more);
  }
  const auto row = [&](const ImageCheck* image) {
    Row cells = {image->name, image->num_observations, image->num_tested,
                 image->num_wrong};
    if (is_wrong) {
      cells.push_back(ReasonOf(check, *image));
    } else {
      cells.push_back(SigmaText(image->center_sigma));
      cells.push_back(FormatNumber(image->relative_center_sigma, 1));
      cells.push_back(SigmaText(image->turn_sigma_deg));
    }
    return cells;
  };
  const std::string title =
      is_wrong
          ? "Wrong images"
          : "Weakly held images: what holds them lets their centres move more "
            "than ten times as far\nas the median image's (standard deviation, "
            "scene units)";
  return "\n" + title +
         TextIf(images.size() > max_rows, "; " + std::to_string(max_rows) +
                                              " of " +
                                              Thousands(images.size())) +
         "\n" + TableOf(head, images, row, max_rows);
}

// COLMAP writes into folders that are there.
std::string Folder(const std::string& name) {
  return "    mkdir -p " + name + "\n";
}

std::string RobustAdjustment(const CheckReport& report, const std::string& in,
                             const std::string& more = "") {
  const std::string words = " --input_path " + in + " --output_path ADJUSTED ";
  return (report.has_panorama
              ? "    krot outlier_filter" + words +
                    "--Solver.finish_loss cauchy --Solver.finish_loss_scale "
              : "    krot bundle_adjuster" + words +
                    "--BundleAdjustmentCeres.loss_function_type CAUCHY "
                    "--BundleAdjustmentCeres.loss_function_scale ") +
         FormatLength(report.check.cauchy_scale_px.value_or(1)) + more + "\n";
}

// Suggests what to do next, in commands of COLMAP and KROT.
std::string NextSteps(const CheckReport& report) {
  const ModelCheck& check = report.check;
  const int64_t num_wrong = check.NumImages(ImageVerdict::kWrong);
  const int64_t num_weak = check.NumImages(ImageVerdict::kWeaklyHeld);
  if (!check.IsAnythingWrong() && num_weak == 0 && check.parts.empty() &&
      check.is_adjusted) {
    return "";
  }
  const auto or_name = [](const std::string& path, const char* name) {
    return path.empty() ? std::string(name) : path;
  };
  const std::string input = or_name(report.input_path, "MODEL");
  const std::string cured = or_name(report.output_path, "CURED");
  const std::string database = or_name(report.database_path, "DATABASE");
  const std::string images = or_name(report.image_path, "IMAGES");
  const std::string head = "\nNext\n";
  std::string text = head;
  const bool is_converted = check.conventions.has_value();
  if (report.output_path.empty() &&
      (is_converted || (check.is_adjusted && check.fits &&
                        !check.ErrorsAgree() && check.IsAnythingWrong()))) {
    text +=
        (is_converted ? "  The model put right, without what is wrong:\n"
                      : "  The model without what is wrong:\n") +
        ("    krot model_checker --input_path " + input) +
        (report.database_path.empty() ? "" : " --database_path " + database) +
        " --output_path " + cured + "\n";
  }
  if (!check.still_points.empty()) return text + MaskSteps(images);
  if (NeedsOtherCameras(check) || check.ErrorsAgree()) {
    return text + OtherCameraSteps(check, input, images);
  }
  if (!check.is_adjusted) {
    const auto off_center =
        PointersIf(check.cameras, [](const WrongCamera& camera) {
          return camera.fault == CameraFault::kPrincipalPoint;
        });
    return text +
           "  Adjust the model with a loss that wrong observations do not bend "
           "(colmap bundle_adjuster of\n  COLMAP 4 has these options, too), "
           "and check it again:\n" +
           RobustAdjustment(
               report, is_converted ? cured : input,
               TextIf(!off_center.empty(),
                      " --BundleAdjustment.refine_principal_point 1")) +
           "    krot model_checker --input_path ADJUSTED\n";
  }
  if (!check.fits) {
    return text +
           "  Make the tracks anew from the matches:\n    krot "
           "point_triangulator --database_path " +
           database + " --input_path " + input +
           " --output_path TRIANGULATED\n    krot model_checker --input_path "
           "TRIANGULATED\n";
  }
  std::string model = check.IsAnythingWrong() ? cured : input;
  if (!report.moved.empty()) {
    text += "  In it " +
            Counted(report.moved.size(), "wrong image", "has", "have") +
            " a new position, where the matches fit.\n";
  }
  if (num_wrong > static_cast<int64_t>(report.moved.size())) {
    text += "  Place the " + std::string(report.moved.empty() ? "" : "other ") +
            "wrong images anew, from their matches:\n" + Folder("REGISTERED") +
            "    colmap image_registrator --database_path " + database +
            " --input_path " + model + " --output_path REGISTERED\n";
    model = "REGISTERED";
    if (report.database_path.empty()) {
      text +=
          "  Or, without a database, adjust the input with a loss that wrong "
          "observations do not bend:\n" +
          RobustAdjustment(report, input);
    }
  }
  if (std::any_of(check.images.begin(), check.images.end(),
                  [](const ImageCheck& image) {
                    return image.fault == ImageFault::kLens;
                  })) {
    text +=
        "  Where one camera took all photos, give COLMAP one, so that its "
        "focal length is fitted to\n  all of them, in a new database; then "
        "match and map anew:\n    colmap feature_extractor "
        "--ImageReader.single_camera 1 --database_path NEW_DATABASE "
        "--image_path " +
        images + "\n";
  }
  if (num_weak > 0 || !check.parts.empty()) {
    text += "  More matches" +
            std::string(num_weak > 0 ? " for the weakly held images" : "") +
            (num_weak > 0 && !check.parts.empty() ? " and" : "") +
            (check.parts.empty() ? "" : " between the parts") +
            ", and their points. COLMAP matches no pair twice, so a copy of "
            "the\n  database loses its matches first (from COLMAP 3.13 on\n  "
            "--FeatureMatching.guided_matching 1):\n    cp " +
            database +
            " MATCHED_DATABASE\n    colmap database_cleaner --type " +
            "matches --database_path MATCHED_DATABASE\n    colmap " +
            "exhaustive_matcher --database_path MATCHED_DATABASE " +
            "--SiftMatching.guided_matching 1\n" + Folder("TRIANGULATED") +
            "    colmap point_triangulator " +
            "--database_path MATCHED_DATABASE --image_path " + images +
            " --input_path " + model + " --output_path TRIANGULATED\n";
    model = "TRIANGULATED";
  }
  text += text == head ? "  Adjust all that is left"
                       : "  Then adjust all that is left";
  if (!check.cauchy_scale_px) {
    return text + ":\n" + Folder("ADJUSTED") +
           "    colmap bundle_adjuster --input_path " + model +
           " --output_path ADJUSTED\n";
  }
  return text +
         ", with the loss that suits errors with such tails\n  (colmap "
         "bundle_adjuster of COLMAP 4 has these options, "
         "too):\n" +
         RobustAdjustment(report, model);
}

// What contradicts by more than noise; empty if nothing does.
std::string WhatContradicts(const CheckReport& report) {
  const ModelCheck& check = report.check;
  const auto num_observations = static_cast<int64_t>(check.observations.size());
  const int64_t num_wrong = check.NumImages(ImageVerdict::kWrong);
  const int64_t num_by_matches = std::count_if(
      check.images.begin(), check.images.end(), [](const ImageCheck& image) {
        return image.fault == ImageFault::kMatches;
      });
  const std::string by_more =
      " by more than " + NoiseWords(check) + " explains";
  const auto first_wrong = std::find_if(
      check.images.begin(), check.images.end(), [](const ImageCheck& image) {
        return image.verdict == ImageVerdict::kWrong;
      });
  const std::string images =
      Thousands(num_wrong) + " of " + Counted(check.images.size(), "image") +
      (num_wrong == 1 ? " (" + first_wrong->name + ")" : "");
  const std::string observations = Thousands(num_observations) + " of " +
                                   Thousands(report.num_observations) +
                                   " observations";
  const auto are = [](int64_t count) { return count == 1 ? " is " : " are "; };
  if (num_by_matches > 0) {
    const bool is_more = num_wrong > num_by_matches || num_observations > 0;
    return images + TextIf(num_observations > 0, " and " + observations) +
           are(num_wrong + num_observations) +
           "wrong: verified matches contradict " +
           Counted(num_by_matches, "image") +
           TextIf(is_more, ", the rest contradicts the others" + by_more);
  }
  if (num_wrong > 0 && num_observations > 0) {
    return images + " and " + observations +
           " are wrong: they contradict the others" + by_more;
  }
  if (num_wrong > 0) {
    return images + are(num_wrong) + "wrong: the others contradict " +
           (num_wrong == 1 ? "it" : "them") + by_more;
  }
  if (num_observations > 0) {
    return observations + are(num_observations) + "wrong, and no image is: " +
           (num_observations == 1 ? "it contradicts" : "they contradict") +
           " the others" + by_more;
  }
  return "";
}

int64_t NumJudged(const ModelCheck& check) {
  return static_cast<int64_t>(check.images.size()) -
         check.NumImages(ImageVerdict::kNotJudged);
}

std::string NothingIsWrong(const CheckReport& report) {
  const ModelCheck& check = report.check;
  if (!check.sigma_px) {
    return check.pairs ? "No image is wrong by the matches, and no observation "
                         "is checked by another one"
                       : "Nothing can be said: no observation is checked by "
                         "another one";
  }
  const int64_t num_weak = check.NumImages(ImageVerdict::kWeaklyHeld);
  return "Nothing is wrong: all " + Thousands(report.num_observations) +
         " observations of " + Counted(NumJudged(check), "image") +
         " agree within " + NoiseWords(check) +
         TextIf(num_weak > 0, "; " + Counted(num_weak, "image", "is", "are") +
                                  " weakly held");
}

// None of these sentences begins with a name.
std::string AfterColon(std::string sentence) {
  sentence[0] =
      static_cast<char>(std::tolower(static_cast<unsigned char>(sentence[0])));
  return sentence;
}

std::string ForAdjusted(const CheckReport& report) {
  const ModelCheck& check = report.check;
  std::string text = WhatContradicts(report);
  const auto add = [&](const std::string& fault) {
    text += (text.empty() ? "" : "; and ") + fault;
  };
  if (!check.misplaced_points.empty()) {
    add(Thousands(check.misplaced_points.size()) + " of " +
        Thousands(check.points.size()) +
        " 3D points lie far from where the images see them");
  }
  if (check.ErrorsAgree()) {
    add((text.empty() ? "Errors" : "errors") +
        std::string(" of neighbouring 2D points agree, and ") +
        FormatNumber(100 * check.error_correlation, 0) +
        " % of the squared errors is no noise: photos that were cropped, "
        "stretched or zoomed, a lens that no parameter describes, or what "
        "moved bend the model");
  }
  if (check.pairs && !check.pairs->groups.empty()) {
    add((text.empty() ? "The" : "the") + std::string(" images fall into ") +
        Counted(check.pairs->groups.size(), "group") +
        " that contradict each other by their verified matches: the place of "
        "a whole group is wrong, or those matches are");
  }
  if (text.empty()) text = NothingIsWrong(report);
  const int64_t num_weak = check.NumImages(ImageVerdict::kWeaklyHeld);
  if (num_weak > 0 && check.IsAnythingWrong()) {
    text += "; " + Counted(num_weak, "image", "is", "are") + " weakly held";
  }
  // Parts may be elsewhere as a whole, whatever else is wrong.
  if (!check.parts.empty()) {
    text += (check.IsAnythingWrong() ? "; and " : "; but ") +
            Counted(check.parts.size(), "part", "is", "are") + " loose";
  }
  if (!report.discarded.empty()) {
    text += (check.IsAnythingWrong() ? "; and " : "; but ") +
            Counted(report.discarded.size(), "camera", "has", "have") +
            " a focal length that COLMAP's mapper would discard";
  }
  const int64_t num_bare = check.NumImages(ImageVerdict::kNotJudged);
  if (num_bare > 0) {
    text += "; " + Counted(num_bare, "image", "is", "are") + " not judged";
  }
  return text + ".";
}

std::string ConvertedSentence(const CheckReport& report) {
  const ModelCheck& check = report.check;
  const bool is_camera = !check.cameras.empty();
  if (!check.still_points.empty()) return StillPointsSentence(check);
  if (!check.fits && !is_camera) {
    return (check.is_adjusted
                ? "The observations do not fit the model: errors are "
                : "The model is not adjusted, so adjust it first: errors "
                  "are ") +
           Pixels(*check.sigma_px, 1) +
           " per axis. Unless an adjustment helps, its cameras, 2D points or "
           "tracks are not those of these images.";
  }
  if (check.is_adjusted) return ForAdjusted(report);
  if (WhatContradicts(report).empty() &&
      !(check.pairs && check.pairs->IsAnythingWrong())) {
    return is_camera ? CamerasSentence(check)
                     : "The model is not adjusted, so nothing can be said yet: "
                       "adjust it, and check it again.";
  }
  return (is_camera ? CamerasSentence(check)
                    : "The model is not adjusted, so adjust it first.") +
         " As it stands: " + AfterColon(ForAdjusted(report));
}

}  // namespace

std::string CheckSentence(const CheckReport& report) {
  const auto& conventions = report.check.conventions;
  const std::string sentence = ConvertedSentence(report);
  if (!conventions) return sentence;
  return ConventionsSentence(*conventions) +
         " Once that is put right: " + AfterColon(sentence);
}

std::string CheckTable(const CheckReport& report, int max_rows) {
  const ModelCheck& check = report.check;
  const auto num_rows = static_cast<size_t>(max_rows);
  const int64_t num_bare = check.NumImages(ImageVerdict::kNotJudged);
  std::string text = CheckSentence(report) + "\n";
  text += "Images: " + Thousands(check.NumImages(ImageVerdict::kWrong)) +
          " wrong, " + Thousands(check.NumImages(ImageVerdict::kWeaklyHeld)) +
          " weakly held, " + Thousands(check.NumImages(ImageVerdict::kFine)) +
          " fine" +
          TextIf(num_bare > 0, ", " + Thousands(num_bare) + " not judged") +
          ". Observations that others check: " + Thousands(check.num_tested) +
          ".\n";
  text +=
      RaisedMaxSentence(report.pixel_error_before, report.pixel_error_after) +
      DiscardedSentence(report.discarded) + NotJudgedSentence(check) +
      SamePhotosSentence(check);
  if (!check.parts.empty()) text += PartsSentence(check) + "\n";
  if (!check.is_adjusted && check.cameras.empty()) {
    text +=
        "Not adjusted: most images do not stand where their own errors would "
        "have them. That alone\nmakes observations and images look wrong.\n";
  }
  if (check.pairs) text += PairTable(*check.pairs, max_rows);
  return text + CameraTable(check, num_rows) +
         ImageTable(check, ImageVerdict::kWrong, num_rows) +
         ImageTable(check, ImageVerdict::kWeaklyHeld, num_rows) +
         PartTable(check, num_rows) + ObservationTable(check, num_rows) +
         TrackTable(check, num_rows) + NextSteps(report) + "\n" +
         RunSentence(report.run, "checked " + Seconds(report.seconds_check));
}

}  // namespace krot::internal
