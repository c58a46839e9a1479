#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "krot/analysis/model_comparison.h"
#include "krot/analysis/model_statistics.h"
#include "krot/analysis/noise.h"
#include "krot/analysis/position_frame.h"
#include "krot/check.h"
#include "krot/convert/baseline_certificate.h"
#include "krot/convert/certificate_file.h"
#include "krot/model.h"
#include "krot/model/known_distances.h"
#include "krot/model/model_checks.h"
#include "krot/outliers/match_tracks.h"
#include "krot/outliers/outlier_filter.h"
#include "krot/pipeline/adjust_model.h"
#include "krot/pipeline/solve_model.h"
#include "krot/report/sentences.h"
#include "krot/tolerance/tolerance_analysis.h"

namespace krot::internal {

// Surveyed points that had no say, against a model's.
struct CheckPoints {
  struct Point {
    Point3DId point3D_id = 0;
    Eigen::Vector3d surveyed = Eigen::Vector3d::Zero();
    // The model's minus the surveyed, after the similarity that fits them best,
    // in the survey's frame and unit.
    Eigen::Vector3d difference = Eigen::Vector3d::Zero();
  };

  double scale = 1;  // the survey's unit for one of the model's
  std::vector<Point> points;
};

// Of points' positions. None if there are fewer than three, or if they are on a
// line.
std::optional<CheckPoints> CompareWithSurvey(
    const Model& model, const std::vector<KnownPosition>& surveyed);

// What one run of `krot bundle_adjuster` did.
struct AdjustmentReport {
  RunRecord run;
  AdjustModelSummary summary;
  std::optional<CheckPoints> check_points;
};

// For the terminal: errors before and after, what took part, why it ended.
std::string AdjustmentTable(const AdjustmentReport& report);

// report.json; the keys are listed in docs/cli.md. What is not known is null.
// `model` is the one that is written.
std::string AdjustmentJson(const AdjustmentReport& report, const Model& model);

// The same as a protocol to read: with precision, that of every camera, image
// and point.
std::string AdjustmentText(const AdjustmentReport& report, const Model& model);

// What both say of the precision: sigma0, redundancy, standard deviations and
// reliability.
nlohmann::ordered_json PrecisionJson(const AdjustmentPrecision& precision,
                                     const Model& model);
// Null where there are none.
nlohmann::ordered_json CheckPointsJson(const std::optional<CheckPoints>& check);
std::string PrecisionSentence(const AdjustmentPrecision& precision);

// Why there is no model below the cap, with the bound that proves it if one
// does. Requires the termination kInfeasibleStart.
std::string NoModelBelowCapSentence(const AdjustModelSummary& summary);

// "nothing to adjust: ...". Requires the termination kNothingToAdjust.
std::string NothingToAdjustSentence(const BundleAdjustmentSummary& summary);

// As report.json has it: "converged", "max_iterations", ...
std::string AdjustmentTerminationName(BundleAdjustmentTermination termination);

// The first `max_positions` known positions of a support; empty without any.
std::string PositionsTable(const std::vector<SupportPosition>& positions,
                           int max_positions);

// The `max_observations` worst of a support.
std::string SupportTable(const std::vector<SupportObservation>& support,
                         int max_observations);

// An accepted certificate as a text for the terminal: the bound, the model's
// own cost and gap, and the `max_observations` worst of the support.
std::string CertificateTable(const CertificateVerdict& verdict,
                             int max_observations);

// Of an accepted certificate of baselines the `max_pairs` pairs of which the
// least share is explained.
std::string BaselineTable(const Model& model,
                          const BaselineCertificate& certificate,
                          int max_pairs);

// What certificate_checker says of an accepted file of conflicts.
std::string ConflictTable(const ConflictVerdict& verdict);

// report.json of certificate_checker for what it accepted: one of the three.
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
  double seconds_check = 0;                // wall clock
  // For the commands that come next; "": a name in capitals stands for it.
  std::string input_path;
  std::string output_path;
  std::string database_path;
};

// Why an image has its verdict; empty for one that is fine.
std::string ReasonOf(const ModelCheck& check, const ImageCheck& image);

