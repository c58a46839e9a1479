#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "krot/model.h"
#include "krot/model/model_checks.h"
#include "tests/cli/colmap.h"
#include "tests/cli/krot_process.h"
#include "tests/cli/scenes.h"

// Models whose tracks and images contradict each other, through every command
// that reads models.

namespace krot::internal {
namespace {

namespace fs = std::filesystem;

class OnContradiction : public ::testing::Test {
 protected:
  OnContradiction() {
    // A 2D point that its track's 3D point shares with another's track, one
    // that was forgotten by its image, one of a 3D point that is gone.
    model_ = SmallLegacyModel();
    TrackElement& shared = model_.track_elements[0];
    shared_point2D(shared).point3D_id = model_.points3D[1].id;
    shared_point2D(model_.track_elements.back()).point3D_id = kInvalidPoint3DId;
    for (Image& image : model_.images) {
      Point2D stray;
      stray.x = 5;
      stray.point3D_id = 999999;
      image.points2D.push_back(stray);
    }
    Save(model_, input_);
  }

  Point2D& shared_point2D(const TrackElement& element) {
    for (Image& image : model_.images) {
      if (image.id == element.image_id) {
        return image.points2D[element.point2D_idx];
      }
    }
    throw std::logic_error("no such image");
  }

  Words Solve(const std::string& name) const {
    return {"solver",        "--input_path",       input_,
            "--output_path", folder_ / name,       "--report_path",
            report_,         "--certificate_path", folder_ / (name + ".json")};
  }

  Json Report() const { return ReadJson(report_); }

  int num_images() const { return static_cast<int>(model_.images.size()); }

