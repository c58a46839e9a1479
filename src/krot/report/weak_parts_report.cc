#include <algorithm>
#include <cmath>
#include <string>

#include "krot/report/outlier_report.h"
#include "krot/report/report_json.h"
#include "krot/report/text_table.h"

namespace krot::internal {
namespace {

// "44 images (P1180141.JPG to P1180184.JPG) hang on the rest by 14 tracks, of
// which 9 agree; their scale against the rest is held to a factor of 1.80
// only", of a part that is not held.
std::string WeakPartWords(const WeakPart& part) {
  const auto count = static_cast<int64_t>(part.image_names.size());
  const auto [first, last] =
      std::minmax_element(part.image_names.begin(), part.image_names.end());
  return Counted(count, "image") + " (" + *first +
         (count == 1 ? std::string()
                     : (count == 2 ? " and " : " to ") + *last) +
         ") " + (count == 1 ? "hangs" : "hang") + " on the rest by " +
         Counted(part.num_tracks, "track") + ", of which " +
         std::to_string(part.num_agreeing) +
         (part.num_agreeing == 1 ? " agrees" : " agree") + "; their " +
         (part.scale_factor <= 1.1 ? "place and " : "") +
         "scale against the rest " +
         (part.scale_factor <= 1.1 ? "are not known"
          : std::isfinite(part.scale_factor)
              ? "is held to a factor of " + FormatNumber(part.scale_factor, 2) +
                    " only"
              : std::string("is not held at all")) +
         (part.turn_deg > 0
              ? "; if all their rotations were turned against the rest's by " +
                    FormatNumber(part.turn_deg, 2) + " degrees, " +
                    std::to_string(part.num_agreeing_turned) +
                    " tracks would agree: look at the rotations"
              : std::string());
}

}  // namespace

std::string UnreliableSentence(const OutlierFilterSummary& summary) {
  if (summary.init != SolveInit::kFeasible) return "";
  std::string words;
  const auto add = [&](const std::string& reason) {
    words += (words.empty() ? "" : "; ") + reason;
  };
  for (const WeakPart& part : summary.weak_parts) {
    if (!part.is_held) add(WeakPartWords(part));
  }
  if (!words.empty()) {
    words +=
        "; match more pairs of images across, or take the parts as models of "
        "their own";
  }
  const auto num_removed = static_cast<int64_t>(summary.removed.size());
  if (summary.is_bound_beyond_reason) {
    add("hardly anything fits: half of all errors are so large that noise "
        "would explain " +
        FormatNumber(summary.max_error, 4) +
        " px; look at rotations, intrinsics and matches");
  } else if (2 * num_removed > summary.num_observations) {
    add(Thousands(num_removed) + " of " + Thousands(summary.num_observations) +
        " observations, more than half, are not within " +
        FormatNumber(summary.max_error, 4) +
        " px; look at rotations, intrinsics and matches");
  }
  return words.empty() ? words
                       : "the positions are not to be relied on: " + words;
}

Json WeakPartsJson(const OutlierFilterSummary& summary) {
  Json parts = Json::array();
  for (const WeakPart& part : summary.weak_parts) {
    parts.push_back(
        {{"image_names", part.image_names},
         {"num_tracks", part.num_tracks},
         {"num_agreeing", part.num_agreeing},
         {"scale_factor",
          std::isfinite(part.scale_factor) ? Json(part.scale_factor) : Json()},
         {"is_held", part.is_held},
         {"turn_deg", part.turn_deg},
         {"num_agreeing_turned", part.num_agreeing_turned}});
  }
  return parts;
}

}  // namespace krot::internal