// "2 of 41 images and 37 of 20,785 observations are wrong", or "Nothing is
// wrong", and why.
std::string CheckSentence(const CheckReport& report);

// For the terminal: the sentence, what matches say (PairTable), images by
// verdict, observations by w, tracks of two points, what to do next. At most
// max_rows of each.
std::string CheckTable(const CheckReport& report, int max_rows);

// report.json; the keys are listed in docs/cli.md. What is not known is null.
std::string CheckJson(const CheckReport& report);

// How two models differ: `krot model_comparer`.
struct ComparisonReport {
  std::string version;
  ComparisonSummary summary;
  Contradictions contradictions1;  // of the models as their files have them
  Contradictions contradictions2;
  std::optional<DistanceReport> distances;
  // Accepted ones, where given.
  std::optional<CertificateVerdict> certificate1;
  std::optional<CertificateVerdict> certificate2;
};

// "frame", "similarity" or "none".
std::string AlignmentName(AlignmentKind kind);

// For the terminal; of images, points and supports the `max_rows` worst.
std::string ComparisonTable(const ComparisonReport& report, int max_rows);

// The same as JSON, with all shared images; docs/formats.md lists the keys.
std::string ComparisonJson(const ComparisonReport& report);

// COLMAP's errors.csv: one line per shared image with a pose in both, holding
// the angle between its rotations in degrees and the distance of its centres;
// then its name.
std::string PoseErrorsCsv(const ComparisonSummary& summary);

// What EstimateNoise says, in figures; of none where nothing can be told.
struct NoiseFigures {
  struct Quantile {
    double share = 0;  // of the tested observations, that w is not above
    double w = 0;
    double gaussian_w = 0;  // the same of Gaussian noise
  };

  std::optional<double> sigma_px;
  std::optional<double> cauchy_scale_px;
  double critical_w = 0;
  int64_t num_tested = 0;
  int64_t num_above = 0;
  // Observations whose error would not show in one direction, or in any.
  int64_t num_half_controlled = 0;
  int64_t num_uncontrolled = 0;
  std::vector<Quantile> quantiles;
  std::vector<int64_t> num_above_by_image;  // as Model::images
};

// What a model's errors, tracks and depths look like: `krot model_analyzer`.
struct ModelReport {
  ColmapStatistics colmap;
  Contradictions contradictions;  // of the model as its files have it
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
  TriangulationAngleStatistics triangulation_angle;
  std::optional<DistanceReport> distances;
};

// Requires a valid model (ValidateModel) and num_worst >= 0.
// O(sum of squared track lengths).
ModelReport AnalyzeModel(const Model& model, int num_worst,
                         int num_threads = -1);

// For the terminal: COLMAP's figures under COLMAP's names, then KROT's. Cameras
// and images are the `max_rows` with the largest errors.
std::string ModelTable(const ModelReport& report, int max_rows);

// One line per camera, then per image, behind a line of names (docs/cli.md).
std::string ModelCsv(const ModelReport& report);

// The same as JSON, with all images; the keys are listed in docs/cli.md.
std::string ModelJson(const ModelReport& report, const std::string& version);

// What one run of `krot outlier_filter` did.
struct OutlierReport {
  RunRecord run;
  OutlierFilterSummary summary;
};

// "removed 74 of 26,268; at least 61 must go (61 disjoint conflicts,
// certificate)".
std::string BracketSentence(const OutlierFilterSummary& summary);

// Why positions from nothing are not to be relied on, and what to do next:
// parts whose scale hardly anything holds, a bound beyond reason, or more
// observations that do not fit than do. Empty if they are, or have not been
// found from nothing.
std::string UnreliableSentence(const OutlierFilterSummary& summary);

// [{"image_names": ..}], of OutlierFilterSummary::weak_parts.
nlohmann::ordered_json WeakPartsJson(const OutlierFilterSummary& summary);

// For the terminal: the bracket, errors before and after, who is to blame.
std::string OutlierTable(const OutlierReport& report);

// report.json; the keys are listed in docs/cli.md. What is not known is null.
std::string OutlierJson(const OutlierReport& report);

// The error profile alone (docs/formats.md), which there must be.
std::string ProfileJson(const OutlierReport& report);

