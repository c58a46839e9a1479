#include <algorithm>
#include <array>
#include <fstream>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/camera/camera_model.h"
#include "krot/model.h"
#include "tests/cli/krot_process.h"
#include "tests/cli/scenes.h"
#include "tests/testing/edit_model.h"

namespace krot::internal {
namespace {

// The first track keeps one observation.
Model WithFirstTrackOfOne(Model model) {
  const uint64_t length = model.points3D[0].track_end;
  for (uint64_t e = 1; e < length; ++e) {
    PixelOf(&model, e).point3D_id = kInvalidPoint3DId;
  }
  model.track_elements.erase(model.track_elements.begin() + 1,
                             model.track_elements.begin() + length);
  for (Point3D& point : model.points3D) {
    if (point.track_begin > 0) point.track_begin -= length - 1;
    point.track_end -= length - 1;
  }
  return model;
}

class OutlierFilterCommand : public ::testing::Test {
 protected:
  OutlierFilterCommand() {
    SceneOptions options = SmallScene();
    options.outlier_ratio = 0.03;
    Save(SynthesizeScene(options).model, folder_ / "input");
  }

  KrotResult Filter(Words more = {}, const std::string& max_error = "3") const {
    if (!max_error.empty()) {
      more.push_back("--OutlierFilter.max_error=" + max_error);
    }
    return RunKrot({"outlier_filter", "--input_path", folder_ / "input",
                    "--output_path", folder_ / "output", "--report_path",
                    folder_ / "r.json", "--overwrite", "1"},
                   more);
  }
  KrotResult WithoutABound(Words more = {}) const {
    return Filter(std::move(more), "");
  }
  KrotResult Check(const std::string& file) const {
    return RunKrot({"certificate_checker", "--input_path", folder_ / "input",
                    "--certificate_path", folder_ / file});
  }

  TempFolder folder_;
};

TEST_F(OutlierFilterCommand, PrintsABracketWhoseProofTheCheckerAccepts) {
  const KrotResult result =
      Succeeded(Filter({"--conflicts_path", folder_ / "c.json",
                        "--outliers_path", folder_ / "o.csv"}));
  const Json report = ReadJson(folder_ / "r.json");
  const int removed = report["num_removed"];
  const int must_go = report["num_must_go"];
  EXPECT_GT(must_go, 0);
  EXPECT_LE(must_go, removed);
  EXPECT_TRUE(report["is_within"]);
  EXPECT_EQ(report["removed"].size(), static_cast<size_t>(removed));
  EXPECT_THAT(result.out,
              HasSubstr("removed " + std::to_string(removed) + " of "));
  EXPECT_THAT(result.out,
              HasSubstr("at least " + std::to_string(must_go) + " must go"));
  for (const double error : PixelErrors(Load(folder_ / "output"))) {
    EXPECT_LE(error, 3 * (1 + 1e-9));
  }
  const std::string csv = ReadBytes(folder_ / "o.csv");
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), removed + 1);

  const KrotResult check = Succeeded(Check("c.json"));
  EXPECT_THAT(check.out, HasSubstr("at least " + std::to_string(must_go) +
                                   " observation"));
}

TEST_F(OutlierFilterCommand, IsRefusedByTheCheckerOnceItsFileIsTamperedWith) {
  Succeeded(Filter({"--conflicts_path", folder_ / "c.json"}));
  Json json = ReadJson(folder_ / "c.json");
  json["conflicts"].push_back(json["conflicts"][0]);
  std::ofstream(folder_ / "twice.json") << json;
  EXPECT_THAT(Check("twice.json"),
              IsRefused(4, "krot certificate_checker", "refused"));
  json["conflicts"].erase(json["conflicts"].size() - 1);
  json["conflicts"][0].erase("rows_bound");
  std::ofstream(folder_ / "less.json") << json;
  EXPECT_EQ(Check("less.json").exit_code, 2);
}

