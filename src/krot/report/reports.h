#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "krot/analysis/model_input.h"
#include "krot/analysis/model_statistics.h"
#include "krot/analysis/noise.h"
#include "krot/check.h"
#include "krot/convert/certificate_file.h"
#include "krot/database.h"
#include "krot/model.h"
#include "krot/model/model_checks.h"
#include "krot/model/model_io.h"
#include "krot/outliers/match_tracks.h"
#include "krot/outliers/outlier_filter.h"
#include "krot/pipeline/adjust_model.h"
#include "krot/pipeline/solve_model.h"
#include "krot/report/adjustment_figures.h"
#include "krot/report/sentences.h"
#include "krot/tolerance/tolerance_analysis.h"

namespace krot::internal {

// What one run of `krot bundle_adjuster` did.
struct AdjustmentReport {
  RunRecord run;
  AdjustModelSummary summary;
  std::optional<SurveyComparison> check_points;
  std::optional<SurveyComparison> positions;    // that are known
  std::optional<PositionFrame> position_frame;  // if they have their own
  bool is_in_position_frame = false;            // what is written
  std::optional<DistanceComparison> distances;
  LastingFaults faults;  // of what is written
};

// Each known distance beside the adjusted one; a sentence for each that is
// wrong.
std::string AdjustedDistanceTable(const DistanceComparison& comparison);

// For the terminal: errors before and after, what took part, why it ended.
std::string AdjustmentTable(const AdjustmentReport& report);

// What is not to be relied on in what is written, `model`, and what to do.
std::vector<std::string> AdjustmentWarnings(const AdjustmentReport& report,
                                            const Model& model);

// report.json; docs/cli.md lists its keys. What is not known is null. `model`
// is the one that is written.
std::string AdjustmentJson(const AdjustmentReport& report, const Model& model);

// A protocol for people to read; if the precision was computed, with that of
// every camera, image and point.
std::string AdjustmentText(const AdjustmentReport& report, const Model& model);

// Says why there is no model below the cap, and which bound proves it, if one
// does. Requires the termination kInfeasibleStart.
std::string NoModelBelowCapSentence(const AdjustModelSummary& summary);

// "nothing to adjust: ...". Requires the termination kNothingToAdjust.
std::string NothingToAdjustSentence(const BundleAdjustmentSummary& summary);

// The name in report.json: "converged", "max_iterations", ...
std::string AdjustmentTerminationName(BundleAdjustmentTermination termination);

// The first `max_positions` known positions of a support; empty if it has none.
std::string PositionsTable(const std::vector<SupportPosition>& positions,
                           int max_positions);

// The `max_observations` observations of a support with the largest errors.
std::string SupportTable(const std::vector<SupportObservation>& support,
                         int max_observations);

// An accepted certificate for the terminal: the bound, the model's own cost and
// gap, and the `max_observations` observations of the support with the largest
// errors.
std::string CertificateTable(const CertificateVerdict& verdict,
                             int max_observations);

// For an accepted certificate of baselines: the `max_pairs` pairs with the
// smallest share of explained matches.
std::string BaselineTable(const Model& model,
                          const BaselineCertificate& certificate,
                          int max_pairs);

// What certificate_checker prints about an accepted file of conflicts.
std::string ConflictTable(const ConflictVerdict& verdict);

// report.json of certificate_checker; exactly one of the three is given, which
// was accepted.
std::string CheckJson(const std::optional<CertificateVerdict>& certificate,
                      const std::optional<ConflictVerdict>& conflicts,
                      const std::optional<BaselineCertificate>& baselines,
                      const std::string& version);

// What one run of `krot model_checker` found.
struct CheckReport {
  RunRecord run;
  ModelCheck check;
  int64_t num_observations = 0;  // of the input
  PixelErrorStatistics pixel_error_before;
  PixelErrorStatistics pixel_error_after;  // of the cured model
  std::vector<std::string> moved;          // ModelCure
  bool has_panorama = false;
  std::vector<DiscardedCamera> discarded;  // of the input
  double seconds_check = 0;                // wall clock
  // For the commands that NextSteps suggests; if empty, a name in capitals is
  // printed instead.
  std::string input_path;
  std::string output_path;
  std::string database_path;
  std::string image_path;
};

// For example "By the matches 39 of 249 pairs of images contradict the poses: 3
// images are wrong."
std::string PairSentence(const PairCheck& check);

// What is wrong with an image's pose: "rotation: turned by 0.31 degrees".
std::string PoseFaultWords(const CheckedImage& image);

// For the terminal: PairSentence, wrong images and pairs with wrong matches, at
// most max_rows of each.
std::string PairTable(const PairCheck& check, int max_rows);

// Why an image has its verdict; empty if it is fine.
std::string ReasonOf(const ModelCheck& check, const ImageCheck& image);

// For example "2 of 41 images and 37 of 20,785 observations are wrong", or
// "Nothing is wrong", with the reason.
std::string CheckSentence(const CheckReport& report);

// For the terminal: the sentences, the verdict of the matches (PairTable),
// images by verdict, weak parts, observations by w, tracks of two points, and
// what to do next. At most max_rows of each.
std::string CheckTable(const CheckReport& report, int max_rows);

// report.json; docs/cli.md lists its keys. What is not known is null.
std::string CheckJson(const CheckReport& report);

// For example "0.0123"; "anywhere" if nothing holds the image.
std::string SigmaText(double sigma);

// What too few tracks tie to the rest of a model; "" if all is tied.
std::string PartsSentence(const ModelCheck& check);
std::string PartTable(const ModelCheck& check, size_t max_rows);
// How the model's numbers are to be read.
std::string ConventionsSentence(const Conventions& conventions);
// What is wrong with cameras, and what to do; requires one at least.
std::string CamerasSentence(const ModelCheck& check);
std::string CameraTable(const ModelCheck& check, size_t max_rows);
// Wrong observations, and tracks that are two points.
std::string ObservationTable(const ModelCheck& check, size_t max_rows);
std::string TrackTable(const ModelCheck& check, size_t max_rows);

// What the model still has that no adjustment mends, and what helps: a line for
// each; "" if there is nothing.
std::string LastingFaultLines(const LastingFaults& faults);

// How two models differ: `krot model_comparer`.
struct ComparisonReport {
  std::string version;
  ComparisonSummary summary;
  Contradictions contradictions1;  // of the models as their files are
  Contradictions contradictions2;
  std::optional<DistanceReport> distances;
  // The models' accepted certificates, if given.
  std::optional<CertificateVerdict> certificate1;
  std::optional<CertificateVerdict> certificate2;
};

// For the terminal; the `max_rows` worst images, points and support
// observations.
std::string ComparisonTable(const ComparisonReport& report, int max_rows);

// The comparison as JSON, with all shared images; docs/formats.md lists its
// keys.
std::string ComparisonJson(const ComparisonReport& report);

// COLMAP's errors.csv: one line for each shared image with a pose in both
// models, with the angle between its rotations in degrees, the distance of its
// centres, and its name.
std::string PoseErrorsCsv(const ComparisonSummary& summary);

// What EstimateNoise finds, and more figures of it.
struct NoiseFigures : ModelNoise {
  struct Quantile {
    double share = 0;  // of the tested observations, that have at most this w
    double w = 0;
    double gaussian_w = 0;  // the same quantile for Gaussian noise
  };

