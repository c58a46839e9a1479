// From photos of a scene whose cameras are known through COLMAP and KROT, and
// back to the known cameras.

#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "krot/synthetic/scene.h"
#include "tests/cli/colmap.h"
#include "tests/cli/krot_process.h"
#include "tests/cli/scenes.h"
#include "tests/end_to_end/comparison.h"
#include "tests/end_to_end/photos.h"
#include "tests/end_to_end/script.h"

namespace krot::internal {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

constexpr double kMaxErrorFactor = 1.1;  // the script's

bool IsInstalled(const std::string& program) {
  return std::system(("command -v " + program + " >/dev/null 2>&1").c_str()) ==
         0;
}

// COLMAP's mapper on the photos: work/0. Its words go to work/log.
bool Reconstruct(const fs::path& photos, const fs::path& work) {
  fs::create_directories(work);
  const std::string command = "'" KROT_SAMPLE "/reconstruct.sh' '" +
                              photos.string() + "' '" + work.string() + "' >'" +
                              (work / "log").string() + "' 2>&1";
  return std::system(command.c_str()) == 0 && fs::exists(work / "0/images.bin");
}

// The model with a share of the observations of 3D points moved to random
// pixels.
Model WithOutliers(Model model, double share, uint64_t seed) {
  Random random(seed);
  for (Image& image : model.images) {
    for (Point2D& point : image.points2D) {
      if (point.point3D_id == kInvalidPoint3DId || !random.Chance(share)) {
        continue;
      }
      const Camera& camera = model.cameras.front();
      point.x = random.Uniform(0, static_cast<double>(camera.width));
      point.y = random.Uniform(0, static_cast<double>(camera.height));
    }
  }
  return model;
}

// The photos are rendered and reconstructed once, sharp and noisy.
class EndToEnd : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    if (!IsPossible()) return;
    folder_ = std::make_unique<TempFolder>();
    const fs::path sharp = *folder_ / "sharp_photos";
    const fs::path noisy = *folder_ / "noisy_photos";
    ASSERT_TRUE(RenderPhotos(sharp, *folder_ / "log"))
        << ReadBytes(*folder_ / "log");
    AddNoise(sharp, 5, 7, noisy);
    for (const char* name : {"sharp", "noisy"}) {
      ASSERT_TRUE(Reconstruct(*folder_ / (std::string(name) + "_photos"),
                              *folder_ / name))
          << ReadBytes(*folder_ / name / "log");
    }
    Save(TrueCameras(), *folder_ / "truth");
  }

  static void TearDownTestSuite() { folder_.reset(); }

  void SetUp() override {
    if (!IsPossible()) GTEST_SKIP() << "needs colmap, povray and jq";
    ASSERT_FALSE(testing::UnitTest::GetInstance()
                     ->current_test_suite()
                     ->ad_hoc_test_result()
                     .Failed());
  }

  static bool IsPossible() {
    return HasColmap() && HasPovray() && IsInstalled("jq");
  }

  // Prints the table, too.
  Comparison Compare(const std::string& title, const fs::path& model) const {
    const Comparison comparison =
        CompareWithTruth(model, *folder_ / "truth", output_ / title);
    EXPECT_EQ(comparison.exit_code, 0) << comparison.words;
    std::cout << title << ". " << comparison.table << std::endl;
    return comparison;
  }

  // The most that COLMAP finds above `max_error`; its own arithmetic.
  int NumAbove(const fs::path& model, double max_error) const {
    fs::create_directories(output_ / "filtered");
    EXPECT_TRUE(
        RunColmap({"point_filtering", "--input_path", model, "--output_path",
                   output_ / "filtered", "--max_reproj_error",
                   std::to_string(max_error), "--min_tri_angle", "0"},
                  output_ / "log"));
    const std::string words = ReadBytes(output_ / "log");
    const std::string label = "Filtered observations: ";
    const size_t found = words.find(label);
    EXPECT_NE(found, std::string::npos) << words;
    return std::atoi(words.c_str() + found + label.size());
  }

  // What holds by the definition of each result, whatever the photos.
  void ExpectEachIsBestAtItsOwn(const std::string& title,
                                const Comparison& comparison) const {
    const auto& results = comparison.results;
    const Result& linf = results.at("linf");
    for (const char* other :
         {"input", "colmap_ba", "ba", "cauchy", "ba_rotations", "bounded"}) {
      EXPECT_LT(linf.max_error, results.at(other).max_error) << other;
    }
    // Ceres stops a little above the least sum of squares.
    for (const auto& [name, result] : results) {
      EXPECT_LE(results.at("ba").rms_error, result.rms_error * (1 + 1e-4))
          << name;
    }
    EXPECT_NEAR(results.at("ba").rms_error, results.at("colmap_ba").rms_error,
                1e-3 * results.at("colmap_ba").rms_error);
    EXPECT_LE(results.at("ba_rotations").rms_error, linf.rms_error);
    // What the finish gives up of the lowest maximum, and what for.
    const Result& linf_only = results.at("linf_only");
    EXPECT_LE(linf.max_error, (1 + 1e-3) * linf_only.max_error);
    EXPECT_LE(linf.rms_error, linf_only.rms_error);

    const double cap = kMaxErrorFactor * linf.max_error;
    EXPECT_LE(results.at("bounded").max_error, cap);
    EXPECT_LT(results.at("bounded").rms_error, linf.rms_error);
    // COLMAP's arithmetic and six printed digits of the cap.
    EXPECT_EQ(NumAbove(output_ / title / "bounded", cap + 1e-5), 0);
    EXPECT_GT(NumAbove(output_ / title / "linf", linf.max_error - 1e-5), 0);
  }

  void ExpectAllWithin(const Comparison& comparison, double share) const {
    for (const auto& [name, result] : comparison.results) {
      EXPECT_LT(result.center_rms, share * comparison.scene_radius) << name;
    }
  }

  static inline std::unique_ptr<TempFolder> folder_;
  TempFolder output_;
};

