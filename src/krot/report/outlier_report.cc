#include "krot/report/reports.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "krot/base/numbers.h"
#include "krot/outliers/robust_start.h"
#include "krot/report/report_json.h"
#include "krot/report/text_table.h"

namespace krot::internal {
namespace {

// About a part that is not held: "44 images (P1180141.JPG to P1180184.JPG) hang
// on the rest by 14 tracks, of which 9 agree; their scale against the rest is
// held to a factor of 1.80 only". Two images may agree on a track at any
// distance.
std::string WeakPartWords(const WeakPart& part) {
  const auto count = static_cast<int64_t>(part.image_names.size());
  const auto [first, last] =
      std::minmax_element(part.image_names.begin(), part.image_names.end());
  const std::string images =
      Counted(count, "image") + " (" + *first +
      TextIf(count > 1, (count == 2 ? " and " : " to ") + *last) + ") ";
  if (part.num_tracks == 0) {
    return images + (count == 1 ? "shares" : "share") +
           " no track with the rest: nothing tells their place and scale "
           "against it";
  }
  return images + (count == 1 ? "hangs" : "hang") + " on the rest by " +
         Counted(part.num_tracks, "track") +
         (part.num_of_three == 0
              ? " of two images alone, which tell directions but no distances"
              : ", of which " + std::to_string(part.num_agreeing) +
                    (part.num_agreeing == 1 ? " agrees" : " agree")) +
         "; their " + TextIf(part.scale_factor <= 1.1, "place and ") +
         "scale against the rest " +
         (part.scale_factor <= 1.1 ? "are not known"
          : std::isfinite(part.scale_factor)
              ? "is held to a factor of " + FormatNumber(part.scale_factor, 2) +
                    " only"
              : std::string("is not held at all")) +
         TextIf(part.turn_deg > 0,
                "; if all their rotations were turned against the rest's by " +
                    FormatNumber(part.turn_deg, 2) + " degrees, " +
                    std::to_string(part.num_agreeing_turned) +
                    " tracks would agree: look at the rotations");
}

// For example "2 images keep few of their observations (P7.JPG 3 of 120, P9.JPG
// 0 of 88): look at their rotations and matches, or leave them out"; or frames,
// by their first images, where rigs have several cameras. The first five are
// named. "" without such parts.
std::string LooseFrameWords(const std::vector<WeakPart>& parts) {
  const char* one = "image";
  std::vector<std::string> names;
  for (const WeakPart& part : parts) {
    if (!part.is_frame) continue;
    if (part.image_names.size() > 1) one = "frame";
    names.push_back(part.image_names.front() + " " +
                    std::to_string(part.num_agreeing) + " of " +
                    std::to_string(part.num_tracks));
  }
  if (names.empty()) return "";
  const bool is_one = names.size() == 1;
  return Counted(names.size(), one, "keeps", "keep") + " few of " +
         (is_one ? "its" : "their") + " observations (" + ListText(names, 5) +
         "): look at " + (is_one ? "its" : "their") +
         " rotations and matches, or leave " + (is_one ? "it" : "them") +
         " out";
}

// "the images show no baseline: with rotations turned by at most 0.12 degrees,
// one centre of all cameras explains the observations as well; ...".
std::string OneCentreWords(double turn_deg) {
  return "the images show no baseline: " +
         TextIf(turn_deg >= 0.005, "with rotations turned by at most " +
                                       FormatNumber(turn_deg, 2) +
                                       " degrees, ") +
         "one place of all cameras explains the observations as well as "
         "different ones; positions need photos from different places, a "
         "panorama needs rotations alone";
}

}  // namespace

std::string UnreliableSentence(const OutlierFilterSummary& summary) {
  if (summary.init != SolveInit::kFeasible) return "";
  std::string words;
  if (summary.one_centre_turn_deg) {
    words = OneCentreWords(*summary.one_centre_turn_deg);
  }
  const auto add = [&](const std::string& reason) {
    words += (words.empty() ? "" : "; ") + reason;
  };
  auto parts = PointersIf(summary.weak_parts, [](const WeakPart& part) {
    return !part.is_held && !part.is_frame;
  });
  SortLargestFirst(
      &parts, [](const WeakPart* part) { return part->image_names.size(); });
  const size_t num_told = std::min<size_t>(3, parts.size());
  for (size_t n = 0; n < num_told; ++n) add(WeakPartWords(*parts[n]));
  if (parts.size() > num_told) {
    add(Counted(parts.size() - num_told, "smaller part", "is", "are") +
        " not held either (--report_path lists all)");
  }
  if (!parts.empty()) {
    words +=
        "; match more pairs of images across, or take the parts as models of "
        "their own";
  }
  const std::string loose = LooseFrameWords(summary.weak_parts);
  if (!loose.empty()) add(loose);
  const auto num_removed = static_cast<int64_t>(summary.removed.size());
  if (summary.is_bound_beyond_reason) {
    add("hardly anything fits: half of all errors are so large that noise "
        "would explain " +
        Pixels(summary.max_error) +
        (parts.empty() ? "; look"
                       : "; if that is so of each part alone, look") +
        " at rotations, intrinsics and matches");
  } else if (2 * num_removed > summary.num_observations) {
    add(Thousands(num_removed) + " of " + Thousands(summary.num_observations) +
        " observations, more than half, are not within " +
        Pixels(summary.max_error) +
        "; look at rotations, intrinsics and matches");
  }
  return words.empty() ? words
                       : "the positions are not to be relied on: " + words;
}

namespace {

std::string RotationSentence(const OutlierFilterSummary& summary) {
  if (!summary.rotation_suspect) return "";
  const RotationSuspect& suspect = *summary.rotation_suspect;
  return "\nConflicts gather in " + suspect.image_name + " (" +
         std::to_string(suspect.num_conflicts) + " of " +
         std::to_string(summary.num_proved) +
         "): its rotation is the suspect. Turned by " +
         FormatNumber(suspect.angle_deg, 3) + " degrees it has " +
         std::to_string(suspect.num_above_turned) + " instead of " +
         std::to_string(suspect.num_above) + " of " +
         Counted(suspect.num_observations, "observation") +
         " above the bound.\nWith it no translations and points bring all "
         "errors below " +
         Pixels(suspect.lower_bound_with) +
         " (proved); without it they come down to " +
         Pixels(suspect.max_error_without) + ".\n";
}

// Reports the noise, and whether the errors of the kept observations have
// risen, however little: the user should not have to find that out.
std::string SnoopingSentences(const OutlierFilterSummary& summary) {
  if (!summary.snooping) return "";
  const SnoopingSummary& snooping = *summary.snooping;
  const std::string noise = "noise of " + Pixels(*snooping.sigma_px, 3) +
                            " per axis (w above " +
                            FormatNumber(snooping.critical_w, 2) + ")";
  if (summary.removed.empty()) {
    return "\nNo observation is more than " + noise +
           " explains: the model is written as it was read.\nTo remove "
           "observations for a bound of your own, give "
           "--OutlierFilter.max_error.\n";
  }
  std::string text =
      "\nWhat was removed is more than " + noise +
      " explains;\nbefore the removal it was " +
      Pixels(*snooping.sigma_before_px, 3) +
      (snooping.is_solved
           ? ". What is left is at its least squares, rotations fixed.\n"
           : ". What is left stays where it was, as no better place was "
             "found.\n");
  if (summary.num_proved > 0) {
    text += "That at least " + Counted(summary.num_proved, "observation") +
            " must go is proved: with these rotations, wherever cameras and\n"
            "points are put, so many have errors that such noise does not "
            "explain (above " +
            Pixels(snooping.max_error_px, 3) + ", or less in short tracks).\n";
  }
  const PixelErrorStatistics& before = snooping.kept_error_before;
  const PixelErrorStatistics& after = summary.pixel_error_after;
  const auto rises = [&](const char* name, double was, double is) {
    if (!(is > was)) return;
    text += std::string("Of what is kept, the ") + name +
            " of the errors rises from " + FormatNumber(was, 4) + " to " +
            Pixels(is) +
            ": it was not the least squares that the input minimised.\n";
  };
  rises("mean", before.mean, after.mean);
  rises("RMS", before.rms, after.rms);
  return text;
}

// Says what noise explains, and what follows from that.
std::string NoiseSentence(const OutlierFilterSummary& summary) {
  if (!summary.noise) return "";
  const NoiseSummary& noise = *summary.noise;
  std::string text = "\nGaussian noise of " + Pixels(noise.limit.sigma) +
                     " (standard deviation per axis, from the median error) "
                     "explains errors up to " +
                     Pixels(noise.limit.max_error) + ".\n";
  if (!noise.ExplainsAll()) {
    text +=
        "Without a removal no translations and points bring all errors "
        "below " +
        Pixels(noise.lower_bound) + " (proved): such noise is not all.\n";
  } else if (noise.lowest_max_error <= noise.limit.max_error) {
    text += "Translations and points bring all errors down to " +
            Pixels(noise.lowest_max_error) + ": there is no elbow.\n";
  } else {
    text +=
        "It was not proved that some errors stay above that: there is no "
        "elbow.\n";
  }
  if (noise.limit.sigma > kLevelOfStart) {
    text +=
        "Feature points rarely have that much: rotations, intrinsics or "
        "matches may be wrong altogether; look at these first.\n";
  }
  if (summary.max_error > 0) return text;
  return text +
         "No observation is called wrong, and the model is written as it was "
         "read. To remove observations for a bound of your own, give "
         "--OutlierFilter.max_error.\n";
}

std::string ProfileTable(const ErrorProfileSummary& profile) {
  TextTable table({"removed", "must go", "largest error", "proved"});
  for (size_t n = 0; n < profile.levels.size(); ++n) {
    const ErrorProfileSummary::Level& level = profile.levels[n];
    table.AddRow({Thousands(level.num_removed), Thousands(level.num_proved),
                  FormatNumber(level.max_error, 4),
                  level.lower_bound ? FormatNumber(*level.lower_bound, 4) : "",
                  profile.elbow == n ? "<- elbow" : ""});
  }
  return "\nLargest error without some observations, pixels\n" +
         table.ToString();
}

std::string SuspectTable(const OutlierFilterSummary& summary) {
  const bool has_conflicts = summary.conflicts.has_value();
  Row head = {"image", "observations", "removed"};
  if (has_conflicts) head.emplace_back("conflicts");
  return TitledTable(
      "Images with most of them", std::move(head), summary.images, 5,
      [&](const Suspect& image) {
        Row row = {image.name, image.num_observations, image.num_removed};
        if (has_conflicts) row.emplace_back(image.num_conflicts);
        return row;
      });
}

}  // namespace

std::string OutlierMethodName(OutlierMethod method) {
  using Enum = OutlierMethod;
  return NameIn<Enum>(
      {{Enum::kSnooping, "snooping"}, {Enum::kConflicts, "conflicts"}}, method);
}

std::string BracketSentence(const OutlierFilterSummary& summary) {
  std::string sentence = "removed " + Thousands(summary.removed.size()) +
                         " of " + Thousands(summary.num_observations);
  if (summary.conflicts) {
    sentence +=
        "; at least " + Thousands(summary.num_proved) + " must go (" +
        Thousands(summary.num_proved) + " disjoint conflict" +
        (summary.num_proved == 1 ? "" : "s") + ", certificate" +
        (summary.is_search_complete ? ")"
                                    : "; the search for more ended early)");
  }
  return sentence;
}

std::string OutlierTable(const OutlierReport& report) {
  const OutlierFilterSummary& summary = report.summary;
  std::string text = BracketSentence(summary) + "\n";
  if (!summary.is_search_complete) {
    text +=
        "The search for conflicts ended early, as it took too much work: more "
        "may have to go than is proved. Where that happens, rotations, "
        "intrinsics or matches are often wrong altogether, or the bound is far "
        "too low; look at these first.\n";
  }
  if (summary.num_points_removed > 0) {
    text += Counted(summary.num_points_removed, "track") +
            " kept fewer than two and went, with " +
            Counted(summary.num_left_alone, "observation") +
            " that had been left alone.\n";
  }
  TextTable errors({"", "before", "after"});
  AddErrorColumns({summary.pixel_error_before, summary.pixel_error_after},
                  &errors);
  text +=
      "\nReprojection errors, pixels\n" + errors.ToString() +
      RaisedMaxSentence(summary.pixel_error_before, summary.pixel_error_after);
  text += NoiseSentence(summary) + SnoopingSentences(summary);
  if (summary.profile) text += ProfileTable(*summary.profile);
  text += SuspectTable(summary) + RotationSentence(summary) + "\n";
  if (summary.solve) {
    text += LooseSentences(summary.solve->loose, summary.solve->num_images);
  }
  return text +
         RunSentence(
             report.run,
             (summary.profile ? "made the profile in " +
                                    Seconds(summary.profile->seconds) + ", "
                              : "") +
                 "chose " + Seconds(summary.seconds_removal) + ", " +
                 TextIf(summary.conflicts.has_value(),
                        "proved " + Seconds(summary.seconds_conflicts) + ", ") +
                 "solved " + Seconds(summary.seconds_solve));
}

}  // namespace krot::internal