TEST_F(OutlierFilterCommand, TakesItsBoundFromTheElbowOfTheProfile) {
  const std::string profile = folder_ / "profile.json";
  const KrotResult result =
      Succeeded(WithoutABound({"--conflicts_path", folder_ / "c.json",
                               "--OutlierFilter.profile_path", profile}));
  const Json json = ReadJson(profile);
  const Json report = ReadJson(folder_ / "r.json");
  EXPECT_EQ(report["profile"]["levels"], json["levels"]);
  const Json& levels = json["levels"];
  ASSERT_FALSE(json["elbow"].is_null());
  const int elbow = json["elbow"].get<int>();
  const Json& chosen = levels[elbow];
  EXPECT_EQ(report["max_error"], json["noise"]["max_error"]);
  EXPECT_LE(chosen["max_error"], report["max_error"]);
  EXPECT_GT(levels[elbow - 1]["max_error"], report["max_error"]);
  EXPECT_EQ(report["num_removed"], chosen["num_removed"]);
  std::set<uint64_t> points;
  for (const Json& removed : report["removed"]) {
    points.insert(removed["point3D_id"].get<uint64_t>());
  }
  EXPECT_EQ(chosen["point3D_ids"], Json(points));
  EXPECT_EQ(levels[0]["point3D_ids"], Json::array());
  EXPECT_GE(report["num_must_go"], chosen["num_must_go"]);
  EXPECT_TRUE(report["is_within"]);
  EXPECT_LE(levels.back()["max_error"].get<double>(),
            0.5 * levels[0]["max_error"].get<double>());
  EXPECT_NE(result.out.find("made the profile in "), std::string::npos)
      << result.out;
  Succeeded(Check("c.json"));
}

// Everything above what noise explains goes; nothing else has to.
TEST_F(OutlierFilterCommand, ChoosesItsBoundByTheNoise) {
  const KrotResult result =
      Succeeded(WithoutABound({"--OutlierFilter.method", "conflicts",
                               "--conflicts_path", folder_ / "c.json"}));
  const Json report = ReadJson(folder_ / "r.json");
  EXPECT_GT(report["num_must_go"], 0);
  EXPECT_EQ(report["max_error"], report["noise"]["max_error"]);
  EXPECT_GT(report["noise"]["lower_bound"], report["max_error"]);
  EXPECT_TRUE(report["is_within"]);
  EXPECT_THAT(result.out, HasSubstr("such noise is not all"));
  Succeeded(Check("c.json"));
}

TEST_F(OutlierFilterCommand, CallsNoObservationOfNoiseWrong) {
  for (const double pixel_noise : {0.0, 1.0}) {
    SceneOptions options = SmallScene();
    options.pixel_noise = pixel_noise;
    options.start_translation_noise = options.start_point_noise = 0;
    Save(SynthesizeScene(options).model, folder_ / "input");
    const KrotResult result =
        Succeeded(WithoutABound({"--OutlierFilter.method", "conflicts",
                                 "--conflicts_path", folder_ / "c.json"}));
    EXPECT_THAT(result.out, HasSubstr("removed 0 of "));
    EXPECT_THAT(result.out, HasSubstr("no elbow"));
    const Json report = ReadJson(folder_ / "r.json");
    EXPECT_TRUE(report["max_error"].is_null());
    for (const char* name : {"images.bin", "points3D.bin"}) {
      EXPECT_EQ(ReadBytes(folder_ / "output" / name),
                ReadBytes(folder_ / "input" / name));
    }
    const KrotResult check = Succeeded(Check("c.json"));
    EXPECT_THAT(check.out, HasSubstr("at least 0 observations must go"));
  }
}

TEST_F(OutlierFilterCommand, DoubtsMoreThanObservationsWhereAllErrorsAreLarge) {
  for (const double pixel_noise : {1.0, 10.0}) {
    SceneOptions options = SmallScene();
    options.pixel_noise = pixel_noise;
    Save(SynthesizeScene(options).model, folder_ / "input");
    const KrotResult result =
        Succeeded(WithoutABound({"--OutlierFilter.method", "conflicts"}));
    EXPECT_EQ(
        result.out.find("rotations, intrinsics or matches may be wrong") !=
            std::string::npos,
        pixel_noise > 2)
        << result.out;
  }
}

