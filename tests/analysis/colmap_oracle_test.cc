// COLMAP itself as the judge: what it recomputes must be what we compute.

#include <unistd.h>

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <unordered_map>

#include "krot/analysis/model_statistics.h"
#include "krot/model.h"
#include "krot/model/model_io.h"

namespace krot::internal {
namespace {

namespace fs = std::filesystem;

bool Succeeds(const std::string& command) {
  return std::system(command.c_str()) == 0;
}

// The number behind "label: " in a text.
double Figure(const std::string& text, const std::string& label) {
  const size_t found = text.find(label + ": ");
  if (found == std::string::npos) return -1;
  return std::strtod(text.c_str() + found + label.size() + 2, nullptr);
}

class ColmapOracle : public ::testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    const char* root = std::getenv("KROT_REAL_MODELS");
    if (root == nullptr) GTEST_SKIP() << "KROT_REAL_MODELS is not set";
    if (!Succeeds("command -v colmap > /dev/null")) {
      GTEST_SKIP() << "colmap is not installed";
    }
    input_ = fs::path(root) / GetParam();
    scratch_ = fs::path(::testing::TempDir()) /
               ("krot_colmap_oracle_" + std::to_string(::getpid()));
    fs::remove_all(scratch_);
    fs::create_directories(scratch_ / "output");
    model_ = ReadModel(input_, DetectModelFormat(input_));
  }

  void TearDown() override { fs::remove_all(scratch_); }

  // What the command prints.
  std::string Colmap(const std::string& arguments) {
    const fs::path log = scratch_ / "log";
    EXPECT_TRUE(Succeeds("QT_QPA_PLATFORM=offscreen colmap " + arguments +
                         " > '" + log.string() + "' 2>&1"));
    std::stringstream text;
    text << std::ifstream(log).rdbuf();
    return text.str();
  }

  fs::path input_;
  fs::path scratch_;
  Model model_;
};

TEST_P(ColmapOracle, RecomputesTheErrorsThatWeStore) {
  const fs::path output = scratch_ / "output";
  Colmap(
      "point_filtering --max_reproj_error 1e6 --min_tri_angle 0"
      " --input_path '" +
      input_.string() + "' --output_path '" + output.string() + "'");
  std::unordered_map<Point3DId, double> expected;
  for (const Point3D& point :
       ReadModel(output, ModelFormat::kBinary).points3D) {
    expected[point.id] = point.error;
  }

  UpdatePointErrors(PixelErrors(model_), &model_);
  ASSERT_EQ(expected.size(), model_.points3D.size());
  for (const Point3D& point : model_.points3D) {
    ASSERT_EQ(expected.count(point.id), 1u);
    EXPECT_NEAR(point.error, expected.at(point.id), 1e-6);
  }
}

TEST_P(ColmapOracle, PrintsTheFiguresThatWeCompute) {
  const std::string text =
      Colmap("model_analyzer --path '" + input_.string() + "'");
  const ColmapStatistics ours = ComputeColmapStatistics(model_);
  EXPECT_EQ(Figure(text, "Cameras"), ours.num_cameras);
  EXPECT_EQ(Figure(text, "Images"), ours.num_images);
  EXPECT_EQ(Figure(text, "Registered images"), ours.num_registered_images);
  EXPECT_EQ(Figure(text, "Points"), ours.num_points);
  EXPECT_EQ(Figure(text, "Observations"), ours.num_observations);
  // Printed with six decimals.
  EXPECT_NEAR(Figure(text, "Mean track length"), ours.mean_track_length,
              5.1e-7);
  EXPECT_NEAR(Figure(text, "Mean observations per image"),
              ours.mean_observations_per_image, 5.1e-7);
  EXPECT_NEAR(Figure(text, "Mean reprojection error"),
              ours.mean_reprojection_error, 5.1e-7);
}

INSTANTIATE_TEST_SUITE_P(Local, ColmapOracle,
                         ::testing::Values("crane8_txt", "two_cameras44",
                                           "task41_rigs_frames"),
                         [](const auto& test) {
                           return std::string(test.param);
                         });

}  // namespace
}  // namespace krot::internal
