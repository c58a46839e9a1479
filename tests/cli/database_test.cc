#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "krot/database.h"
#include "krot/model.h"
#include "krot/synthetic/scene.h"
#include "tests/cli/colmap.h"
#include "tests/cli/krot_process.h"
#include "tests/cli/scenes.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

using ::testing::StartsWith;

class DatabaseOption : public ::testing::Test {
 protected:
  DatabaseOption() {
    SceneOptions options = SceneOf(8, 600, 6, 0.5);
    Model model = SynthesizeScene(options).ground_truth;
    Save(model, folder_ / "sound");
    WriteDatabase(folder_ / "database.db", model, DatabaseOf(model));
    Pose& pose = model.frames[2].rig_from_world;
    const Eigen::Matrix3d turn =
        Eigen::AngleAxisd(0.03, Eigen::Vector3d(1, 2, 2) / 3).matrix();
    pose = ToPose({turn * pose.Rotation(), turn * pose.translation});
    Save(model, folder_ / "turned");
    pose = ToPose(
        {turn.transpose() * pose.Rotation(),
         turn.transpose() * pose.translation + Eigen::Vector3d(0.1, 0, -0.1)});
    Save(model, folder_ / "moved");
  }

  KrotResult Check(const std::string& model, const Words& more = {}) const {
    return RunKrot(
        {"model_checker", "--input_path", folder_ / model, "--database_path",
         folder_ / "database.db", "--report_path", folder_ / "r.json"},
        more);
  }

  TempFolder folder_;
};

TEST_F(DatabaseOption, HoldsMatchesAgainstPoses) {
  const std::string bytes = ReadBytes(folder_ / "database.db");
  KrotResult result = Succeeded(Check("sound", {"--fail_on", "wrong"}));
  EXPECT_THAT(result.out, StartsWith("Nothing is wrong: all "));
  EXPECT_THAT(result.out, HasSubstr("By the matches none of "));
  EXPECT_EQ(ReadBytes(folder_ / "database.db"), bytes);
  result = Check("turned", {"--fail_on", "wrong"});
  EXPECT_EQ(result.exit_code, 9) << result.err;
  EXPECT_THAT(result.out,
              ::testing::MatchesRegex(
                  "1 of 8 images \\(.*\\) is wrong: verified matches "
                  "contradict 1 image.\n(.|\n)*"));
  EXPECT_THAT(result.out, HasSubstr("1 image is wrong."));
  EXPECT_THAT(result.out, HasSubstr("rotation: turned by 1.7"));
  const Json json = ReadJson(folder_ / "r.json")["database"];
  EXPECT_EQ(json["cheapest"]["images"].size(), 1);
  EXPECT_TRUE(json["images"][2]["is_wrong"]);
  EXPECT_EQ(json["images"][2]["fault"], "rotation");
  EXPECT_NEAR(json["images"][2]["turned_by_deg"].get<double>(), 1.719, 0.05);
  EXPECT_THAT(result.out, HasSubstr(json["verdict"].get<std::string>()));
}

TEST_F(DatabaseOption, DeregistersATurnedImageAndNamesTheCommandThatPlacesIt) {
  const KrotResult result =
      Succeeded(Check("turned", {"--output_path", folder_ / "cured"}));
  EXPECT_THAT(result.out,
              HasSubstr("colmap image_registrator --database_path " +
                        (folder_ / "database.db").string() + " --input_path " +
                        (folder_ / "cured").string()));
  EXPECT_EQ(Load(folder_ / "cured").images.size(), 7u);
  Succeeded(Check("cured", {"--fail_on", "wrong"}));
}

TEST_F(DatabaseOption, MovesAnImageWhosePositionAloneIsWrong) {
  const KrotResult result =
      Succeeded(Check("moved", {"--output_path", folder_ / "cured"}));
  EXPECT_THAT(result.out, HasSubstr("position: moved by 0.14"));
  EXPECT_THAT(result.out, HasSubstr("1 wrong image has a new position"));
  EXPECT_THAT(result.out, Not(HasSubstr("image_registrator")));
  const Json json = ReadJson(folder_ / "r.json");
  EXPECT_EQ(json["moved_images"].size(), 1);
  EXPECT_EQ(Load(folder_ / "cured").images.size(), 8u);
  Succeeded(Check("cured", {"--fail_on", "wrong"}));
}

TEST_F(DatabaseOption, HoldsMatchesAgainstPosesThatHaveNoPoints) {
  Save(WithShortTracks(Load(folder_ / "turned"), 0), folder_ / "poses");
  const KrotResult result = Check("poses", {"--fail_on", "wrong"});
  EXPECT_EQ(result.exit_code, 9) << result.err;
  EXPECT_THAT(result.out, StartsWith("1 of 8 images ("));
}

