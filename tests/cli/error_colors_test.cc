#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/analysis/model_statistics.h"
#include "krot/model.h"
#include "krot/model/derived_models.h"
#include "krot/model/rigs.h"
#include "tests/cli/colmap.h"
#include "tests/cli/krot_process.h"
#include "tests/cli/scenes.h"

namespace krot::internal {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::EndsWith;

class ErrorColors : public ::testing::Test {
 protected:
  ErrorColors() { Save(SmallLegacyModel(), folder_ / "model"); }

  KrotResult Analyze(const Words& more) const {
    return RunKrot({"model_analyzer", "--path", folder_ / "model"}, more);
  }

  void ExpectRefused(const Words& more, int exit_code,
                     const std::string& part) const {
    const KrotResult result = Analyze(more);
    EXPECT_THAT(result, IsRefused(exit_code, "krot model_analyzer", part));
    EXPECT_EQ(result.out, "");
  }

  TempFolder folder_;
};

TEST_F(ErrorColors, AreThoseOfTheLargestErrorOfEachTrack) {
  WriteBytes(folder_ / "model/project.ini", "image_path=photos\n");
  const KrotResult result = Succeeded(Analyze(
      {"--error_colors_path", folder_ / "copy", "--error_colors_top", "2.5"}));
  EXPECT_EQ(result.out, Analyze({}).out);
  EXPECT_EQ(ReadBytes(folder_ / "copy/project.ini"), "image_path=photos\n");

  Model expected = SmallLegacyModel();
  const std::vector<double> errors_px = PixelErrors(expected);
  UpdatePointErrors(errors_px, &expected);
  ColorPointsByError(errors_px, 2.5, &expected);
  EXPECT_THAT(Load(folder_ / "copy"), IsModel(expected));
}

TEST_F(ErrorColors, AreReadByColmap) {
  if (!HasColmap()) GTEST_SKIP() << "colmap is not installed";
  Succeeded(Analyze({"--error_colors_path", folder_ / "copy"}));
  fs::create_directory(folder_ / "text");
  ASSERT_TRUE(
      RunColmap({"model_converter", "--input_path", folder_ / "copy",
                 "--output_path", folder_ / "text", "--output_type", "TXT"},
                folder_ / "log"))
      << ReadBytes(folder_ / "log");
  const Model copy = Load(folder_ / "copy");
  const Model text = Load(folder_ / "text");
  ASSERT_EQ(text.points3D.size(), copy.points3D.size());
  for (const Point3D& point : text.points3D) {
    const auto is_same = [&point](const Point3D& other) {
      return other.id == point.id && other.color == point.color;
    };
    EXPECT_TRUE(
        std::any_of(copy.points3D.begin(), copy.points3D.end(), is_same));
  }
}

TEST_F(ErrorColors, AreRefusedWhereTheyHaveNoPlace) {
  const std::string model = folder_ / "model";
  ExpectRefused({"--error_colors_path", model, "--overwrite", "1"}, 1,
                "must not be the model itself");
  ExpectRefused({"--error_colors_top", "3"}, 1, "give --error_colors_path");
  ExpectRefused({"--overwrite", "1"}, 1, "give --error_colors_path");
  ExpectRefused({"--error_colors_path", folder_ / "copy",  //
                 "--error_colors_top", "0"},
                1, "--error_colors_top");
  EXPECT_FALSE(fs::exists(folder_ / "copy"));

  Save(SmallLegacyModel(), folder_ / "copy");
  ExpectRefused({"--error_colors_path", folder_ / "copy"}, 5, "overwrite");
  Succeeded(Analyze({"--error_colors_path", folder_ / "copy",  //
                     "--overwrite", "1"}));
}

// What no adjustment mends is said by the commands that adjust and describe,
// and what they advise helps.
class LastingFaultsOfAModel : public ::testing::Test {
 protected:
  LastingFaultsOfAModel() {
    SceneOptions options = SmallScene();
    options.num_frames = 8;
    options.num_points = 200;
    model_ = SynthesizeScene(options).ground_truth;
  }

