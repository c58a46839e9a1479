// krot_benchmark as its users run it.

#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tools/benchmark/process.h"

namespace krot::internal {
namespace {

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

}  // namespace
}  // namespace krot::internal