// In COLMAP's words, which its FAQ has for known poses.
TEST_F(DatabaseOption, MakesPointsForKnownPoses) {
  Model poses = WithShortTracks(Load(folder_ / "sound"), 0);
  for (Image& image : poses.images) image.points2D.clear();
  Save(poses, folder_ / "poses");
  const auto triangulate = [&](const Words& more) {
    return RunKrot({"point_triangulator", "--database_path",
                    folder_ / "database.db", "--image_path", folder_.path(),
                    "--input_path", folder_ / "poses", "--output_path",
                    folder_ / "points", "--report_path", folder_ / "r.json"},
                   more);
  };
  KrotResult result = Succeeded(triangulate({"--clear_points", "1"}));
  const Model made = Load(folder_ / "points");
  ValidateModel(made);
  const Model truth = Load(folder_ / "sound");
  EXPECT_GT(100 * made.track_elements.size(), 95 * truth.track_elements.size());
  EXPECT_THAT(made.frames.size(), truth.frames.size());
  const Json json = ReadJson(folder_ / "r.json");
  EXPECT_EQ(json["num_points"], made.points3D.size());
  EXPECT_THAT(result.out, StartsWith(json["verdict"].get<std::string>()));
  EXPECT_THAT(result.err, HasSubstr("no colours from 8 photos in "));
  EXPECT_EQ(triangulate({}).exit_code, 5);  // there is a model
  result = triangulate(
      {"--overwrite", "1", "--Mapper.filter_max_reproj_error", "1e-9"});
  EXPECT_THAT(result, IsRefused(3, "krot point_triangulator",
                                "nothing to triangulate: no matches"));
  EXPECT_THAT(Load(folder_ / "points").points3D.size(), made.points3D.size());
}

TEST_F(DatabaseOption, GivesPositionsAndPointsToRotationsAlone) {
  Model rotations = WithShortTracks(Load(folder_ / "sound"), 0);
  for (Image& image : rotations.images) image.points2D.clear();
  for (Frame& frame : rotations.frames) {
    frame.rig_from_world.translation.setZero();
  }
  Save(rotations, folder_ / "rotations");
  const auto solve = [&](const Words& more) {
    return RunKrot({"solver", "--database_path", folder_ / "database.db",
                    "--input_path", folder_ / "rotations", "--output_path",
                    folder_ / "s", "--report_path", folder_ / "r.json"},
                   more);
  };
  KrotResult result = solve({});
  EXPECT_THAT(result,
              IsRefused(1, "krot solver",
                        "--database_path needs --Solver.init feasible"));
  result = Succeeded(solve({"--Solver.init", "feasible"}));
  EXPECT_THAT(result.out, HasSubstr("The points come from the matches of "));
  ValidateModel(Load(folder_ / "s"));
  const Json json = ReadJson(folder_ / "r.json");
  EXPECT_GT(json["matches"]["num_pairs"], 20);
  EXPECT_LT(json["pixel_error"]["after"]["max"], 4);
  Succeeded(RunKrot({"model_comparer", "--input_path1", folder_ / "sound",
                     "--input_path2", folder_ / "s", "--alignment",
                     "similarity", "--report_path", folder_ / "c.json"}));
  const Json compared = ReadJson(folder_ / "c.json");
  EXPECT_LT(compared["center"]["rms"].get<double>(),
            0.005 * compared["scene_radius"].get<double>());
  result = solve({"--Solver.init", "feasible", "--overwrite", "1",
                  "--Solver.max_error", "1e-9", "--log_level", "0"});
  EXPECT_THAT(result,
              IsRefused(3, "krot solver", "nothing to solve: no matches of"));
}

