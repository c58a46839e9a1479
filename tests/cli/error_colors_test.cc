#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "krot/analysis/model_statistics.h"
#include "krot/model.h"
#include "tests/cli/colmap.h"
#include "tests/cli/krot_process.h"
#include "tests/cli/scenes.h"

namespace krot::internal {
namespace {

namespace fs = std::filesystem;

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

}  // namespace
}  // namespace krot::internal
