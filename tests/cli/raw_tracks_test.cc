#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/model.h"
#include "tests/cli/krot_process.h"
#include "tests/cli/scenes.h"
#include "tests/testing/weakly_tied.h"

// `krot solver` on rotations and tracks alone, outliers among them.

namespace krot::internal {
namespace {

class RawTracks : public ::testing::Test {
 protected:
  RawTracks() {
    SceneOptions options = SmallScene();
    options.outlier_ratio = 0.05;
    Model model = WithoutTranslations(SynthesizeScene(options).model);
    for (Point3D& point : model.points3D) point.xyz.setZero();
    Save(model, folder_ / "input");
  }

  KrotResult Solve(const Words& more) const {
    return RunKrot(
        {"solver", "--input_path", folder_ / "input", "--output_path",
         folder_ / "output", "--report_path", folder_ / "r.json"},
        more);
  }
  Json Report() const { return ReadJson(folder_ / "r.json"); }

  TempFolder folder_;
};

TEST_F(RawTracks, AreSolvedWithinTheBoundWithAProofOfWhatWasLeftOut) {
  const KrotResult result =
      Succeeded(Solve({"--Solver.init", "feasible", "--Solver.max_error", "3",
                       "--conflicts_path", folder_ / "c.json"}));
  const Json outliers = Report()["outliers"];
  const int removed = outliers["num_removed"];
  const int must_go = outliers["num_must_go"];
  EXPECT_GT(must_go, 0);
  EXPECT_LE(must_go, removed);
  EXPECT_TRUE(outliers["is_within"]);
  EXPECT_THAT(result.out,
              HasSubstr("removed " + std::to_string(removed) + " of "));
  for (const double error : PixelErrors(Load(folder_ / "output"))) {
    EXPECT_LE(error, 3 * (1 + 1e-9));
  }
  Succeeded(RunKrot({"certificate_checker", "--input_path", folder_ / "input",
                     "--certificate_path", folder_ / "c.json"}));
}

TEST_F(RawTracks, AreSolvedWithABoundThatNoiseChoosesAndThatIsSaid) {
  const KrotResult result = Succeeded(Solve({"--Solver.init", "feasible"}));
  EXPECT_THAT(result.err, HasSubstr("leaving out what noise of "));
  const Json report = Report();
  // Some five times the scene's noise, which a bound by hand does not beat.
  EXPECT_GT(report["outliers"]["max_error"], 2 * SmallScene().pixel_noise);
  EXPECT_LT(report["outliers"]["max_error"], 8 * SmallScene().pixel_noise);
  EXPECT_TRUE(report["outliers"]["num_must_go"].is_null());
  EXPECT_GT(report["num_observations"], 0);
}

TEST_F(RawTracks, AreNotSearchedForALowestMaximumThatNobodyAskedFor) {
  const Words bound = {"--Solver.init", "feasible", "--Solver.max_error", "3"};
  Succeeded(Solve(bound));
  const Json without = Report();
  EXPECT_EQ(without["termination"], "within_bound");
  EXPECT_TRUE(without["lower_bound"].is_null());
  EXPECT_TRUE(without["rounds"].empty());
  EXPECT_LE(without["cost_final"], 3);
  Succeeded(
      Solve(bound + Words{"--certificate_path", folder_ / "certificate.json",
                          "--overwrite", "1"}));
  const Json with = Report();
  EXPECT_EQ(with["certified"], true);
  // Both end with the least squares below the same cap.
  const double sum = without["finish"]["cost_final"];
  EXPECT_NEAR(sum, with["finish"]["cost_final"], 1e-2 * sum);
}

TEST_F(RawTracks, KeepABoundThatIsGivenWhereTheModelHasPositions) {
  Save(SmallLegacyModel(), folder_ / "input");
  Succeeded(Solve({"--Solver.init", "feasible", "--Solver.max_error", "3"}));
  EXPECT_EQ(Report()["outliers"]["max_error"], 3);
}

TEST_F(RawTracks, WhoseBoundIsBeyondReasonAreNotToBeReliedOn) {
  const KrotResult result = Solve({"--Problem.init_max_error", "0.1"});
  EXPECT_EQ(result.exit_code, 10);
  EXPECT_THAT(result.err, HasSubstr("not to be relied on: hardly anything"));
  EXPECT_FALSE(Load(folder_ / "output").points3D.empty());
}

TEST(WeaklyTiedTracks, AreSaidNotToHoldTheScaleOfAPart) {
  const TempFolder folder;
  SceneOptions options = SmallScene();
  options.layout = SceneLayout::kStreet;
  options.num_frames = 24;
  options.num_points = 1500;
  const Model model = WeaklyTied(
      WithoutTranslations(SynthesizeScene(options).model),
      [](int n) { return n / 14; }, [](int, int) { return true; },
      /*num_tracks=*/10, /*num_wrong=*/10);
  Save(model, folder / "input");
  const KrotResult result =
      RunKrot({"solver", "--input_path", folder / "input", "--output_path",
               folder / "output", "--report_path", folder / "r.json",
               "--Solver.init", "feasible", "--Solver.max_error", "10"});
  EXPECT_EQ(result.exit_code, 10) << result.err;
  EXPECT_THAT(result.err, HasSubstr("10 images ("));
  EXPECT_THAT(result.err, HasSubstr("hang on the rest by 10 tracks"));
  const Json report = ReadJson(folder / "r.json");
  const Json& parts = report["outliers"]["weak_parts"];
  ASSERT_EQ(parts.size(), 1u);
  EXPECT_EQ(parts[0]["num_tracks"], 10);
  EXPECT_EQ(parts[0]["image_names"].size(), 10u);
  EXPECT_EQ(parts[0]["is_held"], false);
}

TEST(TracksInTwoComponents, AreNotToBeReliedOn) {
  const TempFolder folder;
  SceneOptions options = SmallScene();
  options.layout = SceneLayout::kStreet;
  options.num_frames = 24;
  options.num_points = 1500;
  Save(WeaklyTied(
           WithoutTranslations(SynthesizeScene(options).model),
           [](int n) { return n / 14; }, [](int, int) { return false; },
           /*num_tracks=*/0, /*num_wrong=*/0),
       folder / "input");
  const KrotResult result =
      RunKrot({"solver", "--input_path", folder / "input", "--output_path",
               folder / "output", "--report_path", folder / "r.json",
               "--Solver.init", "feasible"});
  EXPECT_EQ(result.exit_code, 10) << result.err;
  EXPECT_THAT(result.err, HasSubstr("share no track with the rest"));
  const Json parts = ReadJson(folder / "r.json")["outliers"]["weak_parts"];
  ASSERT_EQ(parts.size(), 1u);
  EXPECT_EQ(parts[0]["num_tracks"], 0);
  EXPECT_TRUE(parts[0]["scale_factor"].is_null());
}

class OtherShapes : public ::testing::Test {
 protected:
  static SceneOptions Street() {
    SceneOptions options = SmallScene();
    options.layout = SceneLayout::kStreet;
    options.camera_model_id = 1;
    options.num_frames = 8;
    options.num_points = 500;
    return options;
  }