TEST_F(DatabaseOption, ProvesWhatNoBaselinesExplain) {
  const std::string certificate = folder_ / "baselines.json";
  Succeeded(Check("turned", {"--certificate_path", certificate}));
  const auto judge = [&](const Json& json, const std::string& model) {
    WriteBytes(folder_ / "judged.json", json.dump());
    return RunKrot({"certificate_checker", "--input_path", folder_ / model,
                    "--database_path", folder_ / "database.db",
                    "--certificate_path", folder_ / "judged.json",
                    "--report_path", folder_ / "v.json"});
  };
  const Json json = ReadJson(certificate);
  const Json database = ReadJson(folder_ / "r.json")["database"];
  ASSERT_EQ(json["baselines"].size(), database["num_contradictory_pairs"]);
  ASSERT_GT(json["baselines"].size(), 3);
  KrotResult result = Succeeded(judge(json, "turned"));
  EXPECT_THAT(result.out, StartsWith("The certificate holds: with the "));
  const Json verdict = ReadJson(folder_ / "v.json");
  EXPECT_EQ(verdict["baselines"]["pairs"].size(), json["baselines"].size());
  // Other rotations.
  EXPECT_EQ(judge(json, "sound").exit_code, 4);
  for (size_t n = 0; n < json["baselines"].size(); ++n) {
    const auto is_refused = [&](const auto& falsify) {
      Json other = json;
      falsify(&other["baselines"][n]);
      return judge(other, "turned").exit_code == 4;
    };
    EXPECT_TRUE(is_refused([](Json* pair) {
      (*pair)["most_explained"] = (*pair)["most_explained"].get<int>() - 1;
    }));
    EXPECT_TRUE(is_refused([](Json* pair) {
      (*pair)["num_explained"] = (*pair)["num_explained"].get<int>() + 1;
    }));
    EXPECT_TRUE(is_refused([](Json* pair) {
      (*pair)["num_matches"] = (*pair)["num_matches"].get<int>() + 1;
    }));
    EXPECT_TRUE(is_refused([](Json* pair) { (*pair)["cells"] = "000"; }));
    EXPECT_TRUE(is_refused([](Json* pair) { (*pair)["cells"] = ""; }));
    EXPECT_TRUE(is_refused([](Json* pair) {
      (*pair)["cells"] = (*pair)["cells"].get<std::string>() + "0";
    }));
    EXPECT_TRUE(is_refused(
        [](Json* pair) { (*pair)["cells"] = std::string(1000, '1'); }));
    EXPECT_TRUE(is_refused([](Json* pair) { (*pair)["image_id2"] = 4711; }));
  }
  Json twice = json;
  twice["baselines"].push_back(json["baselines"][0]);
  EXPECT_EQ(judge(twice, "turned").exit_code, 4);
  Json wide = json;
  wide["tolerance_px"] = 2 * json["tolerance_px"].get<double>();
  EXPECT_EQ(judge(wide, "turned").exit_code, 4);
  result = RunKrot({"certificate_checker", "--input_path", folder_ / "turned",
                    "--certificate_path", certificate});
  EXPECT_THAT(result, IsRefused(1, "krot certificate_checker",
                                "--database_path is required"));
}

TEST_F(DatabaseOption, GivesNoProofThatItsCheckerRefuses) {
  Succeeded(RunKrot({"model_synthesizer", "--output_path", folder_ / "few",
                     "--database_path", folder_ / "few.db",
                     "--Scene.camera_model", "EQUIRECTANGULAR",
                     "--Scene.has_rigs", "0", "--Scene.pixel_noise", "0.5",
                     "--Scene.num_frames", "10", "--Scene.num_points", "200"}));
  const std::string proof = folder_ / "few.json";
  const KrotResult result = Succeeded(RunKrot(
      {"model_checker", "--input_path", folder_ / "few", "--database_path",
       folder_ / "few.db", "--certificate_path", proof}));
  EXPECT_FALSE(std::filesystem::exists(proof));
  EXPECT_THAT(result.err, HasSubstr("there is no certificate, so " + proof +
                                    " is not written"));
}

TEST_F(DatabaseOption, OfASyntheticSceneGivesColmapAndKrotTheSamePoints) {
  if (!HasColmap()) GTEST_SKIP() << "no colmap";
  const std::string database = folder_ / "scene.db";
  Succeeded(RunKrot({"model_synthesizer", "--output_path", folder_ / "start",
                     "--ground_truth_path", folder_ / "truth",
                     "--database_path", database, "--Scene.has_rigs", "0",
                     "--Scene.pixel_noise", "0.5"}));
  const auto call = [&](const std::string& output) {
    std::filesystem::create_directory(folder_ / "photos");
    return Words{"point_triangulator",
                 "--database_path",
                 database,
                 "--image_path",
                 folder_ / "photos",
                 "--input_path",
                 folder_ / "truth",
                 "--output_path",
                 folder_ / output,
                 "--clear_points",
                 "1"};
  };
  Succeeded(RunKrot(call("krot")));
  std::filesystem::create_directory(folder_ / "colmap");
  ASSERT_TRUE(RunColmap(call("colmap"), folder_ / "log"));
  const Model ours = Load(folder_ / "krot"), theirs = Load(folder_ / "colmap");
  EXPECT_GT(ours.points3D.size(), 900u);
  EXPECT_GE(ours.points3D.size(), theirs.points3D.size());
  EXPECT_GE(ours.track_elements.size(), theirs.track_elements.size());
}

TEST_F(DatabaseOption, IsRefusedWithCode2IfItCannotBeRead) {
  WriteBytes(folder_ / "database.db", "no database");
  EXPECT_THAT(Check("sound"),
              IsRefused(2, "krot model_checker", "is no SQLite database"));
}

}  // namespace
}  // namespace krot::internal
