#include "krot/report/reports.h"

#include <cmath>
#include <optional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace krot::internal {
namespace {

using ::testing::HasSubstr;
using ::testing::Matches;
using ::testing::Not;

SolveReport SomeReport() {
  SolveReport report;
  report.run.version = "1.2.3";
  report.command = "solver";
  report.method = "res_int";
  report.run.threads = 2;
  report.run.seed = 18446744073709551615u;
  SolveSummary& summary = report.summary;
  summary.termination = SolveTermination::kStalled;
  summary.method = SolveMethod::kResInt;
  summary.num_frames = 1;
  summary.num_observations = 8;
  summary.left_out = {2, 0, 3, 0, 0};
  summary.cost_initial = 4;
  summary.cost_final = 0.1;
  summary.sweeps = {{0.2, 0.5}, {0.1, 0.75}};
  summary.pixel_error_before = {4.5, 3, 1, 1.5, 8, 0};
  summary.pixel_error_after = {0.25, 0.2, 0.125, 0.15, 7, 1};
  return report;
}

TEST(SolveJson, KeepsEveryBitOfItsNumbers) {
  const nlohmann::json json = nlohmann::json::parse(SolveJson(SomeReport()));
  EXPECT_EQ(json["cost_final"].get<double>(), 0.1);
  EXPECT_EQ(json["seed"].get<uint64_t>(), 18446744073709551615u);
  EXPECT_EQ(json["sweeps"][1]["seconds"], 0.75);
  EXPECT_EQ(json["pixel_error"]["after"]["p99"], 0.2);
  EXPECT_EQ(json["left_out"]["behind"], 2);
  EXPECT_EQ(json["left_out"]["short_track"], 3);
  EXPECT_EQ(json["left_out"]["no_pose"], 0);
}

TEST(SolveJson, SaysNullForErrorsThatNoObservationHas) {
  SolveReport report = SomeReport();
  report.summary.pixel_error_after = {};
  const nlohmann::json json = nlohmann::json::parse(SolveJson(report));
  EXPECT_TRUE(json["pixel_error"]["after"]["max"].is_null());
  EXPECT_EQ(json["pixel_error"]["before"]["max"], 4.5);
}

TEST(SolveTable, ShowsErrorsCountsAndWhyItEnded) {
  const std::string table = SolveTable(SomeReport());
  EXPECT_THAT(table, HasSubstr("max error                    4.5000  0.2500"));
  EXPECT_THAT(table, HasSubstr("cost (max optimised, p = 2)  4.0000  0.1000"));
  EXPECT_THAT(table, HasSubstr("1 frame, 0 images"));
  EXPECT_THAT(table,
              HasSubstr("5 observations left out (behind 2, short_track 3)"));
  EXPECT_THAT(table, HasSubstr("1 observation without a finite error"));
  EXPECT_THAT(table, HasSubstr("Stalled after 2 sweeps"));
  EXPECT_THAT(table, HasSubstr("Maximum 0.1000 px over the observations in the "
                               "optimisation, not proved optimal"));
  EXPECT_THAT(table, Not(HasSubstr("support")));
}

TEST(SolveTable, HasNoRowForACostThatIsTheMaximum) {
  SolveReport report = SomeReport();
  report.summary.pixel_error_after.max = report.summary.cost_final;
  EXPECT_THAT(SolveTable(report), Not(HasSubstr("cost (")));
  EXPECT_THAT(SolveTable(report), HasSubstr("Maximum 0.1000 px, not proved"));
  report.summary.norm = Norm::LInf();
  EXPECT_THAT(SolveTable(report), HasSubstr("cost (max optimised, p = inf)"));
  EXPECT_THAT(SolveTable(report), HasSubstr("Maximum 0.1000 px (p = inf), "));
}

// A certified solve with a support of twelve.
SolveReport CertifiedReport() {
  SolveReport report = SomeReport();
  SolveSummary& summary = report.summary;
  summary.method = SolveMethod::kAuto;
  summary.termination = SolveTermination::kGapReached;
  summary.num_components = 2;
  summary.cost_final = summary.pixel_error_after.max = 3.10106;
  summary.is_certified = true;
  summary.lower_bound = 3.10105;
  summary.relative_gap = 3.2e-6;
  summary.seconds_certify = 0.25;
  summary.num_observations = 1000;
  summary.num_working_observations = 39;
  summary.iterations = {{std::nullopt, std::nullopt, std::nullopt, 0.5, 100.0},
                        {4, std::nullopt, 0.5, 1, std::nullopt},
                        {3.5, 3.0, 0.1, 2, std::nullopt}};
  for (uint32_t n = 0; n < 12; ++n) {
    summary.support.push_back({n + 1, "image\xff.jpg", n, 70 + n, 1 / 12.0, 3});
  }
  return report;
}

TEST(SolveJson, HoldsBoundIterationsAndSupport) {
  const nlohmann::json json =
      nlohmann::json::parse(SolveJson(CertifiedReport()));
  EXPECT_EQ(json["termination"], "gap_reached");
  EXPECT_EQ(json["certified"], true);
  EXPECT_EQ(json["lower_bound"], 3.10105);
  EXPECT_EQ(json["relative_gap"], 3.2e-6);
  EXPECT_EQ(json["seconds"]["certify"], 0.25);
  EXPECT_EQ(json["working_observations"], 39);
  ASSERT_EQ(json["iterations"].size(), 3u);
  EXPECT_EQ(json["iterations"][0]["method"], "feasible_start");
  EXPECT_EQ(json["iterations"][0]["target"], 100);
  for (const char* key : {"cost", "lower_bound", "gap"}) {
    EXPECT_TRUE(json["iterations"][0].at(key).is_null());
  }
  EXPECT_EQ(json["iterations"][1]["method"], "joint");
  EXPECT_TRUE(json["iterations"][1]["lower_bound"].is_null());
  EXPECT_TRUE(json["iterations"][1].at("target").is_null());
  EXPECT_EQ(json["iterations"][2]["lower_bound"], 3.0);
  EXPECT_EQ(json["iterations"][2]["cost"], 3.5);
  EXPECT_EQ(json["iterations"][2]["gap"], 0.1);
  EXPECT_EQ(json["iterations"][2]["seconds"], 2);
  ASSERT_EQ(json["support"].size(), 12u);
  EXPECT_EQ(json["support"][11]["image_id"], 12);
  EXPECT_EQ(json["support"][11]["point2D_idx"], 11);
  EXPECT_EQ(json["support"][11]["point3D_id"], 81);
  EXPECT_EQ(json["support"][11]["multiplier"], 1 / 12.0);
  EXPECT_EQ(json["support"][11]["error_px"], 3);
}

TEST(SolveTable, GivesTheVerdictAndTheTenWorstOfTheSupport) {
  const std::string table = SolveTable(CertifiedReport());
  EXPECT_THAT(table,
              HasSubstr("Maximum 3.1011 px, proved to be within 0.0003 % "
                        "of the lowest: no translations and points "
                        "bring all errors below 3.1010 px.\n"));
  EXPECT_THAT(table, HasSubstr("12 observations, worst first; the first 10"));
  EXPECT_THAT(table, HasSubstr("  79  "));
  EXPECT_THAT(table, Not(HasSubstr("  80  ")));
  EXPECT_THAT(table, HasSubstr("Ended after 1 iteration to a start, 2 joint "
                               "iterations on 3 % of the observations and 2 "
                               "sweeps: the lowest maximum is known to the gap "
                               "asked for."));
  EXPECT_THAT(table, HasSubstr("falls into 2 components"));
}

// Ended with a proof of the linear problem that is better than the true one.
SolveReport CurvedReport() {
  SolveReport report = CertifiedReport();
  SolveSummary& summary = report.summary;
  summary.termination = SolveTermination::kStalled;
  summary.cost_final = summary.pixel_error_after.max = 4;
  summary.lower_bound = 3.98;
  summary.relative_gap = 0.005;
  summary.rounds = {{3.5, 3.25, 0.5, 4.5, std::nullopt, 1},
                    {4, 3.9998, 1, 4, 3.98, 2}};
  return report;
}

TEST(SolveTable, SaysBothGapsWhereTheTrueOneIsTheLarger) {
  const std::string both =
      " With every error linearised at this estimate the gap is 0.0050 %";
  SolveReport report = CurvedReport();
  std::string table = SolveTable(report);
  EXPECT_THAT(table, HasSubstr("proved to be within 0.5000 % of the lowest"));
  EXPECT_THAT(table, HasSubstr("below 3.9800 px." + both));
  EXPECT_THAT(table, HasSubstr("Stalled after 2 rounds, 1 iteration to a "));

  EXPECT_THAT(table, HasSubstr("; the rest is the curvature of lenses"));
  report.summary.at_folds = {{7, "north.jpg", 41, 3}, {8, "south.jpg", 2, 3}};
  EXPECT_THAT(SolveTable(report),
              HasSubstr(both + "; the rest is lost at the edge of a lens: "
                               "point2D 41 of north.jpg lies nearer than the "
                               "maximum to where the projection of camera 3 "
                               "folds or ends, so that no proof can rest on "
                               "it, nor on 1 other. Another camera model may "
                               "suit it better."));

  report.summary.rounds.back().linear_lower_bound = 3.98;
  EXPECT_THAT(SolveTable(report), Not(HasSubstr(both)));
  report.summary.rounds.back().linear_lower_bound.reset();
  EXPECT_THAT(SolveTable(report), Not(HasSubstr(both)));
}

TEST(SolveJson, HoldsEveryRoundAndTheLastOnesLinearProblem) {
  const auto json = nlohmann::json::parse(SolveJson(CurvedReport()));
  ASSERT_EQ(json["rounds"].size(), 2u);
  const nlohmann::json& first = json["rounds"][0];
  EXPECT_EQ(first["linear_cost"], 3.5);
  EXPECT_EQ(first["linear_lower_bound"], 3.25);
  EXPECT_EQ(first["step"], 0.5);
  EXPECT_EQ(first["cost"], 4.5);
  EXPECT_TRUE(first.at("lower_bound").is_null());
  EXPECT_EQ(first["seconds"], 1);
  EXPECT_EQ(json["linear_cost"], 4);
  EXPECT_EQ(json["linear_lower_bound"], 3.9998);
  EXPECT_NEAR(json["linear_relative_gap"].get<double>(), 5e-5, 1e-12);
  EXPECT_EQ(json["is_given_back"], false);
}

TEST(SolveJson, KnowsOfNoLinearProblemWithoutARound) {
  const auto json = nlohmann::json::parse(SolveJson(SomeReport()));
  EXPECT_TRUE(json.at("rounds").empty());
  for (const char* key :
       {"linear_cost", "linear_lower_bound", "linear_relative_gap"}) {
    EXPECT_TRUE(json.at(key).is_null()) << key;
  }
}

TEST(SolveReport, SaysThatTheInputWasGivenBack) {
  SolveReport report = CertifiedReport();
  report.summary.is_given_back = true;
  std::string table = SolveTable(report);
  EXPECT_THAT(table,
              HasSubstr("No better estimate was found: the model is written as "
                        "it was read. It is proved that no translations and "
                        "points bring all errors below 3.1010 px.\n"));
  EXPECT_THAT(table, Not(HasSubstr("Maximum")));
  EXPECT_THAT(table, Not(HasSubstr("cost (")));
  EXPECT_EQ(nlohmann::json::parse(SolveJson(report))["is_given_back"], true);

  report.summary.polish.emplace();
  EXPECT_THAT(SolveTable(report), HasSubstr("the polish began at the model as "
                                            "it was read."));
}

TEST(SolveReport, SaysTheSameOfTheMaximumOnTheTerminalAndInTheReport) {
  for (SolveReport report : {SomeReport(), CertifiedReport(), CurvedReport()}) {
    for (const bool is_finished : {false, true}) {
      if (is_finished) report.summary.finish.emplace();
      const std::string verdict =
          nlohmann::json::parse(SolveJson(report))["verdict"];
      EXPECT_THAT(SolveTable(report), HasSubstr("\n" + verdict + "\n"));
      EXPECT_EQ(verdict, VerdictSentence(report.summary));
      const std::string gap =
          report.summary.is_certified
              ? "proved to be within " +
                    GapPercent(*report.summary.relative_gap) + " of the lowest"
              : "not proved optimal";
      EXPECT_THAT(verdict, HasSubstr(gap));
    }
  }
}

TEST(SolveReport, SaysWhatFellTogether) {
  SolveReport report = CertifiedReport();
  report.summary.collapse.num_points = 100;
  report.summary.collapse.in_camera = {17};
  report.summary.collapse.at_infinity = {1, 2, 3, 4, 5, 6};
  EXPECT_THAT(
      SolveTable(report),
      HasSubstr("1 point came to lie in a camera, where any observation "
                "of it fits: point3D_id 17.\n"
                "6 points came to lie at infinity, as their rays are "
                "parallel: point3D_id 1, 2, 3, 4, 5, ....\n"));
  const auto json = nlohmann::json::parse(SolveJson(report))["collapse"];
  EXPECT_EQ(json["in_camera"], std::vector<int>{17});
  EXPECT_EQ(json["at_infinity"].size(), 6u);
  EXPECT_EQ(json["is_in_one_place"], false);

  report.summary.collapse.num_points = 10;
  report.summary.is_given_back = true;
  report.summary.termination = SolveTermination::kCollapsed;
  EXPECT_THAT(SolveTable(report),
              HasSubstr("No estimate is of use: the errors fall only where of "
                        "10 points that two cameras see 1 lie in a camera and "
                        "6 at infinity"));
}

TEST(SolveReport, SaysWhereErrorsOfZeroSayNothing) {
  SolveReport report = SomeReport();
  report.summary.cost_final = 1e-12;
  report.summary.num_frames = 2;
  report.summary.num_points = 1;
  report.summary.num_observations = 2;
  EXPECT_THAT(SolveTable(report), Not(HasSubstr("too few")));
  report.summary.is_underdetermined = true;
  EXPECT_THAT(SolveTable(report),
              HasSubstr("which says nothing: 2 observations are too few to "
                        "determine 2 frames and 1 point."));
}

TEST(SolveReport, SaysWhatBecameOfTwins) {
  SolveReport report = CertifiedReport();
  report.summary.num_same_image_tracks = 2;
  EXPECT_THAT(SolveTable(report),
              HasSubstr("\n2 tracks with an image more than once.\n"));
  report.summary.left_out[static_cast<size_t>(LeftOut::kSameImage)] = 3;
  report.summary.largest_twin_error = 7.5;
  EXPECT_THAT(SolveTable(report),
              HasSubstr("2 tracks with an image more than once; 3 observations "
                        "that are not the closest of the image and track are "
                        "taken to be wrong: left out, still in the model, and "
                        "in no error above (the largest has 7.5000 px).\n"));
  EXPECT_EQ(nlohmann::json::parse(
                SolveJson(report))["same_image"]["largest_left_out"],
            7.5);
}

TEST(SolveTable, SaysHowMuchTheJointSolverLookedAt) {
  SolveReport report = CertifiedReport();
  report.summary.num_working_observations = 9;
  EXPECT_THAT(SolveTable(report),
              HasSubstr("on less than 1 % of the observations"));
  report.summary.num_working_observations = report.summary.num_observations;
  EXPECT_THAT(SolveTable(report), HasSubstr("on all observations and"));
  report.summary.num_working_observations.reset();
  EXPECT_THAT(SolveTable(report), HasSubstr("2 joint iterations and"));
  report.summary.num_working_observations = 0;  // it had nothing to lower
  EXPECT_THAT(SolveTable(report), HasSubstr("2 joint iterations and"));
}

TEST(SolveReport, SaysWhereNoBoundIsNear) {
  SolveReport report = CertifiedReport();
  report.summary.termination = SolveTermination::kUnproved;
  EXPECT_THAT(SolveTable(report),
              HasSubstr("Gave up after 1 iteration to a start, 2 joint "));
  EXPECT_EQ(nlohmann::json::parse(SolveJson(report))["termination"],
            "unproved");
}

TEST(SolveTable, SaysWhereAllErrorsAreZero) {
  SolveReport report = SomeReport();
  report.summary.cost_final = 2e-14;
  EXPECT_THAT(SolveTable(report),
              HasSubstr("Every error is zero up to rounding (2.0e-14 px"));
}

TEST(SolveReport, NamesWhatDoesNotHoldItsPlace) {
  SolveReport report = SomeReport();
  report.summary.num_images = 5;
  EXPECT_THAT(SolveTable(report), Not(HasSubstr("place and the size")));
  report.summary.loose.images = {{7, "a b.jpg", 4, false, 1234.5678},
                                 {9, "c.jpg", 90, true, 6.7e4}};
  for (Point3DId id = 11; id <= 17; ++id) {
    report.summary.loose.points.push_back({id, 1e-3 * static_cast<double>(id)});
  }
  const std::string table = SolveTable(report);
  EXPECT_THAT(
      table,
      HasSubstr(
          "\n1 image is not held in place: its observations fit as well from "
          "farther away. Check its matches. Moved no farther than needed: "
          "a b.jpg (4 observations, moved by 1235 units).\n"
          "1 image moved farther than cameras are from one another or from "
          "what "
          "they see: c.jpg (90 observations, moved by 6.7e+04 units).\n"
          "The place and the size of the model are those of the other 3 "
          "images.\n"
          "7 points are not determined: the rays are parallel up to noise, and "
          "any distance fits. Moved by at most 0.017 units: point3D_id 11, 12, "
          "13, 14, 15, ....\n"));
  report.summary.num_images = 2;
  EXPECT_THAT(SolveTable(report), Not(HasSubstr("place and the size")));
  const nlohmann::json json = nlohmann::json::parse(SolveJson(report));
  const nlohmann::json& not_held = json["not_held"];
  ASSERT_EQ(not_held["images"].size(), 2);
  EXPECT_EQ(not_held["images"][0]["image_id"], 7);
  EXPECT_EQ(not_held["images"][0]["image_name"], "a b.jpg");
  EXPECT_EQ(not_held["images"][0]["num_observations"], 4);
  EXPECT_EQ(not_held["images"][0]["is_determined"], false);
  EXPECT_EQ(not_held["images"][0]["moved"], 1234.5678);
  EXPECT_EQ(not_held["images"][1]["is_determined"], true);
  ASSERT_EQ(not_held["points"].size(), 7);
  EXPECT_EQ(not_held["points"][6]["point3D_id"], 17);
}

TEST(MissedGapSentence, SaysWhichLimitWasHit) {
  SolveSummary summary = CertifiedReport().summary;
  summary.termination = SolveTermination::kMaxIterations;
  EXPECT_EQ(MissedGapSentence(summary),
            "the gap asked for is not reached: Joint.max_iterations was hit; "
            "the maximum is proved to be within 0.0003 % of the lowest");
  summary.termination = SolveTermination::kStalled;
  summary.relative_gap.reset();
  EXPECT_EQ(MissedGapSentence(summary),
            "the gap asked for is not reached: no further progress was made; "
            "there is no finite maximum");
  summary.lower_bound.reset();
  EXPECT_EQ(MissedGapSentence(summary),
            "the gap asked for is not reached: no further progress was made; "
            "no bound is proved");
}

TEST(NothingToSolve, SaysWhy) {
  SolveSummary summary;
  EXPECT_EQ(NothingToSolveSentence(summary),
            "nothing to solve: the model has no observations "
            "(2D points that see 3D points); krot point_triangulator makes "
            "them from its poses and a database of matches");
  summary.left_out = {0, 1, 1000, 0, 0};
  EXPECT_EQ(NothingToSolveSentence(summary),
            "nothing to solve: 1001 observations left out (undistortion 1, "
            "short_track 1000)");
}

TEST(UnreliableSentence, NamesTheThreeLargestOfManyParts) {
  OutlierFilterSummary summary;
  summary.init = SolveInit::kFeasible;
  for (const size_t num_images : {2u, 5u, 3u, 9u, 2u}) {
    WeakPart& part = summary.weak_parts.emplace_back();
    part.image_names.resize(num_images, "a.jpg");
    part.is_held = false;
  }
  const std::string words = UnreliableSentence(summary);
  for (const char* named : {"9 images (", "5 images (", "3 images ("}) {
    EXPECT_THAT(words, HasSubstr(named));
  }
  EXPECT_THAT(words, Not(HasSubstr("2 images (")));
  EXPECT_THAT(words, HasSubstr("2 smaller parts are not held either"));
}

TEST(UnreliableSentence, SaysWhichImagesAreAComponentOfTheirOwn) {
  OutlierFilterSummary summary;
  summary.init = SolveInit::kFeasible;
  summary.is_bound_beyond_reason = true;
  EXPECT_THAT(UnreliableSentence(summary), HasSubstr("px; look at rotations"));
  WeakPart& part = summary.weak_parts.emplace_back();
  part.image_names = {"b.jpg", "a.jpg"};
  part.is_held = false;
  EXPECT_THAT(UnreliableSentence(summary),
              AllOf(HasSubstr("2 images (a.jpg and b.jpg) share no track with "
                              "the rest: nothing tells their place"),
                    HasSubstr("; if that is so of each part alone, look at")));
}

TEST(UnreliableSentence, SaysThatPairsOfImagesTellNoDistances) {
  OutlierFilterSummary summary;
  summary.init = SolveInit::kFeasible;
  WeakPart& part = summary.weak_parts.emplace_back();
  part.image_names = {"a.jpg", "b.jpg"};
  part.num_tracks = 80;
  part.scale_factor = kInfinity;
  part.is_held = false;
  EXPECT_THAT(UnreliableSentence(summary),
              HasSubstr("80 tracks of two images alone, which tell directions "
                        "but no distances; their scale against the rest is "
                        "not held at all; match more"));
  part.num_of_three = 1;
  EXPECT_THAT(UnreliableSentence(summary),
              HasSubstr("80 tracks, of which 0 agree; their scale"));
}

TEST(UnreliableSentence, SaysByWhichTurnImagesShowNoBaseline) {
  OutlierFilterSummary summary;
  summary.init = SolveInit::kFeasible;
  summary.one_centre_turn_deg = 0;
  EXPECT_THAT(UnreliableSentence(summary),
              AllOf(HasSubstr("to be relied on: the images show no baseline: "
                              "one place of all cameras explains"),
                    Not(HasSubstr("match more"))));
  summary.one_centre_turn_deg = 0.123;
  EXPECT_THAT(UnreliableSentence(summary),
              HasSubstr("no baseline: with rotations turned by at most 0.12 "
                        "degrees, one place of all"));
}

TEST(SolveTable, AsksForAnAdjustmentWhereRoughRotationsSetTheBound) {
  SolveReport report = SomeReport();
  OutlierFilterSummary& outliers = report.outliers.emplace();
  outliers.init = SolveInit::kFeasible;
  outliers.max_error = 40;
  EXPECT_THAT(SolveTable(report), HasSubstr("rotations free"));
  outliers.max_error = 8;
  EXPECT_THAT(SolveTable(report), Not(HasSubstr("rotations free")));
}

TEST(SolveTable, HasNoErrorsWhereThereAreNoPositionsYet) {
  SolveReport report = SomeReport();
  report.summary.pixel_error_before = {};
  EXPECT_THAT(SolveTable(report),
              HasSubstr("max error                         -  0.2500"));
}

CheckReport ReportOfCamera(double asked_px) {
  CheckReport report;
  report.check.is_adjusted = false;
  WrongCamera& camera = report.check.cameras.emplace_back();
  camera.camera_id = 1;
  camera.num_images = 3;
  camera.fault = CameraFault::kFocalLength;
  camera.focal_length_px = 1000;
  camera.asked_focal_length_px = asked_px;
  return report;
}

TEST(CheckSentence, GivesNoNumberOfAFarFocalLength) {
  EXPECT_THAT(CheckSentence(ReportOfCamera(1100)), HasSubstr("about 1100.0"));
  EXPECT_THAT(CheckSentence(ReportOfCamera(300)), HasSubstr("far shorter"));
  EXPECT_THAT(CheckSentence(ReportOfCamera(2000)), HasSubstr("far longer"));
}

// Their mean stands in no file.
TEST(CheckSentence, GivesBothFocalLengthsOfACameraWithTwo) {
  CheckReport report = ReportOfCamera(1010);
  report.check.cameras[0].focal_lengths_px = {900, 1100};
  EXPECT_THAT(CheckSentence(report),
              HasSubstr("its focal lengths are 900.0 and 1100.0 px, and its 3 "
                        "images ask for others, about 1010.0 px in the mean"));
  report.check.cameras[0].focal_lengths_px = {1000, 1000};
  EXPECT_THAT(CheckSentence(report), HasSubstr("focal length is 1000.0 px"));
}

TEST(CheckSentence, BeginsNoSentenceAnewAfterAColon) {
  CheckReport report;
  report.check.sigma_px = 0.5;
  report.check.is_adjusted = false;
  report.check.conventions.emplace();
  EXPECT_THAT(CheckSentence(report),
              HasSubstr("put right: the model is not adjusted"));
}

TEST(ContradictionSentence, DoesNotCountWhatIsMissingAmongErrors) {
  Contradictions contradictions;
  contradictions.num_track_elements = 9;
  contradictions.of_tracks = Contradictions::Fit{0.5, 2, 7};
  EXPECT_THAT(ContradictionSentence(contradictions),
              HasSubstr("the tracks' observations have a median error of "
                        "0.5000 px and a largest of 2.0000 px (beside 7 of "
                        "images or 2D points that the model lacks)"));
  contradictions.of_tracks->median = std::nan("");
  EXPECT_THAT(ContradictionSentence(contradictions),
              HasSubstr("all of the tracks' observations are of images or 2D "
                        "points that the model lacks"));
}

TEST(CheckTable, SaysWhereTheCuredModelHasALargerError) {
  CheckReport check;
  OutlierReport filter;
  const auto says = HasSubstr(
      "The largest error of what is written, 5.0000 px, is above that of what "
      "was read, 4.0000 px");
  for (const double after : {5.0, 3.0}) {
    for (PixelErrorStatistics* errors :
         {&check.pixel_error_after, &filter.summary.pixel_error_after}) {
      errors->max = after;
    }
    check.pixel_error_before.max = 4;
    filter.summary.pixel_error_before.max = 4;
    EXPECT_EQ(Matches(says)(CheckTable(check, 10)), after > 4);
    EXPECT_EQ(Matches(says)(OutlierTable(filter)), after > 4);
  }
}

TEST(CheckSentence, NamesGroupsAndPointsBesideObservations) {
  CheckReport report;
  report.num_observations = 100;
  report.check.sigma_px = 0.5;
  report.check.observations.resize(2);
  report.check.points.resize(50);
  report.check.misplaced_points = {1, 2, 3};
  report.check.pairs.emplace().groups.resize(2);
  EXPECT_THAT(CheckSentence(report),
              AllOf(HasSubstr("2 of 100 observations are wrong"),
                    HasSubstr("; and 3 of 50 3D points lie far"),
                    HasSubstr("; and the images fall into 2 groups")));
  report.check.fits = false;
  EXPECT_THAT(CheckSentence(report), HasSubstr("do not fit the model"));
}

TEST(NormName, IsWhatTheOptionTakes) {
  EXPECT_EQ(NormName(Norm::L1()), "1");
  EXPECT_EQ(NormName(Norm::L2()), "2");
  EXPECT_EQ(NormName(Norm::LInf()), "inf");
  EXPECT_EQ(NormName({1.5}), "1.5");
  EXPECT_EQ(NormName({1e12}), "1e+12");
}

}  // namespace
}  // namespace krot::internal
