#include "krot/report/reports.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "krot/synthetic/scene.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

using ::testing::HasSubstr;

SceneOptions SceneWithRepeatedImages() {
  SceneOptions options = SceneOf(5, 50, 4, 0.5);
  options.duplicate_ratio = 0.1;
  return options;
}

TEST(AnalyzeModel, CountsTracksThatHoldAnImageTwice) {
  SceneOptions options = SceneWithRepeatedImages();
  EXPECT_GT(AnalyzeModel(SynthesizeScene(options).model, 0)
                .num_tracks_with_repeated_image,
            0);
  options.duplicate_ratio = 0;
  EXPECT_EQ(AnalyzeModel(SynthesizeScene(options).model, 0)
                .num_tracks_with_repeated_image,
            0);
}

TEST(AnalyzeModel, SplitsTheErrorsByImageAndByCamera) {
  const Model model = SynthesizeScene(SceneWithRepeatedImages()).model;
  const ModelReport report = AnalyzeModel(model, 4);
  EXPECT_EQ(report.worst.size(), 4u);
  int64_t count = 0;
  double max = 0;
  for (const ImageErrors& image : report.images) {
    count += image.errors.count;
    max = std::max(max, image.errors.max);
  }
  EXPECT_EQ(count, report.pixel_error.count);
  EXPECT_EQ(max, report.pixel_error.max);
  ASSERT_EQ(report.cameras.size(), 1u);
  EXPECT_EQ(report.cameras[0].errors.max, report.pixel_error.max);
}

TEST(AnalyzeModel, CountsWhatTheNoiseDoesNotExplainAndWhatNothingChecks) {
  SceneOptions options = SceneWithRepeatedImages();
  options.num_points = 1000;
  options.duplicate_ratio = 0;
  options.outlier_ratio = 0.02;
  options.track_length = 3;
  const Model model = SynthesizeScene(options).ground_truth;
  const NoiseFigures noise = AnalyzeModel(model, 0).noise;
  EXPECT_NEAR(*noise.sigma_px, 0.5, 0.05);
  const ModelNoise whole = EstimateNoise(model, {}, {});
  int64_t num_above = 0, num_half = 0;
  for (const ObservationNoise& one : whole.observations) {
    num_above += one.w > noise.critical_w;
    num_half += one.num_controlled == 1;
  }
  EXPECT_GT(num_above, 10);
  EXPECT_EQ(noise.num_above, num_above);
  EXPECT_EQ(noise.num_half_controlled, num_half);
  EXPECT_GE(num_half, 2 * TrackLengthHistogram(model).at(2));
  for (const NoiseFigures::Quantile& one : noise.quantiles) {
    const auto count = [&](const auto& is_counted) {
      return static_cast<double>(
          std::count_if(whole.observations.begin(), whole.observations.end(),
                        [&](const auto& o) {
                          return o.num_controlled > 0 && is_counted(o);
                        }));
    };
    const double share = one.share * static_cast<double>(noise.num_tested);
    EXPECT_GE(count([&](const auto& o) { return o.w <= one.w; }), share);
    EXPECT_LT(count([&](const auto& o) { return o.w < one.w; }), share);
  }
  EXPECT_THAT(ModelTable(AnalyzeModel(model, 0), 0),
              HasSubstr(std::to_string(num_above) + " of " +
                        std::to_string(noise.num_tested) +
                        " observations are more than that noise explains"));
}

TEST(ModelTable, SaysWhereNoNoiseCanBeTold) {
  const ModelReport report = AnalyzeModel(Model(), 0);
  EXPECT_THAT(ModelTable(report, 0), HasSubstr("cannot be told"));
  EXPECT_TRUE(
      nlohmann::json::parse(ModelJson(report, "1.2.3"))["noise"]["sigma_px"]
          .is_null());
}

TEST(ModelTable, ShowsTheWorstImageFirst) {
  const ModelReport report =
      AnalyzeModel(SynthesizeScene(SceneWithRepeatedImages()).model, 3);
  const std::string table = ModelTable(report, 1);
  EXPECT_THAT(table, HasSubstr("Images: 5\n"));
  EXPECT_THAT(table, HasSubstr("the 1 of 5 with the largest errors"));
  for (const ImageErrors& image : report.images) {
    const std::string row =
        "\n  " + std::to_string(image.image_id) + " " + image.image_name;
    const size_t begin = table.find("By image");
    const size_t end = table.find("Worst observations");
    EXPECT_EQ(table.substr(begin, end - begin).find(row) != std::string::npos,
              image.errors.max == report.pixel_error.max);
  }
}

TEST(ModelJson, HoldsAllImagesEvenWithNamesThatAreNoUtf8) {
  Model model = SynthesizeScene(SceneWithRepeatedImages()).model;
  model.images[2].name = "\xff.jpg";
  const nlohmann::json json =
      nlohmann::json::parse(ModelJson(AnalyzeModel(model, 2), "1.2.3"));
  EXPECT_EQ(json["version"], "1.2.3");
  EXPECT_EQ(json["images"].size(), 5u);
  EXPECT_EQ(json["images"][2]["image_name"], "\xef\xbf\xbd.jpg");
  EXPECT_EQ(json["worst"].size(), 2u);
  EXPECT_EQ(json["depth"]["count"], model.track_elements.size());
}

TEST(ModelJson, SaysNullForErrorsThatNoObservationHas) {
  const nlohmann::json json =
      nlohmann::json::parse(ModelJson(AnalyzeModel(Model(), 2), "1.2.3"));
  EXPECT_EQ(json["pixel_error"]["count"], 0);
  EXPECT_TRUE(json["pixel_error"]["max"].is_null());
}

}  // namespace
}  // namespace krot::internal