TEST_F(EndToEnd, AllResultsFromSharpPhotosAreNearTheTruth) {
  const Comparison comparison = Compare("sharp", *folder_ / "sharp/0");
  ASSERT_EQ(comparison.results.size(), 9u);
  ExpectEachIsBestAtItsOwn("sharp", comparison);
  ExpectAllWithin(comparison, 0.02);
  // The bound is for the input's rotations and intrinsics, which least squares
  // kept; residuals of a rendered pinhole camera are all but linear.
  ASSERT_TRUE(comparison.lower_bound.has_value());
  EXPECT_GE(comparison.results.at("ba_rotations").max_error,
            *comparison.lower_bound * (1 - 1e-3));
}

TEST_F(EndToEnd, AllResultsFromNoisyPhotosAreNearTheTruth) {
  const Comparison comparison = Compare("noisy", *folder_ / "noisy/0");
  ASSERT_EQ(comparison.results.size(), 9u);
  ExpectEachIsBestAtItsOwn("noisy", comparison);
  ExpectAllWithin(comparison, 0.04);
}

TEST_F(EndToEnd, OutliersAreForARobustLossAndAFilterFirst) {
  const fs::path model = output_ / "one_percent_outliers";
  Save(WithOutliers(Load(*folder_ / "sharp/0"), 0.01, 11), model);
  const Comparison comparison = Compare("outliers", model);
  ASSERT_EQ(comparison.results.size(), 9u);
  const auto& results = comparison.results;
  const double radius = comparison.scene_radius;
  EXPECT_LT(results.at("linf").max_error, results.at("input").max_error);
  EXPECT_LT(results.at("cauchy").center_rms, 0.02 * radius);
  // The largest error obeys the outliers, and the sum of squares does, too.
  for (const char* name : {"linf", "ba", "colmap_ba"}) {
    EXPECT_GT(results.at(name).center_rms, results.at("cauchy").center_rms)
        << name;
  }

  // Without what is far off the robust result, the lowest maximum is near the
  // truth again.
  const fs::path filtered = output_ / "robust_then_filtered";
  fs::create_directories(filtered);
  ASSERT_TRUE(
      RunColmap({"point_filtering", "--input_path", output_ / "outliers/cauchy",
                 "--output_path", filtered, "--max_reproj_error", "4"},
                output_ / "log"));
  const Comparison again = Compare("robust_then_filtered", filtered);
  ASSERT_EQ(again.results.size(), 9u);
  EXPECT_LT(again.results.at("linf").max_error, 4);
  ExpectAllWithin(again, 0.02);
}

TEST_F(EndToEnd, TheMappersScriptMakesModelProofReportAndOverlay) {
  const fs::path output = output_ / "sparse";
  const KrotResult run = RunScript(
      "mapper_then_krot.sh",
      {"--database_path", (*folder_ / "sharp/database.db").string(),
       "--image_path", (*folder_ / "sharp_photos").string(), "--output_path",
       output.string(), "--Mapper.num_threads", "1", "--random_seed", "0"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("proved to be within"));
  EXPECT_THAT(run.out, HasSubstr("How far cameras and points are apart"));
  EXPECT_EQ(FileNames(output),
            (std::vector<std::string>{"0", "0_linf", "0_linf.html",
                                      "0_linf_certificate.json", "0_overlay",
                                      "mapper.log"}));
  EXPECT_EQ(Load(output / "0_overlay").images.size(),
            2 * Load(output / "0").images.size());
  EXPECT_EQ(RunKrot({"certificate_checker", "--input_path", output / "0_linf",
                     "--certificate_path", output / "0_linf_certificate.json"})
                .exit_code,
            0);
}

}  // namespace
}  // namespace krot::internal
