#include <chrono>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "krot/base/context.h"
#include "tools/benchmark/model_list.h"
#include "tools/benchmark/process.h"
#include "tools/benchmark/time_limit.h"
#include "tools/benchmark/timing.h"

namespace krot::internal {
namespace {

// krot_benchmark as its users run it.

int ExitCodeOf(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), KROT_BENCHMARK_EXECUTABLE);
  return RunProcess(arguments).exit_code;
}

TEST(BenchmarkCommand, HelpsWithEveryCommand) {
  EXPECT_EQ(ExitCodeOf({}), 0);
  for (const char* command :
       {"triangulation", "blocks", "known_rotation", "sweep", "scaling",
        "joint", "positioning", "summary"}) {
    EXPECT_EQ(ExitCodeOf({command, "--help"}), 0) << command;
  }
}

TEST(BenchmarkCommand, RefusesWhatItDoesNotKnow) {
  EXPECT_EQ(ExitCodeOf({"triangle"}), 1);
  EXPECT_EQ(ExitCodeOf({"triangulation", "--repeats", "0"}), 1);
  EXPECT_EQ(ExitCodeOf({"joint"}), 1);
  EXPECT_EQ(ExitCodeOf({"blocks"}), 1);
  EXPECT_EQ(ExitCodeOf({"summary", "--report_path", "no_such_folder"}), 1);
  EXPECT_EQ(ExitCodeOf({"triangulation", "--figure4", "0", "--input_path",
                        "no_such_folder"}),
            2);
  EXPECT_EQ(ExitCodeOf({"triangulation", "--report_path", "no/such/folder/f"}),
            5);
}

TEST(BenchmarkCommand, ReportsTheSameAsJsonAndAsPlot) {
  const ScratchFolder folder;
  const std::string report = folder / "report.json";
  ASSERT_EQ(ExitCodeOf({"triangulation", "--repeats", "1", "--report_path",
                        report, "--plot_path", folder / "plot.gp"}),
            0);
  std::ifstream stream(report);
  const auto json = nlohmann::json::parse(stream);
  EXPECT_EQ(json["command"], "triangulation");
  EXPECT_GE(json["machine"]["cores"], 1);
  const auto& table = json["tables"][0];
  EXPECT_EQ(table["name"], "figure4");
  EXPECT_EQ(table["rows"].size(), 8u);
  for (const auto& row : table["rows"]) EXPECT_GT(row["Gugat"], 0);
  EXPECT_GT(std::filesystem::file_size(folder / "plot.gp"), 1000u);
}

TEST(BenchmarkCommand, MeasuresModelsOfItsOwn) {
  const ScratchFolder folder;
  const std::string report = folder / "report.json";
  ASSERT_EQ(ExitCodeOf({"scaling", "--max_observations", "10000", "--vary", "0",
                        "--report_path", report}),
            0);
  std::ifstream stream(report);
  const auto rows = nlohmann::json::parse(stream)["tables"][0]["rows"];
  ASSERT_EQ(rows.size(), 2u);
  for (const auto& row : rows) {
    EXPECT_GT(row["observations"], 1000);
    EXPECT_GT(row["us in all"], 0);
  }
}

TEST(TimeLimit, RaisesItsFlagOnceItHasPassed) {
  const Timer timer;
  const TimeLimit limit(0.02);
  while (!IsCancelled(limit.flag()) && timer.Seconds() < 60) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  EXPECT_TRUE(IsCancelled(limit.flag()));
  EXPECT_GE(timer.Seconds(), 0.02);
}

TEST(TimeLimit, IsForgottenOnceItIsGone) {
  const Timer timer;
  {
    const TimeLimit limit(3600);
    EXPECT_FALSE(IsCancelled(limit.flag()));
  }
  EXPECT_LT(timer.Seconds(), 60);
}

TEST(MedianOf, IsTheMiddleOrTheMeanOfTheTwoThere) {
  EXPECT_EQ(MedianOf({3}), 3);
  EXPECT_EQ(MedianOf({9, 1, 2}), 2);
  EXPECT_EQ(MedianOf({4, 1, 2, 9}), 3);
}

TEST(TimeInterleaved, RunsInTurnAndAsOftenAsAsked) {
  std::string order;
  const std::vector<double> seconds = TimeInterleaved(
      {[&order] { order += 'a'; }, [&order] { order += 'b'; }}, /*repeats=*/3,
      /*min_seconds=*/0);
  EXPECT_EQ(order, "ababab");
  ASSERT_EQ(seconds.size(), 2u);
}

TEST(TimeInterleaved, TellsALongRunFromAShortOne) {
  const auto work = [](int64_t count) {
    return [count] {
      volatile double sum = 0;
      for (int64_t i = 0; i < count; ++i) sum = sum + 1;
    };
  };
  const std::vector<double> seconds = TimeInterleaved(
      {work(1000), work(100000)}, /*repeats=*/5, /*min_seconds=*/1e-3);
  EXPECT_GT(seconds[1], 10 * seconds[0]);
}

using testing::ElementsAre;
using testing::HasSubstr;

BenchmarkOptions Models(const std::vector<std::string>& paths) {
  BenchmarkOptions options;
  options.log.level = 0;
  options.input_paths = paths;
  return options;
}

TEST(MeasureModels, NamesWhatItLeavesOutAndGoesOn) {
  std::vector<std::string> measured;
  const auto left_out =
      MeasureModels(Models({"a", "b", "c"}), [&](const std::string& path) {
        if (path == "b") throw std::runtime_error("b is broken");
        measured.push_back(path);
      });
  EXPECT_THAT(measured, ElementsAre("a", "c"));
  EXPECT_THAT(left_out, ElementsAre(HasSubstr("b is broken")));
}

TEST(MeasureModels, FailsWhereNoModelIsLeft) {
  EXPECT_THROW(MeasureModels(Models({"a", "b"}),
                             [](const std::string& path) {
                               throw std::invalid_argument(path);
                             }),
               std::invalid_argument);
}

TEST(MeasureModels, IsContentWithoutAny) {
  EXPECT_TRUE(MeasureModels(Models({}), [](const std::string&) {}).empty());
}

}  // namespace
}  // namespace krot::internal