// One line per removed observation, worst first, behind a line of names.
std::string OutlierCsv(const OutlierFilterSummary& summary);

// As --OutlierFilter.method takes it.
std::string OutlierMethodName(OutlierMethod method);

// What one run of `krot solver` or `krot point_triangulator` did.
struct SolveReport {
  RunRecord run;
  std::string command;
  std::string method;
  SolveSummary summary;
  // Where not everything was to stay; its own solve is the summary above.
  std::optional<OutlierFilterSummary> outliers;
  // Where positions and points come from a database's.
  std::optional<MatchTracksSummary> matches;
  // Of known positions, where they have one of their own; and whether the model
  // is written in it.
  std::optional<PositionFrame> position_frame;
  bool is_in_position_frame = false;
  std::optional<DistanceReport> distances;  // before and after
};

// A row for each known distance: what is known, its length in each model, in
// metres by that model's scale, and which contradict the others. `heads` name
// the models.
std::string DistanceTable(const DistanceReport& report,
                          const std::vector<std::string>& heads);

// What contradicts the others in the last model, a sentence each.
std::vector<std::string> ContradictedDistances(const DistanceReport& report);

// "57 of 60 positions agree with the model, to 0.631 m (median); ..."
std::string PositionFrameSentence(const PositionFrame& frame);

// "the position of a.jpg is 123.4 m off, its radius is 2 m: left out".
std::string WrongPositionSentence(const WrongPosition& wrong);

// For the terminal: errors before and after, what was left out, why it ended,
// how long it took.
std::string SolveTable(const SolveReport& report);

// report.json; the keys are listed in docs/cli.md. What is not known is null.
std::string SolveJson(const SolveReport& report);

LeftOutCounts LeftOutByReason(const SolveSummary& summary);

// "nothing to solve: 1000 observations left out (short_track 1000)". Requires
// the termination kNothingToSolve.
std::string NothingToSolveSentence(const SolveSummary& summary);

// The points in whose tracks an image occurs more than once, of the support.
std::vector<Point3DId> SameImageInSupport(const SolveSummary& summary);

// Whether the cost is, to the digits shown, the largest error of the model that
// is written: it is with p = 2 if every observation takes part.
bool CostIsMaximum(const SolveSummary& summary);

// The maximum of the model that is written and what is proved of it, and what
// is not: on the terminal, in the report and on the page.
std::string VerdictSentence(const SolveSummary& summary);

// "0.0100 %", "less than 0.0001 %".
std::string GapPercent(double relative_gap);

// "proved to be within 0.0100 % of the lowest".
std::string GapWords(double relative_gap);

// "2 observations are too few to determine 2 frames and 1 point". Requires
// is_underdetermined.
std::string UnderdeterminedWords(const SolveSummary& summary);

// "the gap asked for is not reached after 300 iterations, as many as ...".
std::string MissedGapSentence(const SolveSummary& summary);

// That of the last round's linear problem; none if nothing is proved of it.
std::optional<double> LinearRelativeGap(const SolveSummary& summary);

// What was written instead of a better model. Requires is_given_back.
std::string GivenBackSentence(const SolveSummary& summary);

// As --Solver.method takes it.
std::string MethodName(SolveMethod method);

// As --Solver.norm takes it: "1", "2", "inf", "1.5".
std::string NormName(Norm norm);

// The errors before, after and, if there was such a step, polished, which a
// sentence then explains.
std::string SolveErrorTable(const SolveSummary& summary);

// What one run of `krot tolerance_analyzer` found.
struct ToleranceReport {
  RunRecord run;
  ToleranceSummary summary;
  PixelErrorStatistics pixel_error_before;  // of the input
  PixelErrorStatistics pixel_error_after;   // of the model around which
};

// For the terminal: what holds place and scale, and the proved boxes; of more
// than `max_rows` those that are not bounded, then the widest.
std::string ToleranceTable(const ToleranceReport& report, int max_rows);

// report.json; the keys are listed in docs/cli.md. An end without a proof is
// null.
std::string ToleranceJson(const ToleranceReport& report);

// One line per coordinate behind a line of names (docs/formats.md).
std::string ToleranceCsv(const ToleranceSummary& summary);

}  // namespace krot::internal