  const TempFolder folder_;
  const fs::path input_ = folder_ / "input";
  const fs::path report_ = folder_ / "report.json";
  Model model_;
};

Words With(const Words& arguments, const std::string& on_contradiction) {
  return arguments + Words{"--Model.on_contradiction", on_contradiction};
}

Words Check(const fs::path& model, const fs::path& certificate) {
  return {"certificate_checker", "--input_path", model, "--certificate_path",
          certificate};
}

TEST_F(OnContradiction, TheTracksAreFollowedAndBothFilesKeptWhereAsked) {
  const KrotResult result =
      Succeeded(RunKrot(With(Solve("output"), "follow_tracks")));
  EXPECT_THAT(result.err, HasSubstr("contradicts itself: 2 track elements"));
  EXPECT_THAT(result.err, HasSubstr("the tracks are followed"));
  Ignoring ignoring;
  ignoring.translations = ignoring.coordinates = ignoring.point_errors = true;
  EXPECT_THAT(Load(folder_ / "output"), IsModel(model_, ignoring));
  const Json contradictions = Report()["contradictions"];
  EXPECT_EQ(contradictions["track_elements"], 2);
  EXPECT_EQ(contradictions["points2D"], 1 + num_images());
  EXPECT_EQ(Report()["num_observations"], model_.track_elements.size());
  EXPECT_EQ(contradictions["followed"], "tracks");
  for (const fs::path& model : {input_, folder_ / "output"}) {
    Succeeded(
        RunKrot(With(Check(model, folder_ / "output.json"), "follow_tracks")));
  }
}

// Of the three contradictions the tracks are right about all.
TEST_F(OnContradiction, TheSideThatFitsIsFollowedByDefaultAndBothAgree) {
  const KrotResult result = Succeeded(RunKrot(Solve("output")));
  EXPECT_THAT(result.err, HasSubstr("the tracks are followed"));
  Model agreed = SmallLegacyModel();
  for (Image& image : agreed.images) {
    image.points2D.push_back({5, 0, kInvalidPoint3DId});
  }
  Ignoring ignoring;
  ignoring.translations = ignoring.coordinates = ignoring.point_errors = true;
  EXPECT_THAT(Load(folder_ / "output"), IsModel(agreed, ignoring));
  for (const fs::path& model : {input_, folder_ / "output"}) {
    Succeeded(RunKrot(Check(model, folder_ / "output.json")));
  }
}

// As GTSFM exports models: every track names the first 2D point of its images.
Model WithTracksOfFirst2DPoints(Model model) {
  for (TrackElement& element : model.track_elements) element.point2D_idx = 0;
  return model;
}

double LargestError(const Model& model) {
  return Summarize(PixelErrors(model)).max;
}

TEST_F(OnContradiction, TracksThatNameWrong2DPointsAreNotFollowed) {
  const Model right = SmallLegacyModel();
  const Model wrong = WithTracksOfFirst2DPoints(right);
  Save(wrong, input_);
  const KrotResult result = Succeeded(RunKrot(Solve("output")));
  EXPECT_THAT(result.err, HasSubstr("the images are followed"));
  const Json contradictions = Report()["contradictions"];
  EXPECT_EQ(contradictions["followed"], "images");
  EXPECT_NEAR(contradictions["max_px"]["tracks"].get<double>(),
              LargestError(wrong), 1e-9);
  EXPECT_NEAR(contradictions["max_px"]["images"].get<double>(),
              LargestError(right), 1e-9);
  const Model output = Load(folder_ / "output");
  EXPECT_FALSE(FindContradictions(output).Any());
  EXPECT_EQ(output.track_elements.size(), right.track_elements.size());
  EXPECT_LT(LargestError(output), LargestError(right));
}

// "Initial cost : 0.5 [px]", of the images' side: the root of half the sum of
// the squared errors over the number of coordinates.
double InitialCostOfColmap(const fs::path& model, const TempFolder& folder) {
  fs::create_directory(folder / "adjusted");
  EXPECT_TRUE(RunColmap({"bundle_adjuster", "--input_path", model,
                         "--output_path", folder / "adjusted"},
                        folder / "colmap.log"));
  const std::string log = ReadBytes(folder / "colmap.log");
  return std::stod(log.substr(log.find(':', log.find("Initial cost")) + 1));
}

TEST_F(OnContradiction, ColmapsAdjustmentBeginsWithTheErrorsThatWereReported) {
  if (!HasColmap()) GTEST_SKIP() << "COLMAP is not installed";
  Save(WithTracksOfFirst2DPoints(SmallLegacyModel()), input_);
  Succeeded(RunKrot(Solve("output")));
  EXPECT_NEAR(2 * InitialCostOfColmap(folder_ / "output", folder_),
              Report()["pixel_error"]["after"]["rms"].get<double>(), 1e-3);
}

TEST_F(OnContradiction, ErrorsThatFallAsAllPointsBecomeOneAreNoResult) {
  const Model wrong = WithTracksOfFirst2DPoints(SmallLegacyModel());
  Save(wrong, input_);
  const KrotResult result = RunKrot(With(Solve("output"), "follow_tracks"));
  EXPECT_EQ(result.exit_code, 8);
  const std::string words = "all " + std::to_string(wrong.points3D.size()) +
                            " points that two cameras see lie in one place";
  EXPECT_THAT(result.err, HasSubstr("warning: No estimate is of use: "));
  EXPECT_THAT(result.err, HasSubstr(words));
  EXPECT_THAT(result.out, HasSubstr(words));
  EXPECT_EQ(Report()["termination"], "collapsed");
  EXPECT_EQ(Report()["collapse"]["is_in_one_place"], true);
  Ignoring point_errors;
  point_errors.point_errors = true;
  EXPECT_THAT(Load(folder_ / "output"), IsModel(wrong, point_errors));
}

TEST_F(OnContradiction, AnAdjustmentThatMakesAllPointsOneSaysSo) {
  Save(WithTracksOfFirst2DPoints(SmallLegacyModel()), input_);
  const KrotResult result =
      RunKrot(With({"bundle_adjuster", "--input_path", input_, "--output_path",
                    folder_ / "adjusted"},
                   "follow_tracks"));
  EXPECT_THAT(result.err, HasSubstr("warning: what was written is of no use: "
                                    "the errors fall only where "));
  EXPECT_THAT(result.err, HasSubstr("warning: by the images' side"));
}

// A 2D point far away that an image names rightly, and a track wrongly, too.
TEST_F(OnContradiction, WhereTheImagesSideBecomesWorseTheModelIsGivenBack) {
  Model model = SmallLegacyModel();
  model.track_elements.push_back(model.track_elements.front());
  ++model.points3D.back().track_end;
  Save(model, input_);
  const std::string words = "by the images' side";
  const KrotResult by_tracks = RunKrot(With(Solve("output"), "follow_tracks"));
  EXPECT_EQ(by_tracks.exit_code, 8);
  EXPECT_THAT(by_tracks.err, HasSubstr("warning: No better estimate"));
  EXPECT_THAT(by_tracks.err, HasSubstr(words));
  EXPECT_THAT(by_tracks.out, HasSubstr(words));
  Ignoring point_errors;
  point_errors.point_errors = true;
  EXPECT_THAT(Load(folder_ / "output"), IsModel(model, point_errors));
  const KrotResult by_default = Succeeded(RunKrot(Solve("default")));
  EXPECT_THAT(by_default.err, Not(HasSubstr(words)));
  EXPECT_LT(LargestError(Load(folder_ / "default")),
            LargestError(SmallLegacyModel()));
}

// The 2D points of the images' side are one off, those of the tracks' two.
TEST_F(OnContradiction, WhereNeitherSideFitsEveryCommandRefuses) {
  Model model = SmallLegacyModel();
  for (Image& image : model.images) {
    const Point2D first = image.points2D.front();
    for (size_t n = 0; n < image.points2D.size(); ++n) {
      const Point2D& next =
          n + 1 < image.points2D.size() ? image.points2D[n + 1] : first;
      image.points2D[n].x = next.x;
      image.points2D[n].y = next.y;
    }
  }
  for (TrackElement& element : model.track_elements) {
    element.point2D_idx = (element.point2D_idx + 1) % 10;
  }
  Save(model, input_);
  const std::vector<Words> commands = {
      Solve("output"),
      {"bundle_adjuster", "--input_path", input_, "--output_path",
       folder_ / "output"},
      {"model_checker", "--input_path", input_},
      {"tolerance_analyzer", "--input_path", input_,
       "--ToleranceAnalyzer.max_error", "9"}};
  for (const Words& command : commands) {
    EXPECT_THAT(RunKrot(command),
                IsRefused(2, "krot " + command[0],
                          "neither fits; --Model.on_contradiction"))
        << command[0];
    EXPECT_FALSE(fs::exists(folder_ / "output"));
  }
  Succeeded(
      RunKrot(With({"model_analyzer", "--path", input_}, "follow_images")));
}

TEST_F(OnContradiction, TheImagesAreFollowedWhereAskedAndAgreeAfterwards) {
  const KrotResult result =
      Succeeded(RunKrot(With(Solve("output"), "follow_images")));
  EXPECT_THAT(result.err, HasSubstr("the images are followed"));
  EXPECT_FALSE(FindContradictions(Load(folder_ / "output")).Any());
  const fs::path certificate = folder_ / "output.json";
  Succeeded(RunKrot(Check(folder_ / "output", certificate)));
  Succeeded(RunKrot(With(Check(input_, certificate), "follow_images")));
  EXPECT_EQ(RunKrot(Check(input_, certificate)).exit_code, 4);
}

TEST_F(OnContradiction, EveryCommandRefusesWhereAsked) {
  WriteBytes(folder_ / "certificate.json",
             R"({"version": 2, "norm": "inf", "lower_bound": 1, "rows_bound": 1,
                 "defect": 0,
                 "model_sha256": "", "observations": []})");
  const std::vector<Words> commands = {
      Solve("output"),
      {"point_triangulator", "--input_path", input_, "--output_path",
       folder_ / "output"},
      {"bundle_adjuster", "--input_path", input_, "--output_path",
       folder_ / "output"},
      {"model_analyzer", "--path", input_},
      {"model_comparer", "--input_path1", input_, "--input_path2", input_},
      Check(input_, folder_ / "certificate.json"),
  };
  for (const Words& command : commands) {
    EXPECT_THAT(RunKrot(With(command, "refuse")),
                IsRefused(2, "krot " + command[0],
                          "in its track, but that 2D point "
                          "names"))
        << command[0];
    EXPECT_FALSE(fs::exists(folder_ / "output"));
  }
}

TEST_F(OnContradiction, EveryOtherCommandReadsAndCounts) {
  const std::vector<Words> commands = {
      {"point_triangulator", "--input_path", input_, "--output_path",
       folder_ / "points"},
      {"bundle_adjuster", "--input_path", input_, "--output_path",
       folder_ / "adjusted"},
      {"model_analyzer", "--path", input_},
      {"model_comparer", "--input_path1", input_, "--input_path2", input_,
       "--overlay_path", folder_ / "overlay"},
  };
  for (const Words& command : commands) {
    const KrotResult result =
        Succeeded(RunKrot(command, {"--report_path", report_}));
    EXPECT_THAT(result.err, HasSubstr("contradicts itself")) << command[0];
    Json contradictions = Report()["contradictions"];
    if (command[0] == "model_comparer") {
      EXPECT_EQ(contradictions["model1"], contradictions["model2"]);
      contradictions = contradictions["model1"];
      EXPECT_EQ(Report()["num_observations"]["shared"],
                model_.track_elements.size());
    }
    EXPECT_EQ(contradictions["track_elements"], 2) << command[0];
    fs::remove(report_);
  }
  EXPECT_FALSE(FindContradictions(Load(folder_ / "overlay")).Any());
}

TEST_F(OnContradiction, A2DPointInTwoTracksIsAnObservationOfBoth) {
  Model model = SmallLegacyModel();
  // The last track ends with the first one's first 2D point, too.
  model.track_elements.push_back(model.track_elements.front());
  ++model.points3D.back().track_end;
  Save(model, folder_ / "twice");
  Succeeded(RunKrot(
      With({"model_comparer", "--input_path1", folder_ / "twice",
            "--input_path2", folder_ / "twice", "--report_path", report_},
           "follow_tracks")));
  EXPECT_EQ(Report()["num_observations"]["shared"],
            model.track_elements.size());
  EXPECT_EQ(Report()["num_points"]["shared"], model.points3D.size());
}

}  // namespace
}  // namespace krot::internal
