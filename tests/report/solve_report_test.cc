#include "krot/report/solve_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace krot {
namespace {

using ::testing::HasSubstr;

SolveReport SomeReport() {
  SolveReport report;
  report.version = "1.2.3";
  report.command = "solver";
  report.method = "res_int";
  report.threads = 2;
  report.seed = 18446744073709551615u;
  SolveSummary& summary = report.summary;
  summary.termination = SolveTermination::kStalled;
  summary.num_frames = 1;
  summary.num_observations = 8;
  summary.left_out = {2, 0, 0, 3, 0, 0};
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
  EXPECT_THAT(table, HasSubstr("max error               4.5000  0.2500"));
  EXPECT_THAT(table, HasSubstr("cost (max, linearised)  4.0000  0.1000"));
  EXPECT_THAT(table, HasSubstr("1 frame, 0 images"));
  EXPECT_THAT(table,
              HasSubstr("5 observations left out (behind 2, short_track 3)"));
  EXPECT_THAT(table, HasSubstr("1 observation without a finite error"));
  EXPECT_THAT(table, HasSubstr("Stalled after 2 sweeps"));
}

TEST(NothingToSolve, SaysWhy) {
  SolveSummary summary;
  EXPECT_EQ(NothingToSolveSentence(summary),
            "nothing to solve: the model has no observations");
  summary.left_out = {0, 1, 0, 1000, 0, 0};
  EXPECT_EQ(NothingToSolveSentence(summary),
            "nothing to solve: 1001 observations left out (undistortion 1, "
            "short_track 1000)");
}

TEST(NormName, IsWhatTheOptionTakes) {
  EXPECT_EQ(NormName(Norm::L1()), "1");
  EXPECT_EQ(NormName(Norm::L2()), "2");
  EXPECT_EQ(NormName(Norm::LInf()), "inf");
  EXPECT_EQ(NormName({1.5}), "1.5");
  EXPECT_EQ(NormName({1e12}), "1e+12");
}

}  // namespace
}  // namespace krot