  // What bundle_adjuster says of model_, and then model_analyzer of the result.
  Words WhatIsSaid() const {
    Save(model_, folder_ / "input");
    const KrotResult adjusted =
        Succeeded(RunKrot({"bundle_adjuster", "--input_path", folder_ / "input",
                           "--output_path", folder_ / "adjusted"}));
    const KrotResult analyzed =
        Succeeded(RunKrot({"model_analyzer", "--path", folder_ / "adjusted"}));
    return {adjusted.out, analyzed.out};
  }

  // Of tracks that the first five images and the last three see, those keep
  // them.
  void FallApart() {
    const std::vector<int32_t> image_of = ImagesOfElements(model_);
    std::vector<char> is_removed(model_.track_elements.size(), 0);
    for (const Point3D& point : model_.points3D) {
      for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
        is_removed[e] = (image_of[e] < 5) != (image_of[point.track_begin] < 5);
      }
    }
    model_ = RemoveObservations(model_, is_removed).model;
  }

  Model model_;
  TempFolder folder_;
};

TEST_F(LastingFaultsOfAModel, AreNotSaidWhereThereAreNone) {
  for (const std::string& said : WhatIsSaid()) {
    EXPECT_THAT(said, AllOf(Not(HasSubstr("falls into")),
                            Not(HasSubstr("in the camera itself"))));
  }
}

TEST_F(LastingFaultsOfAModel, PartsThatShareNoTrackAreCountedAndThenListed) {
  FallApart();
  for (const std::string& said : WhatIsSaid()) {
    EXPECT_THAT(said,
                HasSubstr("\nThe model falls into 2 parts that share no track "
                          "(3 of 8 images are outside the largest), so none "
                          "tells where they stand relative to each other, nor "
                          "in which scale; krot model_checker lists them.\n"));
  }
  const KrotResult checked =
      RunKrot({"model_checker", "--input_path", folder_ / "adjusted"});
  EXPECT_THAT(checked.out,
              AllOf(HasSubstr("; but 1 part is loose."),
                    HasSubstr("\nThe model falls into 2 parts that share no "
                              "track, so none tells where 3 images ("),
                    HasSubstr("\n  3 (" + model_.images[5].name + ", ...)"),
                    HasSubstr("\n  More matches between the parts, and")));
}

// The first line says so beside what is wrong.
TEST_F(LastingFaultsOfAModel, PartsAreSaidFirstWhateverElseIsWrong) {
  FallApart();
  model_.images[0].points2D[0].x += 40;
  Save(model_, folder_ / "input");
  const KrotResult checked =
      RunKrot({"model_checker", "--input_path", folder_ / "input"});
  const std::string first = checked.out.substr(0, checked.out.find('\n'));
  EXPECT_THAT(first, HasSubstr("wrong"));
  EXPECT_THAT(first, EndsWith("explains; and 1 part is loose."));
}

TEST_F(LastingFaultsOfAModel, PointsInACameraAreCountedAndThenRemoved) {
  Point3D& point = model_.points3D[5];
  const int32_t n = ImagesOfElements(model_)[point.track_begin];
  point.xyz = Center(ImageGeometries(model_)[n].cam_from_world);
  Save(model_, folder_ / "adjusted");
  const KrotResult analyzed =
      RunKrot({"model_analyzer", "--path", folder_ / "adjusted"});
  EXPECT_THAT(analyzed.out,
              HasSubstr("\n1 observation sees a point that lies in the camera "
                        "itself, which no adjustment mends: krot model_checker "
                        "--output_path, or krot outlier_filter, removes it."));
  Succeeded(RunKrot({"model_checker", "--input_path", folder_ / "adjusted",
                     "--output_path", folder_ / "cured"}));
  EXPECT_THAT(RunKrot({"model_analyzer", "--path", folder_ / "cured"}).out,
              Not(HasSubstr("in the camera itself")));
}

}  // namespace
}  // namespace krot::internal
