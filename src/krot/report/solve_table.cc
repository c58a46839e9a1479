#include <algorithm>
#include <cmath>
#include <optional>
#include <sstream>
#include <vector>

#include "krot/analysis/noise.h"
#include "krot/problem/cost.h"
#include "krot/report/reports.h"
#include "krot/report/sentences.h"
#include "krot/report/text_table.h"

namespace krot::internal {
namespace {

std::string PolishSentence(const SolveSummary& summary) {
  if (!summary.polish) return "";
  return std::string("The model written is the polished one (least squares, ") +
         PolishName(summary.polish->polish) +
         "); cost, bound and support are those of the one before, whose "
         "maximum it no longer has.\n";
}

// Adds the cost, unless it is the same as the maximum, which the table has
// already.
void AddCost(const SolveSummary& summary, TextTable* table) {
  if (summary.is_given_back || CostIsMaximum(summary)) return;
  table->AddRow({"cost (max optimised, p = " + NormName(summary.norm) + ")",
                 FormatNumber(summary.cost_initial, 4),
                 FormatNumber(summary.cost_final, 4)});
}

// The errors before, after and, if there was such a step, after the polish,
// with a sentence about that.
std::string SolveErrorTable(const SolveSummary& summary) {
  Row head = {"", "before", "after"};
  std::vector<PixelErrorStatistics> estimates = {summary.pixel_error_before,
                                                 summary.pixel_error_after};
  if (summary.polish) {
    head.push_back("polished");
    estimates.push_back(summary.polish->pixel_error);
  }
  TextTable table(head);
  AddErrorColumns(estimates, &table);
  AddCost(summary, &table);
  return table.ToString() + PolishSentence(summary);
}

// For example "no translations and points bring all errors below 3.4201 px".
// Requires a proved bound.
std::string BoundWords(const SolveSummary& summary) {
  // Rounded downwards, because more is not proved.
  const double bound = std::floor(*summary.lower_bound * 1e4) / 1e4;
  const bool has_fixed =
      summary.num_fixed_frames + summary.num_fixed_points > 0;
  const bool has_positions = summary.num_positions > 0;
  const std::string given = TextIf(has_fixed, "what is fixed") +
                            TextIf(has_fixed && has_positions, " and ") +
                            TextIf(has_positions, "these positions");
  return TextIf(!given.empty(), "with " + given + ", ") +
         "no translations and points bring all errors below " + Pixels(bound);
}

// Of a gap: the lens that it is due to. Requires some.
std::string FoldWords(const SolveSummary& summary) {
  const FoldObservation& first = summary.at_folds.front();
  const auto num_others = static_cast<int64_t>(summary.at_folds.size()) - 1;
  return "; the rest is lost at the edge of a lens: point2D " +
         std::to_string(first.point2D_idx) + " of " + first.image_name +
         " lies nearer than the maximum to where the projection of camera " +
         std::to_string(first.camera_id) +
         " folds or ends, so that no proof can rest on it" +
         TextIf(num_others > 0, ", nor on " + Counted(num_others, "other")) +
         ". Another camera model may suit it better.";
}

// Explains why the true gap is not reached if the linear problem's gap is much
// smaller.
std::string LinearGapSentence(const SolveSummary& summary) {
  const std::optional<double> linear_gap = LinearRelativeGap(summary);
  if (summary.termination == SolveTermination::kGapReached || !linear_gap ||
      *linear_gap > 0.5 * *summary.relative_gap) {
    return "";
  }
  return " With every error linearised at this estimate the gap is " +
         GapPercent(*linear_gap) +
         (summary.at_folds.empty()
              ? "; the rest is the curvature of lenses, and rounding."
              : FoldWords(summary));
}

// Reports the finish: what the room above the lowest maximum was used for.
std::string FinishSentence(const SolveSummary& summary) {
  if (!summary.finish) return "";
  const BoundedSummary& solve = summary.finish->solve;
  const auto rms = [&](double cost) {
    return Pixels(
        std::sqrt(2 * cost / static_cast<double>(summary.num_observations)));
  };
  const bool is_plain = summary.finish->loss.kind == ErrorLoss::Kind::kTrivial;
  return std::string(" Within that, ") +
         (is_plain ? "the least squares: RMS "
                   : "the least robust loss: root mean ") +
         rms(solve.cost_final) + " after " +
         Counted(solve.iterations, "iteration") +
         (summary.termination == SolveTermination::kWithinBound
              ? ", where the start had "
              : ", where the lowest maximum alone left ") +
         rms(solve.cost_initial) +
         (solve.termination == InteriorPointTermination::kConverged
              ? "."
              : "; a little less might be possible.");
}

// For example " on 3 % of the observations"; empty if the joint solver did not
// run.
std::string WorkingSetWords(const SolveSummary& summary) {
  const int64_t count = summary.num_working_observations.value_or(0);
  if (count == 0) return "";
  if (count == summary.num_observations) return " on all observations";
  const double percent = 100 * static_cast<double>(count) /
                         static_cast<double>(summary.num_observations);
  return " on " +
         (percent < 1 ? std::string("less than 1")
                      : FormatNumber(std::floor(percent), 0)) +
         " % of the observations";
}

// For example " after 2 rounds, 12 joint iterations on 3 % of the observations
// and 4 sweeps".
std::string StepsWords(const SolveSummary& summary) {
  const std::string sweeps = Counted(summary.sweeps.size(), "sweep");
  const auto num_starting = std::count_if(
      summary.iterations.begin(), summary.iterations.end(),
      [](const JointIteration& state) { return state.target.has_value(); });
  const int64_t num_joint =
      static_cast<int64_t>(summary.iterations.size()) - num_starting;
  const int64_t num_rounds = static_cast<int64_t>(summary.rounds.size());
  const std::string after =
      " after " + TextIf(num_rounds > 1, Counted(num_rounds, "round") + ", ") +
      TextIf(num_starting > 0,
             Counted(num_starting, "iteration") + " to a start, ");
  if (summary.method == SolveMethod::kResInt) return after + sweeps;
  return after + Counted(num_joint, "joint iteration") +
         WorkingSetWords(summary) + " and " + sweeps;
}

std::string SolveEndSentence(const SolveSummary& summary) {
  const std::string after = StepsWords(summary);
  switch (summary.termination) {
    case SolveTermination::kGapReached:
      return "Ended" + after +
             ": the lowest maximum is known to the gap asked for.";
    case SolveTermination::kMaxIterations:
      return "Ended" + after + ", as many iterations as were allowed.";
    case SolveTermination::kStalled:
      return "Stalled" + after +
             (summary.method == SolveMethod::kResInt
                  ? ": the last one gained less than the tolerance; whether a "
                    "lower cost exists is not known."
                  : ": no further progress was made.");
    case SolveTermination::kUnproved:
      return "Gave up" + after +
             ": no further progress was made, and no bound within 1 % of the "
             "maximum is proved; a lower one may exist.";
    case SolveTermination::kZeroCost:
      return "Ended" + after + " with nothing left to lower.";
    case SolveTermination::kWithinBound:
      return "Every error is within the bound" +
             (summary.finish ? " of " + Pixels(summary.finish->cap) : "") +
             ". The lowest maximum was not looked for; --certificate_path does "
             "that.";
    case SolveTermination::kCollapsed:
      return "Ended" + after + " in a collapse of the scene.";
    case SolveTermination::kMaxSweeps:
      return "Ended" + after + ", as many as were allowed.";
    case SolveTermination::kInterrupted:
      return "Interrupted" + after + ".";
    case SolveTermination::kNothingToSolve:
      return NothingToSolveSentence(summary) + ".";
    case SolveTermination::kInfeasible:
    case SolveTermination::kNoStart:
    case SolveTermination::kNotRun:
      break;
  }
  return "Not run.";
}

std::string SolveCountsSentence(const SolveSummary& summary) {
  return CountsWords(summary) + " in the optimisation; " +
         LeftOutWords(LeftOutByReason(summary)) +
         TextIf(summary.num_retriangulated_points > 0,
                "; " + Counted(summary.num_retriangulated_points, "point") +
                    " re-triangulated at the start") +
         ".";
}

// If a track sees an image more than once, at least one of these observations
// is wrong. Says whether such observations set the maximum, or what was done
// with them.
std::string SameImageSentence(const SolveSummary& summary) {
  if (summary.num_same_image_tracks == 0) return "";
  const std::string tracks = Counted(summary.num_same_image_tracks, "track") +
                             " with an image more than once";
  const int64_t num_twins =
      summary.left_out[static_cast<size_t>(LeftOut::kSameImage)];
  if (num_twins > 0) {
    const std::string are = num_twins == 1 ? "is" : "are";
    return tracks + "; " + Counted(num_twins, "observation") + " that " + are +
           " not the closest of the image and track " + are +
           " taken to be wrong: left out, still in the model, and in no error "
           "above (" +
           (std::isfinite(summary.largest_twin_error)
                ? "the largest has " + Pixels(summary.largest_twin_error)
                : "some do not project") +
           ").\n";
  }
  const std::vector<Point3DId> points = SameImageInSupport(summary);
  return tracks +
         TextIf(!points.empty(),
                "; in the support: " + PointList(points) +
                    " (--Problem.same_image closest leaves one of each)") +
         ".\n";
}

// Says how far cameras and points are from where they are known to be.
std::string PositionsKeptSentence(const SolveSummary& summary) {
  if (summary.num_positions == 0) return "";
  const std::string ratio =
      FormatNumber(100 * summary.largest_position_ratio, 2) +
      " % of its radius.\n";
  return summary.largest_position_ratio > 1 + 1e-6
             ? "Not everything came to be where it is known to be: the "
               "farthest is off by " +
                   ratio
             : Counted(summary.num_positions, "known position") +
                   " kept; the farthest is off by " + ratio;
}

// Says by which factor the radii were multiplied.
std::string PositionFactorSentence(const SolveSummary& summary) {
  if (!summary.position_factor) return "";
  const PositionFactor& factor = *summary.position_factor;
  const std::string pixels = Pixels(factor.max_error);
  if (factor.factor == 1) {
    return "The largest error can be at most " + pixels +
           " with the radii as they are.\n";
  }
  return "All radii are multiplied by " + FormatNumber(factor.factor, 4) +
         ", so that the largest error can be at most " + pixels +
         TextIf(factor.certificate.has_value(),
                "; with " + FormatNumber(factor.lower_bound, 4) +
                    " it is proved to be above") +
         ".\n";
}

// Says which observations were left out so that all others are within a bound.
std::string BracketOf(const SolveReport& report) {
  if (!report.outliers) return "";
  const OutlierFilterSummary& outliers = *report.outliers;
  return "Within " + Pixels(outliers.max_error) + ": " +
         BracketSentence(outliers) +
         TextIf(outliers.num_points_removed > 0,
                "; with them went " +
                    Counted(outliers.num_points_removed, "track")) +
         "." +
         TextIf(outliers.init == SolveInit::kFeasible &&
                    outliers.max_error > 5 * kFilteredPx,
                " With rotations as they should be a few pixels are enough: "
                "adjust the model, rotations free (krot bundle_adjuster).") +
         "\n";
}

}  // namespace

std::string VerdictSentence(const SolveSummary& summary) {
  if (summary.is_given_back) {
    return GivenBackSentence(summary) +
           (summary.is_certified
                ? " It is proved that " + BoundWords(summary) + "."
                : "");
  }
  if (IsZeroUpToRounding(summary.cost_final)) {
    return "Every error is zero up to rounding (" +
           Scientific(summary.cost_final) + " px at most)" +
           TextIf(summary.is_underdetermined,
                  ", which says nothing: " + UnderdeterminedWords(summary)) +
           ".";
  }
  const std::string maximum =
      "Maximum " + Pixels(summary.cost_final) +
      TextIf(summary.norm.p != 2, " (p = " + NormName(summary.norm) + ")") +
      TextIf(summary.norm.p == 2 && !CostIsMaximum(summary),
             " over the observations in the optimisation");
  if (!summary.is_certified) {
    return maximum +
           (summary.termination == SolveTermination::kWithinBound
                ? "."
                : ", not proved optimal.") +
           FinishSentence(summary);
  }
  return maximum + ", " + GapWords(*summary.relative_gap) + ": " +
         BoundWords(summary) + "." + LinearGapSentence(summary) +
         FinishSentence(summary);
}

std::string SolveTable(const SolveReport& report) {
  const SolveSummary& summary = report.summary;
  std::ostringstream text;
  text << "\nReprojection errors, pixels\n"
       << SolveErrorTable(summary)
       << (report.matches ? MatchesSentence(*report.matches) : "")
       << BracketOf(report) << SolveCountsSentence(summary) << '\n'
       << SameImageSentence(summary)
       << NotFiniteSentence(summary.pixel_error_after)
       << (summary.is_given_back ? "" : CollapseLines(summary.collapse));
  if (summary.num_components > 1) {
    text << "The problem falls into "
         << Counted(summary.num_components, "component")
         << " that share no track, each solved by itself: none tells where "
            "they stand relative to each other, nor in which scale; krot "
            "model_checker lists them.\n";
  }
  text << LooseSentences(summary.loose, summary.num_images)
       << (report.position_frame
               ? PositionFrameSentence(*report.position_frame) + ".\n"
               : "")
       << PositionFactorSentence(summary) << PositionsKeptSentence(summary)
       << SolveEndSentence(summary) << '\n'
       << VerdictSentence(summary) << '\n';
  if (summary.is_certified) {
    text << SupportTable(summary.support, 10)
         << PositionsTable(summary.support_positions, 10);
  }
  if (report.distances) {
    text << DistanceTable(*report.distances, {"before", "after"});
  }
  text << (summary.is_certified || report.distances ? "\n" : "")
       << RunSentence(report.run, "built " + Seconds(summary.seconds_build) +
                                      ", solved " +
                                      Seconds(summary.seconds_solve));
  return text.str();
}

}  // namespace krot::internal