  KrotResult Solve(Model model, const Words& more) const {
    model = WithoutTranslations(model);
    for (Point3D& point : model.points3D) point.xyz.setZero();
    Save(model, folder_ / "input");
    return RunKrot({"solver", "--input_path", folder_ / "input",
                    "--output_path", folder_ / "output", "--overwrite", "1",
                    "--report_path", folder_ / "r.json"},
                   more);
  }

  TempFolder folder_;
};

TEST_F(OtherShapes, ChainsOfPairsAreSaidToTellNoDistances) {
  const KrotResult result = Solve(ChainOfPairs(SynthesizeScene(Street()).model),
                                  {"--Solver.init", "feasible"});
  EXPECT_EQ(result.exit_code, 10) << result.err;
  EXPECT_THAT(result.err,
              HasSubstr("tracks of two images alone, which tell directions but "
                        "no distances; their scale against the rest is not "
                        "held at all"));
  EXPECT_THAT(result.err, Not(HasSubstr("rotations,")));
}

TEST_F(OtherShapes, PanoramasAreSaidToHaveNoBaseline) {
  const Model truth = SynthesizeScene(Street()).ground_truth;
  const KrotResult result = Solve(SeenFrom(truth, NearTheFirst(truth, 0), 0.5),
                                  {"--Solver.init", "feasible"});
  EXPECT_EQ(result.exit_code, 10) << result.err;
  EXPECT_THAT(result.err,
              HasSubstr("the images show no baseline: one place of all cameras "
                        "explains the observations as well"));
  EXPECT_EQ(ReadJson(folder_ / "r.json")["outliers"]["one_centre_turn_deg"], 0);
}

TEST_F(OtherShapes, ShortBaselinesAreSolved) {
  const Model truth = SynthesizeScene(Street()).ground_truth;
  Succeeded(Solve(SeenFrom(truth, NearTheFirst(truth, 0.05), 0.5),
                  {"--Solver.init", "feasible"}));
  EXPECT_TRUE(ReadJson(folder_ / "r.json")["outliers"]["one_centre_turn_deg"]
                  .is_null());
}

TEST_F(OtherShapes, RotationsThatNobodyEstimatedAreNamed) {
  const auto unturned = [](int, const RigidTransform& own) {
    return RigidTransform{Eigen::Matrix3d::Identity(), own.translation};
  };
  Model model = SynthesizeScene(SmallScene()).model;
  for (size_t n = 0; n < model.images.size(); ++n) {
    model.images[n].cam_from_world = Pose();
    model.frames[n].rig_from_world = Pose();
  }
  for (const Words& more : {Words(), Words{"--Solver.init", "feasible"}}) {
    const KrotResult result = Solve(model, more);
    EXPECT_EQ(result.exit_code, 10);
    EXPECT_THAT(result.err, HasSubstr("all rotations are the identity"));
  }
  // Above the ground cameras need not turn: shifted, they see the scene from
  // five times its extent.
  Model truth = SynthesizeScene(Street()).ground_truth;
  for (Point3D& point : truth.points3D) point.xyz[2] += 30;
  const KrotResult result =
      Solve(SeenFrom(truth, unturned, 0.5), {"--Solver.init", "feasible"});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, Not(HasSubstr("identity")));
}

TEST(WrongRotations, AreNamedByTheirImages) {
  const TempFolder folder;
  SceneOptions options = SmallScene();
  options.num_frames = 24;
  options.num_points = 1500;
  Model model = WithoutTranslations(SynthesizeScene(options).model);
  TurnPart([](int n) { return n == 4; }, 40, &model);
  Save(model, folder / "input");
  const KrotResult result =
      RunKrot({"solver", "--input_path", folder / "input", "--output_path",
               folder / "output", "--Solver.init", "feasible"});
  EXPECT_EQ(result.exit_code, 10) << result.err;
  EXPECT_THAT(result.err, HasSubstr("1 image keeps few of its observations (" +
                                    model.images[4].name + " "));
}

TEST_F(RawTracks, WhoseLowestMaximumIsToBeProvedLoseNothing) {
  const KrotResult result =
      Solve({"--Solver.init", "feasible", "--Problem.init_max_error", "10",
             "--certificate_path", folder_ / "certificate.json"});
  EXPECT_EQ(result.exit_code, 7);
  EXPECT_THAT(result.err, HasSubstr("--Solver.max_error leaves out"));
}

TEST_F(RawTracks, RefuseOptionsThatDoNotGoTogether) {
  EXPECT_EQ(Solve({"--conflicts_path", folder_ / "c.json"}).exit_code, 1);
  EXPECT_EQ(
      Solve({"--Solver.max_error", "3", "--Solver.norm", "inf"}).exit_code, 1);
  EXPECT_EQ(
      Solve({"--Solver.max_error", "3", "--Solver.method", "joint"}).exit_code,
      1);
}

TEST(SameImageOption, LeavesOneOfAnImageInATrackAndNamesTracksInTheSupport) {
  const TempFolder folder;
  SceneOptions options = SmallScene();
  options.duplicate_ratio = 0.2;
  Save(SynthesizeScene(options).model, folder / "input");
  const auto solve = [&](const std::string& same_image) {
    const KrotResult result = Succeeded(
        RunKrot({"solver", "--input_path", folder / "input", "--output_path",
                 folder / "output", "--overwrite", "1", "--report_path",
                 folder / "r.json", "--Problem.same_image", same_image}));
    EXPECT_THAT(result.out, HasSubstr("with an image more than once"));
    return ReadJson(folder / "r.json");
  };
  const Json keep = solve("keep");
  const Json closest = solve("closest");
  EXPECT_EQ(keep["left_out"]["same_image"], 0);
  EXPECT_GT(closest["left_out"]["same_image"], 0);
  EXPECT_EQ(keep["same_image"]["num_tracks"],
            closest["same_image"]["num_tracks"]);
  EXPECT_FALSE(keep["same_image"]["support_point3D_ids"].empty());
  EXPECT_TRUE(closest["same_image"]["support_point3D_ids"].empty());
  EXPECT_LT(closest["cost_final"], keep["cost_final"]);
}

// Twins that were left out end above the largest error of the input.
TEST(SameImageOption, GivesAModelWhereverTheTwinsEnd) {
  const TempFolder folder;
  SceneOptions options = SmallScene();
  options.duplicate_ratio = 0.5;
  Save(SynthesizeScene(options).ground_truth, folder / "input");
  for (const char* command : {"solver", "point_triangulator"}) {
    const KrotResult result = Succeeded(
        RunKrot({command, "--input_path", folder / "input", "--output_path",
                 folder / command, "--report_path", folder / command / "r.json",
                 "--Problem.same_image", "closest"}));
    EXPECT_THAT(result.out, HasSubstr("are taken to be wrong: left out, still "
                                      "in the model"));
    const Json report = ReadJson(folder / command / "r.json");
    EXPECT_EQ(report["is_given_back"], false);
    EXPECT_LT(report["pixel_error"]["after"]["max"],
              report["pixel_error"]["before"]["max"]);
    EXPECT_EQ(report["pixel_error"]["after"]["max"], report["cost_final"]);
    EXPECT_EQ(Load(folder / command).track_elements.size(),
              Load(folder / "input").track_elements.size());
  }
}

}  // namespace
}  // namespace krot::internal
