#include "krot/report/model_report.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "krot/synthetic/scene.h"

namespace krot {
namespace {

using ::testing::HasSubstr;

SceneOptions SceneWithRepeatedImages() {
  SceneOptions options;
  options.num_frames = 5;
  options.num_points = 50;
  options.track_length = 4;
  options.pixel_noise = 0.5;
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
}  // namespace krot