TEST_F(OutlierFilterCommand, SaysThatThereIsNoElbowWhateverTheBound) {
  SceneOptions options = SmallScene();
  options.pixel_noise = 1;
  Save(SynthesizeScene(options).model, folder_ / "input");
  const KrotResult result = Succeeded(
      Filter({"--OutlierFilter.profile_path", folder_ / "profile.json"}, "1"));
  EXPECT_THAT(result.out, HasSubstr("there is no elbow"));
  EXPECT_THAT(result.out, Not(HasSubstr("called wrong")));
  EXPECT_TRUE(ReadJson(folder_ / "profile.json")["elbow"].is_null());
}

TEST_F(OutlierFilterCommand, SaysWhatItDoesInEveryPhase) {
  const KrotResult result = Succeeded(WithoutABound(
      {"--OutlierFilter.method", "conflicts", "--log_level", "2"}));
  for (const char* phase :
       {"reading ", "measuring the noise", "comparing the errors with noise",
        "choosing what to remove", "conflicts of removed observations: ",
        "lowering the largest error", "writing "}) {
    EXPECT_THAT(result.err, HasSubstr(phase));
  }
}

TEST_F(OutlierFilterCommand, DrawsItsProfileDownToTheBoundThatIsGiven) {
  const std::string profile = folder_ / "profile.json";
  Succeeded(Filter({"--OutlierFilter.profile_path", profile}));
  const Json levels = ReadJson(profile)["levels"];
  EXPECT_LE(levels.back()["max_error"].get<double>(), 3);
  const Json report = ReadJson(folder_ / "r.json");
  EXPECT_EQ(report["max_error"], 3);
  EXPECT_EQ(report["num_removed"], levels.back()["num_removed"]);
}

TEST_F(OutlierFilterCommand, WritesModelsToLookAt) {
  Succeeded(Filter({"--suspects_path", folder_ / "suspects", "--overlay_path",
                    folder_ / "overlay"}));
  const Json report = ReadJson(folder_ / "r.json");
  const Model input = Load(folder_ / "input");
  const Model suspects = Load(folder_ / "suspects");
  const size_t num_kept = Load(folder_ / "output").points3D.size();
  ASSERT_EQ(suspects.points3D.size(), input.points3D.size());
  std::set<std::array<uint8_t, 3>> colors;
  for (const Point3D& point : suspects.points3D) colors.insert(point.color);
  EXPECT_EQ(colors.size(), 3u);
  EXPECT_EQ(Load(folder_ / "overlay").points3D.size(),
            input.points3D.size() + num_kept);
}

TEST_F(OutlierFilterCommand, RefusesToWriteModelsToLookAtOverOthers) {
  for (const char* name : {"--suspects_path", "--overlay_path"}) {
    for (const char* folder : {"input", "output"}) {
      const KrotResult result = Filter({name, folder_ / folder});
      EXPECT_EQ(result.exit_code, 1);
      EXPECT_THAT(result.err, HasSubstr("must be a folder of its own"));
    }
  }
}

TEST_F(OutlierFilterCommand, LeavesTwinsOfAnImageToTheEnd) {
  SceneOptions options = SmallScene();
  options.pixel_noise = 0;
  options.duplicate_ratio = 0.1;
  Save(SynthesizeScene(options).model, folder_ / "input");
  const auto removed = [&](const std::string& same_image) {
    Succeeded(Filter({"--Problem.same_image", same_image}, "0.1"));
    const Json report = ReadJson(folder_ / "r.json");
    EXPECT_TRUE(report["is_within"]);
    return std::pair<int, int>(report["num_removed"], report["num_must_go"]);
  };
  const auto [kept_removed, kept_proved] = removed("keep");
  const auto [closest_removed, closest_proved] = removed("closest");
  EXPECT_GT(kept_proved, 0);
  EXPECT_LT(closest_proved, kept_proved);
  EXPECT_GE(closest_removed, kept_proved);
}

TEST_F(OutlierFilterCommand, RefusesABoundThatIsNoPositiveNumber) {
  EXPECT_EQ(RunKrot({"outlier_filter", "--input_path", folder_ / "input",
                     "--output_path", folder_ / "output",
                     "--OutlierFilter.max_error", "0"})
                .exit_code,
            1);
}