  // Observations with one, or without any, controlled direction.
  int64_t num_half_controlled = 0;
  int64_t num_uncontrolled = 0;
  std::vector<Quantile> quantiles;
  std::vector<int64_t> num_above_by_image;  // as Model::images
};

// The errors, tracks and depths of a model: `krot model_analyzer`.
struct ModelReport {
  ColmapStatistics colmap;
  Contradictions contradictions;  // of the model as its files are
  PoseChecks poses;
  PixelErrorStatistics pixel_error;  // true errors of all observations
  std::vector<ImageErrors> images;
  std::vector<CameraErrors> cameras;
  std::vector<WorstObservation> worst;
  NoiseFigures noise;
  std::map<int64_t, int64_t> track_lengths;  // length -> points
  // Tracks that hold two or more observations of one image.
  int64_t num_tracks_with_repeated_image = 0;
  DepthStatistics depth;
  ValueRange triangulation_angle_deg;
  std::optional<DistanceReport> distances;
  LastingFaults faults;
};

// Collects the figures of a model. Requires a valid model (ValidateModel) and
// num_worst >= 0. O(sum of squared track lengths).
ModelReport AnalyzeModel(const Model& model, int num_worst);

// For the terminal: COLMAP's figures under COLMAP's names, then KROT's. Of
// cameras and images the `max_rows` with the largest errors.
std::string ModelTable(const ModelReport& report, int max_rows);

// A header, then one line per camera and one per image (docs/cli.md).
std::string ModelCsv(const ModelReport& report);

// The report as JSON, with all images; docs/cli.md lists its keys.
std::string ModelJson(const ModelReport& report, const std::string& version);

// What one run of `krot outlier_filter` did.
struct OutlierReport {
  RunRecord run;
  OutlierFilterSummary summary;
};

// For example "removed 74 of 26,268; at least 61 must go (61 disjoint
// conflicts, certificate)".
std::string BracketSentence(const OutlierFilterSummary& summary);

// Says why positions from nothing are not reliable, and what to do next: the
// scale of a part is hardly held, the bound is beyond reason, or more
// observations do not fit than do. Of the parts it names the three with most
// images. Empty if they are reliable, or not from nothing.
std::string UnreliableSentence(const OutlierFilterSummary& summary);

// For the terminal: BracketSentence, errors before and after, and the suspects.
std::string OutlierTable(const OutlierReport& report);

// report.json; docs/cli.md lists its keys. What is not known is null.
std::string OutlierJson(const OutlierReport& report);

// The error profile as a file of its own (docs/formats.md); requires that there
// is one.
std::string ProfileJson(const OutlierReport& report);

// A header, then one line per removed observation, worst first.
std::string OutlierCsv(const OutlierFilterSummary& summary);

// The name that --OutlierFilter.method takes.
std::string OutlierMethodName(OutlierMethod method);

// What one run of `krot solver` or `krot point_triangulator` did.
struct SolveReport {
  RunRecord run;
  std::string command;
  std::string method;
  SolveSummary summary;
  // Set if observations were removed; their own solve is the summary above.
  std::optional<OutlierFilterSummary> outliers;
  // Set if positions and points come from the matches of a database.
  std::optional<MatchTracksSummary> matches;
  // The known positions' own frame, if they have one, and whether the model is
  // written in it.
  std::optional<PositionFrame> position_frame;
  bool is_in_position_frame = false;
  std::optional<DistanceReport> distances;  // before and after
};

// What one run of `krot point_triangulator --database_path` produced.
struct TrackReport {
  RunRecord run;
  MatchTracksSummary summary;
  int64_t num_points = 0;
  int64_t num_observations = 0;
  PixelErrorStatistics pixel_error;
  double seconds_triangulate = 0;  // wall clock
};

// For example "9,128 points with 52,311 observations: tracks of 5.73 images,
// root mean square error 0.71 px."
std::string TrackSentence(const TrackReport& report);

// For the terminal: TrackSentence, and what became of the matches.
std::string TrackTable(const TrackReport& report);

// For example "The points come from the matches of 249 pairs of images."
std::string MatchesSentence(const MatchTracksSummary& summary);

// report.json; docs/cli.md lists its keys.
std::string TrackJson(const TrackReport& report);

// A row for each known distance: its known length, its length in each model, in
// metres by that model's scale, and whether it contradicts the others. `heads`
// name the models.
std::string DistanceTable(const DistanceReport& report,
                          const std::vector<std::string>& heads);

// A sentence for each known distance that contradicts the others in the last
// model.
std::vector<std::string> ContradictedDistances(const DistanceReport& report);

// The solved model in the positions' frame, which there is, and its errors in
// the report.
Model InPositionFrame(const Model& solved, SolveReport* report);

// "57 of 60 positions agree with the model, to 0.631 m (median); ..."
std::string PositionFrameSentence(const PositionFrame& frame);

// "the position of a.jpg is 123.4 m off, its radius is 2 m: left out".
std::string WrongPositionSentence(const WrongPosition& wrong);

// For the terminal: errors before and after, what was left out, why it ended,
// how long it took.
std::string SolveTable(const SolveReport& report);

// report.json; docs/cli.md lists its keys. What is not known is null.
std::string SolveJson(const SolveReport& report);

LeftOutCounts LeftOutByReason(const SolveSummary& summary);

// "nothing to solve: 1000 observations left out (short_track 1000)". Requires
// the termination kNothingToSolve.
std::string NothingToSolveSentence(const SolveSummary& summary);

// The points in the support whose tracks see an image more than once.
std::vector<Point3DId> SameImageInSupport(const SolveSummary& summary);

// Whether the cost equals, to the digits shown, the largest error of the
// written model. It does with p = 2 if every observation takes part.
bool CostIsMaximum(const SolveSummary& summary);

// The maximum of the written model, what is proved about it, and what is not;
// for the terminal, the report and the page.
std::string VerdictSentence(const SolveSummary& summary);

// "0.0100 %", "less than 0.0001 %".
std::string GapPercent(double relative_gap);

// "proved to be within 0.0100 % of the lowest".
std::string GapWords(double relative_gap);

// "2 observations are too few to determine 2 frames and 1 point". Requires
// is_underdetermined.
std::string UnderdeterminedWords(const SolveSummary& summary);

// For example "the gap asked for is not reached: no further progress was made;
// ...".
std::string MissedGapSentence(const SolveSummary& summary);

// The relative gap of the last round's linear problem; none if no bound of it
// is proved.
std::optional<double> LinearRelativeGap(const SolveSummary& summary);

// Says what was written instead of a better model. Requires is_given_back.
std::string GivenBackSentence(const SolveSummary& summary);

// The name that --Solver.method takes.
std::string MethodName(SolveMethod method);

// The value that --Solver.norm takes: "1", "2", "inf", "1.5".
std::string NormName(Norm norm);

// What one run of `krot tolerance_analyzer` found.
struct ToleranceReport {
  RunRecord run;
  ToleranceSummary summary;
  PixelErrorStatistics pixel_error_before;  // of the input
  // The errors of the model that the boxes are around.
  PixelErrorStatistics pixel_error_after;
};

// For the terminal: what holds place and scale, and the proved boxes. If there
// are more than `max_rows`, unbounded boxes are shown first, then the widest.
std::string ToleranceTable(const ToleranceReport& report, int max_rows);

// report.json; docs/cli.md lists its keys. An end without a proof is null.
std::string ToleranceJson(const ToleranceReport& report);

// A header, then one line per coordinate (docs/formats.md).
std::string ToleranceCsv(const ToleranceSummary& summary);

}  // namespace krot::internal
