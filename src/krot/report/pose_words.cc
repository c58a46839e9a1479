#include "krot/report/pose_words.h"

#include "krot/report/text_table.h"

namespace krot::internal {
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
  return "; the median error was " +
         FormatNumber(*input.median_error_before, 2) + " px and is " +
         (input.median_error_after
              ? FormatNumber(*input.median_error_after, 2) + " px"
              : std::string("infinite")) +
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
  // Far more than a noisy sensor's error.
  constexpr double kLargeDeg = 10;
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
  if (replaced.is_comparable && replaced.median_turn_deg > kLargeDeg) {
    return "warning: " + line +
           ". So large a turn is right only where the model's own rotations "
           "are worthless";
  }
  return line;
}

}  // namespace krot::internal