TEST_F(OutlierFilterCommand, WithoutABoundRemovesWhatNoiseDoesNotExplain) {
  const KrotResult result =
      Succeeded(WithoutABound({"--outliers_path", folder_ / "o.csv",
                               "--html_path", folder_ / "r.html"}));
  EXPECT_THAT(result.out, HasSubstr("is more than noise of "));
  EXPECT_THAT(result.out,
              AllOf(Not(HasSubstr("must go")), Not(HasSubstr("conflicts")),
                    Not(HasSubstr("proved"))));
  const Json report = ReadJson(folder_ / "r.json");
  EXPECT_EQ(report["method"], "snooping");
  EXPECT_TRUE(report["max_error"].is_null());
  EXPECT_TRUE(report["num_must_go"].is_null());
  for (const Json& removed : report["removed"]) {
    EXPECT_TRUE(removed["w"].is_number() || removed["w"].is_null());
  }
  EXPECT_LE(report["pixel_error"]["after"]["rms"],
            report["snooping"]["kept_error_before"]["rms"]);
  EXPECT_EQ(WithoutABound({"--OutlierFilter.method", "snooping",
                           "--OutlierFilter.profile_path", folder_ / "p.json"})
                .exit_code,
            1);
  EXPECT_EQ(Filter({"--OutlierFilter.method", "snooping"}).exit_code, 1);
}

TEST_F(OutlierFilterCommand, WithoutABoundProvesHowManyMustGoIfAskedTo) {
  Succeeded(WithoutABound());
  const Json unproved = ReadJson(folder_ / "r.json");
  const KrotResult result =
      Succeeded(WithoutABound({"--conflicts_path", folder_ / "c.json"}));
  const Json report = ReadJson(folder_ / "r.json");
  EXPECT_EQ(report["num_removed"], unproved["num_removed"]);
  EXPECT_EQ(report["pixel_error"], unproved["pixel_error"]);
  EXPECT_EQ(report["snooping"], unproved["snooping"]);
  const int must_go = report["num_must_go"];
  EXPECT_GT(must_go, 0);
  EXPECT_LE(must_go, report["num_removed"]);
  EXPECT_THAT(result.out, HasSubstr("That at least " + std::to_string(must_go) +
                                    " observations must go is proved"));
  const KrotResult check = Succeeded(Check("c.json"));
  EXPECT_THAT(check.out, HasSubstr("at least " + std::to_string(must_go) +
                                   " observations must go"));
  EXPECT_THAT(check.out, HasSubstr("their own bounds in the file"));
}

TEST_F(OutlierFilterCommand, FiltersPanoramasAsTheCheckerSuggests) {
  SceneOptions options = SmallScene();
  options.camera_model_id = FindCameraModel("EQUIRECTANGULAR")->id;
  options.outlier_ratio = 0.01;
  Save(SynthesizeScene(options).model, folder_ / "input");
  const KrotResult check =
      RunKrot({"model_checker", "--input_path", folder_ / "input"});
  EXPECT_THAT(check.out, HasSubstr("krot outlier_filter --input_path"));
  EXPECT_THAT(check.out, Not(HasSubstr("krot bundle_adjuster")));
  Succeeded(WithoutABound({"--Solver.finish_loss", "cauchy"}));
  const Json report = ReadJson(folder_ / "r.json");
  EXPECT_GT(report["num_removed"], 0);
  EXPECT_LT(report["pixel_error"]["after"]["rms"],
            report["snooping"]["kept_error_before"]["rms"]);
}

TEST_F(OutlierFilterCommand, KeepsTracksOfOneThatItDoesNotJudge) {
  for (const double outlier_ratio : {0.0, 0.03}) {
    SceneOptions options = SmallScene();
    options.outlier_ratio = outlier_ratio;
    const Model alone = WithFirstTrackOfOne(SynthesizeScene(options).model);
    Save(alone, folder_ / "input");
    Succeeded(WithoutABound({}));
    const Model output = Load(folder_ / "output");
    EXPECT_EQ(output.points3D[0].track_end, 1);
    EXPECT_EQ(output.points3D[0].xyz, alone.points3D[0].xyz);
    if (outlier_ratio == 0) {
      EXPECT_THAT(output, IsModel(alone));
    }
  }
}

}  // namespace
}  // namespace krot::internal
