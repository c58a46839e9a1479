#include "krot/report/sentences.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "krot/base/parallel_for.h"
#include "krot/base/system.h"
#include "krot/context.h"
#include "krot/report/text_table.h"
#include "krot/version.h"

namespace krot::internal {
namespace {

// The first five of the items.
template <typename Item, typename Name>
std::string FirstFew(const std::vector<Item>& items, const Name& name) {
  std::vector<std::string> names;
  for (const Item& item : items) names.push_back(name(item));
  return ListText(std::move(names), 5);
}

std::string NameOf(const LooseImage& image) {
  return image.image_name + " (" +
         Counted(image.num_observations, "observation") +
         TextIf(std::isfinite(image.moved),
                ", moved by " + FormatLength(image.moved) + " units") +
         ")";
}

std::string LooseImagesSentence(const std::vector<LooseImage>& images) {
  if (images.empty()) return "";
  const std::string their = images.size() == 1 ? "its" : "their";
  return Counted(images.size(), "image", "is", "are") +
         " not held in place: " + their +
         " observations fit as well from farther away. Check " + their +
         " matches. Moved no farther than needed: " +
         FirstFew(images, &NameOf) + ".\n";
}

std::string RunawaysSentence(const std::vector<LooseImage>& images) {
  if (images.empty()) return "";
  return Counted(images.size(), "image") +
         " moved farther than cameras are from one another or from what they "
         "see: " +
         FirstFew(images, &NameOf) + ".\n";
}

std::string LoosePointsSentence(const std::vector<LoosePoint>& points) {
  if (points.empty()) return "";
  double farthest = 0;
  for (const LoosePoint& point : points) {
    farthest = std::max(farthest, point.moved);
  }
  return Counted(points.size(), "point", "is", "are") +
         " not determined: the rays are parallel up to noise, and any distance "
         "fits. Moved by at most " +
         FormatLength(farthest) + " units: point3D_id " +
         FirstFew(points,
                  [](const LoosePoint& point) {
                    return std::to_string(point.point3D_id);
                  }) +
         ".\n";
}

std::string FitWords(const char* whose,
                     const std::optional<Contradictions::Fit>& fit) {
  if (!fit) return std::string(whose) + " side has no observations";
  if (std::isnan(fit->median)) {
    return "all of " + std::string(whose) +
           " observations are of images or 2D points that the model lacks";
  }
  const std::string missing =
      TextIf(fit->num_missing > 0, " (beside " + Thousands(fit->num_missing) +
                                       " of images or 2D points that the "
                                       "model lacks)");
  if (!std::isfinite(fit->median)) {
    return "most of " + std::string(whose) + " observations do not project" +
           missing;
  }
  return std::string(whose) + " observations have a median error of " +
         Pixels(fit->median) +
         TextIf(std::isfinite(fit->max),
                " and a largest of " + Pixels(fit->max)) +
         missing;
}

std::string FollowedWords(const std::string& followed) {
  if (followed == "neither") return "";
  if (followed == "both") {
    return ": every 2D point is taken to see the 3D point that it names or, "
           "where it names none, the first whose track names it "
           "(--Model.on_contradiction)";
  }
  return ": the " + followed + " are followed (--Model.on_contradiction)";
}

}  // namespace

std::string LeftOutWords(const LeftOutCounts& left_out) {
  int64_t total = 0;
  std::vector<std::string> reasons;
  for (const auto& [reason, count] : left_out) {
    total += count;
    if (count > 0) reasons.push_back(reason + " " + std::to_string(count));
  }
  return Counted(total, "observation") + " left out" +
         TextIf(!reasons.empty(), " (" + ListText(reasons) + ")");
}

std::string NothingToDoSentence(const std::string& what,
                                const LeftOutCounts& left_out) {
  bool has_observations = false;
  for (const auto& [reason, count] : left_out) has_observations |= count > 0;
  return "nothing to " + what + ": " +
         (has_observations ? LeftOutWords(left_out) : kNoObservations);
}

std::string LooseSentences(const LooseParts& loose, int64_t num_images) {
  std::vector<LooseImage> undetermined;
  std::vector<LooseImage> runaways;
  for (const LooseImage& image : loose.images) {
    (image.is_determined ? runaways : undetermined).push_back(image);
  }
  const auto num_loose = static_cast<int64_t>(loose.images.size());
  return LooseImagesSentence(undetermined) + RunawaysSentence(runaways) +
         TextIf(num_loose > 0 && num_loose < num_images,
                "The place and the size of the model are those of the other " +
                    Counted(num_images - num_loose, "image") + ".\n") +
         LoosePointsSentence(loose.points);
}

std::string ContradictionSentence(const Contradictions& contradictions) {
  const bool is_measured = contradictions.of_tracks || contradictions.of_images;
  return " contradicts itself: " +
         Counted(contradictions.num_track_elements, "track element") +
         " of 2D points that do not name the 3D point, and " +
         Counted(contradictions.num_points2D, "2D point") +
         " of 3D points whose track does not name the 2D point; " +
         (is_measured
              ? "at the model's own positions " +
                    FitWords("the tracks'", contradictions.of_tracks) + ", " +
                    FitWords("the images'", contradictions.of_images)
              : std::string("it has no positions that would show "
                            "which is right")) +
         FollowedWords(contradictions.followed);
}

void RequireSettled(const std::string& path,
                    const Contradictions& contradictions) {
  if (contradictions.followed != "neither") return;
  throw ModelError(path + ContradictionSentence(contradictions) +
                   ": neither fits; --Model.on_contradiction follow_tracks or "
                   "follow_images reads it all the same");
}

std::string WorseImagesWords(const std::pair<double, double>& max_px) {
  return "by the images' side, which COLMAP's bundle adjustment reads, the "
         "largest error rises from " +
         Pixels(max_px.first) + " to " +
         (std::isfinite(max_px.second) ? Pixels(max_px.second)
                                       : "points that do not project");
}

std::string RaisedMaxSentence(const PixelErrorStatistics& before,
                              const PixelErrorStatistics& after) {
  return TextIf(after.max > before.max,
                "The largest error of what is written, " + Pixels(after.max) +
                    ", is above that of what was read, " + Pixels(before.max) +
                    ": points moved to fit the observations that are left. An "
                    "adjustment or krot solver lowers it.\n");
}

std::string WholeCollapseWords(const Collapse& collapse) {
  const std::string points =
      Counted(collapse.num_points, "point") + " that two cameras see";
  const std::string where =
      collapse.is_in_one_place
          ? "all " + points + " lie in one place"
          : "of " + points + " " + std::to_string(collapse.in_camera.size()) +
                " lie in a camera and " +
                std::to_string(collapse.at_infinity.size()) + " at infinity";
  return "the errors fall only where " + where +
         ", so that nothing is left of the scene";
}

std::string CollapseLines(const Collapse& collapse) {
  std::string text;
  const auto add = [&](const std::vector<Point3DId>& points,
                       const std::string& where) {
    if (points.empty()) return;
    text += Counted(points.size(), "point") + " came to lie " + where + ": " +
            PointList(points) + ".\n";
  };
  add(collapse.in_camera, "in a camera, where any observation of it fits");
  add(collapse.at_infinity, "at infinity, as their rays are parallel");
  return text;
}

std::string PointList(const std::vector<Point3DId>& points) {
  return "point3D_id " +
         FirstFew(points, [](Point3DId id) { return std::to_string(id); });
}

namespace {

// "12.30 degrees in the median and 28.50 at most (img004.jpg)".
std::string TurnWords(double median_deg, double largest_deg,
                      const std::string& image) {
  return FormatNumber(median_deg, 2) + " degrees in the median and " +
         FormatNumber(largest_deg, 2) + " at most" +
         (largest_deg < 0.005 ? "" : " (" + image + ")");
}

std::string ErrorWords(const RotationInput& input) {
  if (!input.median_error_before) return "";
  return "; the median error was " + Pixels(*input.median_error_before, 2) +
         " and is " +
         (input.median_error_after ? Pixels(*input.median_error_after, 2)
                                   : "infinite") +
         " before anything moves";
}

}  // namespace

std::vector<std::string> PoseSentences(const PoseChecks& poses) {
  const std::string of_images = " of " + Counted(poses.num_images, "image");
  std::vector<std::string> sentences;
  if (poses.num_far_quaternions > 0) {
    sentences.push_back(
        "the quaternions of " + std::to_string(poses.num_far_quaternions) +
        of_images + " are far from unit length, " +
        FormatNumber(poses.shortest, 3) + " to " +
        FormatNumber(poses.longest, 3) + " (first " + poses.first_far +
        "); they are normalised, as in COLMAP, but " +
        (poses.is_exchanged
             ? "all poses would be sound with TX TY TZ and QW QX QY QZ "
               "exchanged: expected QW QX QY QZ TX TY TZ"
             : "numbers in a wrong order look like this: expected QW QX QY QZ "
               "TX TY TZ"));
  }
  if (poses.num_stale > 0) {
    sentences.push_back(
        "the poses of " + std::to_string(poses.num_stale) + of_images +
        " are not those that rigs and frames give them, " +
        (poses.largest_turn_deg < 0.005
             ? std::string("they stand elsewhere")
             : "rotations are off by " + TurnWords(poses.median_turn_deg,
                                                   poses.largest_turn_deg,
                                                   poses.largest_turn_image)) +
        "; rigs and frames count, as in COLMAP, and the images' poses are "
        "written anew (if these are the right ones, remove the files of rigs "
        "and frames)");
  }
  return sentences;
}

std::string RotationsSentence(const std::string& path,
                              const RotationInput& input) {
  const ReplacedRotations& replaced = input.replaced;
  std::string line =
      path + ": the rotations of " + Counted(replaced.num_frames, "frame");
  if (replaced.is_comparable) {
    line += ", turned by " + TurnWords(replaced.median_turn_deg,
                                       replaced.largest_turn_deg,
                                       replaced.largest_turn_image);
  }
  if (replaced.frame_turn_deg > 0) {
    line += ", beside " + FormatNumber(replaced.frame_turn_deg, 2) +
            " degrees that all have in common: the list is in another world "
            "frame, and is turned into the model's";
  }
  line += "; " + Counted(replaced.num_kept_images, "image") +
          " without one, as the model has them" + ErrorWords(input);
  if (!replaced.mistake.empty()) {
    return "warning: " + line +
           ". The list is probably written otherwise: " + replaced.mistake;
  }
  // Ten degrees are far more than the error of a noisy sensor.
  if (replaced.is_comparable && replaced.median_turn_deg > 10) {
    return "warning: " + line +
           ". So large a turn is right only where the model's own rotations "
           "are worthless";
  }
  return line;
}

void RecordEnd(const Timer& timer, int num_threads, RunRecord* run) {
  run->version = KROT_VERSION;
  run->threads = ResolveNumThreads(num_threads);
  run->seconds_total = timer.Seconds();
  run->peak_memory_bytes = PeakMemoryBytes();
}

std::string RunSentence(const RunRecord& run, const std::string& middle) {
  return "Read " + Seconds(run.seconds_read) + ", " + middle + ", wrote " +
         Seconds(run.seconds_write) + "; " + Seconds(run.seconds_total) +
         " in all on " + Counted(run.threads, "thread") + ", " +
         FormatBytes(run.peak_memory_bytes) + " at most.\n";
}

}  // namespace krot::internal
